# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The Python interface against the commands, and its own examples."""

import csv
import doctest
import importlib
import io
import pickle
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest

from wheel_terra_estimator import api
from wheel_terra_estimator.discrepancy import decision
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)

mpl.use('agg')
MODULES = ('', '.models', '.soils', '.drives', '.tables')
SECONDS = 2.0  # of the simulated drive


@pytest.mark.parametrize('name', MODULES)
def test_examples_in_docstrings(name):
    module = importlib.import_module(f'wheel_terra_estimator.api{name}')
    result = doctest.testmod(module)
    assert result.failed == 0
    assert result.attempted > 0


def test_curve_is_that_of_predict(printed):
    files = ('hit_wh3', 'hit_fit')
    command = ['predict', '--config', files[0], '--config', files[1], '--slip', '0.1,0.4']
    rows = list(csv.DictReader(io.StringIO(printed([*command, '--load', '80']))))
    curve = api.Model.load(*files).curve([0.1, 0.4], 80.0)
    for name in ('sinkage', 'drawbar_pull', 'torque'):
        np.testing.assert_allclose(
            getattr(curve, name), [float(row[name]) for row in rows], rtol=1e-8
        )


def test_a_model_of_objects_is_that_of_its_files():
    loaded = api.Model.load('hit_wh3', 'hit_fit')
    built = api.Model(loaded.wheel, loaded.soil, loaded.effects)
    again = api.Model(loaded.wheel, api.Soil.load('hit_fit'), loaded.effects)
    again = pickle.loads(pickle.dumps(again))  # as multiprocessing does
    slip = np.linspace(-0.5, 0.9, 9)
    for model in (built, again):
        np.testing.assert_allclose(
            model.curve(slip, 60.0).drawbar_pull, loaded.curve(slip, 60.0).drawbar_pull, rtol=1e-9
        )


WHEEL = api.Wheel(0.13, 0.16)
SLIPS = np.arange(1, 10) / 20
TOO_HEAVY = {'slip': SLIPS, 'normal_load': [1e5] * 9, 'sinkage': 0.1 * SLIPS}


@pytest.mark.parametrize(
    ('call', 'words'),
    [
        (lambda: api.Model(api.Wheel([0.1, 0.2], 0.1), 'dlr_mss'), 'wheel: radius has 2 values'),
        (lambda: api.Model(api.Wheel(0.1, 0.1, 0.0, 12.6), 'dlr_mss'), r'12\.6 is not an integer'),
        (lambda: api.Model(WHEEL, 'dlr_mss', {'lug_digging': None}), 'effect lug_digging is of'),
        (lambda: api.Soil.fit(TOO_HEAVY, None), 'wheel is of type NoneType'),
        pytest.param(
            lambda: api.Soil.fit(TOO_HEAVY, WHEEL),
            'no shipped soil carries .*: start',
            marks=pytest.mark.slow,
        ),
        (
            lambda: api.Model(WHEEL, 'dlr_mss').sweep(0.1, 80.0, parameters={'soil.density': []}),
            r'no value for soil\.density',
        ),
        (lambda: api.simulate(seed=-1), 'seed is -1; give a whole number'),
        (lambda: api.simulate(seed=1.5), r'seed is 1\.5; give a whole number'),
        (lambda: api.simulate(duration=0.01), r'duration is 0\.01 s; the wheels are read every'),
        (lambda: api.plot_curve(api.Model(WHEEL, 'dlr_mss')), 'curves is of type Model; give'),
        (lambda: api.plot_estimates({}), 'there are none: give what estimate returned'),
    ],
)
def test_arguments_that_cannot_be_used(call, words):
    with pytest.raises(api.UserError, match=words):
        call()


def test_a_load_that_the_soil_cannot_carry_is_nan():
    curve = api.Model.load('hit_wh3', 'dlr_mss').curve([0.2, 0.2], [50.0, 1e6])
    assert np.isfinite(curve.sinkage[0])
    assert np.isnan(curve.sinkage[1])
    assert repr(api.Model.load('hit_wh3', 'dlr_mss').curve([], 50.0)) == 'Curve of 0 points'


@pytest.fixture(scope='module')
def drive():
    return api.simulate('firm_drive', seed=3, duration=SECONDS)


@pytest.fixture(scope='module')
def direct(drive):
    return api.estimate(drive, as_frame=False)


def test_simulated_drive_and_its_bag_give_the_same_numbers(drive, direct, tmp_path):
    api.simulate('firm_drive', seed=3, duration=SECONDS, output=tmp_path / 'bag')
    bag = api.estimate(tmp_path / 'bag', drive.configuration, as_frame=False)
    assert direct.keys() == bag.keys()
    np.testing.assert_array_equal(direct['stamp'], bag['stamp'])
    for name in direct:
        np.testing.assert_allclose(direct[name], bag[name], rtol=1e-5, atol=1e-5, err_msg=name)


def test_parameters_count_for_a_simulated_drive(drive, direct):
    other = api.estimate(drive, parameters=['rover.mass:=400.0'], as_frame=False)
    load = f'normal_load.{drive.configuration.wheels.names[0]}'
    assert other[load][-1] != pytest.approx(direct[load][-1])
    with pytest.raises(api.UserError, match=r'no\.such\.key'):
        api.taught(drive, parameters=['no.such.key:=1'])


def logged(drive):
    """Return the measurements of a drive as a table of logged values, merged by stamp."""
    wheels = drive.configuration.wheels.names
    rows: dict[int, dict[str, float]] = {}
    for arrival in drive.arrivals:
        m = arrival.measurement
        row = rows.setdefault(m.stamp, {'time': m.stamp * 1e-9})
        if isinstance(m, WheelOdometry):
            row |= {f'rate.{w}': v for w, v in zip(wheels, m.rate, strict=True)}
            row |= {f'torque.{w}': v for w, v in zip(wheels, m.torque, strict=True)}
        elif isinstance(m, InertialReading):
            row |= dict(zip((f'specific_force.{a}' for a in 'xyz'), m.specific_force, strict=True))
            row |= dict(zip((f'angular_rate.{a}' for a in 'xyz'), m.angular_rate, strict=True))
            if m.orientation is not None:
                row |= dict(zip((f'orientation.{a}' for a in 'xyzw'), m.orientation, strict=True))
        elif isinstance(m, SinkageReading):
            row |= {f'sinkage.{w}': v for w, v in zip(wheels, m.sinkage, strict=True)}
        elif isinstance(m, ReferenceVelocity):
            row |= {'reference_velocity': m.forward, 'reference_velocity_std': m.variance**0.5}
    names = dict.fromkeys(name for row in rows.values() for name in row)
    ordered = [rows[stamp] for stamp in sorted(rows)]
    return {name: np.array([row.get(name, np.nan) for row in ordered]) for name in names}


@pytest.fixture(scope='module')
def of_table(drive):
    return api.estimate(logged(drive), drive.configuration, as_frame=False)


def test_logged_values_give_the_numbers_of_the_drive(drive, of_table):
    # A table has no late arrivals: each reading stands at its stamp.
    arrivals = sorted(drive.arrivals, key=lambda a: a.measurement.stamp)
    ordered = api.estimate(replace(drive, arrivals=arrivals), as_frame=False)
    assert ordered['time'].size > 15
    for name in ordered:
        np.testing.assert_allclose(
            ordered[name], of_table[name], rtol=1e-4, atol=1e-5, err_msg=name
        )


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'slip': [0.1]}, 'unknown column'),
        ({'time': None}, "needs the columns 'time'"),
        ({'time': [2.0, 1.0]}, 'must not go back'),
        ({'time': [1e9, 3e9]}, 'is its unit right'),
        ({'time': [1.0]}, 'different lengths'),
        ({'time': ['a', 'b']}, 'does not hold numbers'),
    ],
)
def test_logged_values_that_cannot_be_used(drive, change, words):
    wheel = drive.configuration.wheels.names[0]
    rows = {'time': [0.0, 0.1], f'rate.{wheel}': [1.0, 1.0]} | change
    rows = {name: values for name, values in rows.items() if values is not None}
    if 'slip' in rows:
        rows['slip'] = [0.1, 0.1]
    with pytest.raises(api.UserError, match=words):
        api.estimate(rows, drive.configuration, as_frame=False)


@pytest.fixture(scope='module')
def named():
    """A diagnosis of rows in which soil sticks together more than the model says."""
    true = api.Model.load('hit_wh3', 'hit_fit', parameters=['soil.cohesion:=1500.0'])
    slip, load = (a.ravel() for a in np.meshgrid(np.linspace(0.05, 0.6, 14), [60.0, 100.0]))
    rows = true.curve(slip, load).columns()
    noise = np.random.default_rng(4).standard_normal((3, slip.size))
    rows['sinkage'] = rows['sinkage'] + 1e-4 * noise[0]
    rows['drawbar_pull'] = rows['drawbar_pull'] + 0.1 * noise[1]
    rows['torque'] = rows['torque'] + 0.01 * noise[2]
    kept = ('slip', 'normal_load', 'sinkage', 'drawbar_pull', 'torque')
    measured = {name: rows[name] for name in kept}
    model = api.Model.load('hit_wh3', 'hit_fit')
    return measured, api.diagnose(measured, model, effects=['cohesion', 'hard_layer'])


def test_diagnose_and_the_corrected_model(named):
    measured, diagnosis = named
    assert [effect.name for effect in diagnosis.effects] == ['cohesion']
    after = api.corrected_model(diagnosis).curve(measured['slip'], measured['normal_load'])
    before = api.Model.load('hit_wh3', 'hit_fit').curve(measured['slip'], measured['normal_load'])

    def error(curve):
        return np.sqrt(np.mean((curve.drawbar_pull - measured['drawbar_pull']) ** 2))

    assert error(after) < 0.2 < 0.1 * error(before)


def test_diagnose_refuses_unknown_columns():
    with pytest.raises(api.UserError, match=r"no column 'slip'.*'slipp' \(slip\?\)"):
        api.diagnose({'slipp': [0.1]}, 'hit_wh3')


def test_pictures_return_axes(drive, direct, named):
    from matplotlib import pyplot

    curve = api.Model.load('hit_wh3', 'hit_fit').curve([0.4, 0.1], 80.0)
    panels = api.plot_curve({'fit': curve})
    assert panels[0].get_ylabel() == 'sinkage [mm]'
    assert list(panels[1].lines[0].get_xdata()) == [0.1, 0.4]
    panel = api.plot_estimates(direct)
    wheels = drive.configuration.wheels
    assert len(panel.lines) == wheels.count
    unknown = direct[f'slip_class.{wheels.names[0]}'] == 255
    assert np.isnan(panel.lines[0].get_ydata()[unknown]).all()
    with pytest.raises(api.UserError, match='there are slip, '):
        api.plot_estimates(direct, 'speed')
    bars = api.plot_diagnosis(named[1])
    assert len(bars.patches) == 9
    middles = [bar.get_x() + 0.5 * bar.get_width() for bar in bars.patches[:3]]
    assert middles == pytest.approx([-0.8 / 3, 0.0, 0.8 / 3])
    for row, gap in enumerate(named[1].gap.values()):  # shares of the error as configured
        heights = [bar.get_height() for bar in bars.patches[3 * row : 3 * row + 3]]
        shares = np.array([gap.before, gap.refit, gap.after, gap.noise]) / gap.before
        assert heights == pytest.approx(shares[:3].tolist())
        (mark,) = bars.collections[row].get_segments()
        assert mark[:, 0] == pytest.approx([row - 0.4, row + 0.4])
        assert mark[:, 1] == pytest.approx(shares[3])
    pyplot.close('all')


@pytest.mark.parametrize('name', ['dlr_mss', 'rose_lab_reece'])
def test_a_soil_is_saved_as_it_was(name, tmp_path):
    soil = api.Soil.load(name).replace(std={'cohesion': 40.0, 'friction_angle': 0.02})
    again = api.Soil.load(soil.save(tmp_path / 'soil.yaml'))
    for part, other in ((vars(soil), vars(again)), (soil.std, again.std)):
        assert part.keys() == other.keys()
        for key in part.keys() - {'std'}:
            assert part[key] == pytest.approx(other[key])
    with pytest.raises(api.UserError, match='exists'):
        soil.save(tmp_path / 'soil.yaml')
    assert soil.replace(cohesion=1.0).std == {'friction_angle': 0.02}
    with pytest.raises(api.UserError, match="did you mean 'friction_angle'"):
        soil.replace(friction=0.5)
    with pytest.raises(api.UserError, match='states no soil'):
        api.Soil.load('hit_wh3')


@pytest.mark.parametrize('name', [pytest.param('dlr_mss', marks=pytest.mark.slow), 'lete_sand'])
def test_a_soil_is_found_again_without_its_file(name, monkeypatch):
    """The start may be any other shipped soil; what one wheel width tells is kc/b + kphi."""
    others = [other for other in api.Soil.available() if other != name]
    monkeypatch.setattr(api.Soil, 'available', lambda: others)
    wheel, true = api.Wheel(0.13, 0.16, 0.01, 24), api.Soil.load(name)
    slip, load = (a.ravel() for a in np.meshgrid(np.linspace(0.02, 0.6, 15), [60.0, 90.0, 120.0]))
    rows = api.Model(wheel, true).curve(slip, load).columns()
    noise = np.random.default_rng(1)
    for quantity in ('sinkage', 'drawbar_pull', 'torque'):
        spread = 0.02 * np.ptp(rows[quantity])
        rows[quantity] = rows[quantity] + spread * noise.standard_normal(slip.size)
    found = api.Soil.fit(rows, wheel)
    for field in ('sinkage_exponent', 'cohesion', 'friction_angle', 'shear_modulus'):
        assert abs(getattr(found, field) - getattr(true, field)) < 3.0 * found.std[field], field
    stiffness, wanted = (s.cohesive_modulus / 0.16 + s.frictional_modulus for s in (found, true))
    assert abs(stiffness - wanted) < 3.0 * found.std['frictional_modulus']


def test_a_fit_starts_from_the_shipped_soil_nearest_to_the_rows():
    wheel, true = api.Wheel(0.13, 0.16), api.Soil.load('lete_sand')
    slip, load = (a.ravel() for a in np.meshgrid(np.linspace(0.05, 0.6, 8), [60.0, 90.0]))
    found = api.Soil.fit(api.Model(wheel, true).curve(slip, load).columns(), wheel)
    assert found.density == true.density  # which no fit changes


def test_a_fit_says_what_the_soil_does_not_explain_and_seeks_no_law(monkeypatch):
    monkeypatch.setattr(decision, 'propose', None)
    wheel = api.Wheel(0.13, 0.16, 0.01, 24)
    slip, load = (a.ravel() for a in np.meshgrid(np.linspace(0.02, 0.9, 10), [60.0, 90.0]))
    rows = api.Model(wheel, 'dlr_mss').curve(slip, load).columns()
    rows['drawbar_pull'] = rows['drawbar_pull'] + 20.0 * np.sin(7.0 * slip)
    with pytest.warns(UserWarning, match=r'does not explain .*drawbar_pull.*diagnose'):
        api.Soil.fit(rows, wheel, start='dlr_mss')
    wheel = api.Wheel(0.157, 0.165)
    slip, load = (a.ravel() for a in np.meshgrid(np.linspace(0.05, 0.7, 8), [40.0, 80.0, 160.0]))
    rows = api.Model(wheel, 'dlr_mss').curve(slip, load).columns()
    rows |= {'drawbar_pull_std': 0.01 * load, 'torque_std': 0.0016 * load}
    rows |= {'sinkage': rows['sinkage'] + 0.004, 'sinkage_std': np.full(len(load), 3e-4)}
    with pytest.warns(UserWarning, match=r'zero error of some millimetres'):
        api.Soil.fit(rows, wheel, start='dlr_mss')


def test_a_worse_model_is_not_given_in_silence(named):
    _, diagnosis = named
    gap = {'torque': replace(diagnosis.gap['torque'], before=1.0, after=1.3)}
    with pytest.warns(UserWarning, match=r'undecided.*worse.*torque 30 %.*diagnosis.configuration'):
        api.corrected_model(replace(diagnosis, verdict='undecided', gap=gap))


def test_degrees_and_per_cent_are_told():
    model = api.Model.load('hit_wh3', 'hit_fit')
    with pytest.raises(ValueError, match=r'math.radians\(15\)'):
        model.curve([0.1], 80.0, 15.0)
    with pytest.raises(ValueError, match='from per cent: 30 / 100'):
        model.curve([30.0], 80.0)
    with pytest.raises(ValueError, match=r'friction angle is 30 rad.*math.radians\(30\)'):
        model.soil.replace(friction_angle=30.0)


def test_units_go_with_frames(drive):
    pytest.importorskip('pandas')
    model = api.Model.load('hit_wh3', 'hit_fit')
    slip, load = (a.ravel() for a in np.meshgrid(np.linspace(0.05, 0.6, 8), [60.0, 100.0]))
    frame = model.curve(slip, load).to_frame()
    assert frame.attrs['units']['torque'] == 'N m'
    plain = api.diagnose(frame, model, effects=[])
    frame['sinkage'] *= 1000.0
    frame.attrs['units']['sinkage'] = 'mm'
    frame['Fx'] = -frame.pop('drawbar_pull') / 1000.0
    frame.attrs['units']['Fx'] = 'kN'
    other = api.diagnose(frame, model, effects='cohesion', columns={'drawbar_pull': '-Fx'})
    assert 'cohesion' not in other.not_tried
    for name, column in plain.table.columns.items():
        np.testing.assert_allclose(other.table.columns[name], column)
    frame.attrs['units'] = {'sinkag': 'mm'}
    with pytest.raises(api.UserError, match="'sinkag', which is no column"):
        api.diagnose(frame, model)

    estimates, truth = api.estimate(drive), drive.truth.to_frame()
    assert estimates['time'].iloc[0] == 0.0
    wheel = drive.configuration.wheels.names[0]
    assert estimates.attrs['units'][f'pull_margin.{wheel}'] == 'N'
    assert estimates.attrs['units'][f'lateral_force.{wheel}'] == 'N'
    assert estimates.attrs['units'][f'slip_angle_std.{wheel}'] == 'rad'
    assert truth.attrs['units'][f'slip_velocity.{wheel}'] == 'm/s'
    beside = estimates[[f'slip.{wheel}']].join(truth[[f'slip.{wheel}']], rsuffix='.true')
    assert len(beside) == len(estimates)
    assert beside.iloc[15:].notna().all().all()
    assert len(estimates.resample('1s').mean()) in (3, 4)


def test_a_log_with_an_index_of_time_and_other_units(drive, of_table):
    pandas = pytest.importorskip('pandas')
    log = pandas.DataFrame(logged(drive))
    wheels = drive.configuration.wheels.names
    log.index = pandas.to_datetime(log.pop('time'), unit='s')
    for wheel in wheels:
        log[f'rate.{wheel}'] *= 30.0 / np.pi
    log.attrs['units'] = {f'rate.{wheel}': 'rpm' for wheel in wheels}
    log.index += pandas.Timedelta('20000d')
    name = f'slip.{wheels[0]}'
    for zone in (None, 'Europe/Berlin'):
        local = log.tz_localize(zone)
        have = api.estimate(local, drive.configuration)
        np.testing.assert_allclose(have[name], of_table[name], atol=1e-6)
        assert local.join(have, rsuffix='.estimated')[name].notna().sum() == len(have)
    plain = log.drop(columns=f'rate.{wheels[0]}').iloc[:40]  # pandas keeps its unit
    assert len(api.estimate(plain, drive.configuration)) > 1
    log.attrs['units'] = {f'rate.{wheels[0]}': 'knots'}
    with pytest.raises(api.UserError, match=r"in 'knots'.*give it in rad/s"):
        api.estimate(log, drive.configuration, as_frame=False)
    log.attrs['units'] = {'rate.nope': 'rpm'}
    with pytest.raises(api.UserError, match=r"'rate.nope', which is no column"):
        api.estimate(log, drive.configuration, as_frame=False)


def test_a_sweep_is_the_curves_of_its_models():
    model = api.Model.load('hit_wh3', 'hit_fit')
    angles = [25.0, 35.0]
    grid = {'slip': [0.1, 0.2, 0.4], 'normal_load': [60.0, 90.0]}
    rows = model.sweep(**grid, parameters={'soil.friction_angle_deg': angles}, as_frame=False)
    for angle in angles:
        soil = model.soil.replace(friction_angle_deg=angle)
        other = api.Model(model.wheel, soil, model.effects)
        for load in grid['normal_load']:
            kept = (rows['soil.friction_angle_deg'] == angle) & (rows['normal_load'] == load)
            curve = other.curve(grid['slip'], load)
            np.testing.assert_array_equal(rows['slip'][kept], curve.slip)
            np.testing.assert_allclose(rows['torque'][kept], curve.torque, rtol=1e-9)
    one = model.sweep(**grid, parameters={'soil.friction_angle_deg': 35.0}, as_frame=False)
    np.testing.assert_array_equal(one['torque'], rows['torque'][6:])
    number, switch = 'effects.hard_layer.depth', 'effects.hard_layer.enabled'
    with pytest.warns(api.ConfigurationWarning, match=f'{number}: changes nothing .* {switch}'):
        model.sweep(**grid, parameters={number: [0.01, 0.02]}, as_frame=False)
    model.sweep(**grid, parameters={switch: [False, True], number: [0.01]}, as_frame=False)


def test_without_pandas_it_says_so(monkeypatch):
    monkeypatch.setitem(__import__('sys').modules, 'pandas', None)
    curve = api.Model.load('hit_wh3', 'hit_fit').curve([0.1], 80.0)
    with pytest.raises(api.UserError, match='pip install pandas'):
        curve.to_frame()
