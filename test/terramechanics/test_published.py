# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Published measurements: what the validation page claims, held to its targets."""

import numpy as np
import pytest
import yaml

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.shipped import configuration_folder
from wheel_terra_estimator.discrepancy.report.model_file import write_files
from wheel_terra_estimator.discrepancy.workflow import Options, diagnose
from wheel_terra_lab.studies.discrepancy_demonstrations import cmu_fitted
from wheel_terra_lab.studies.model_validation import (
    cmu_wheel,
    grc3_wheel,
    hit_wheels,
    shipped_soils,
)
from wheel_terra_lab.studies.model_validation.fitting import Misfit, deviations, fit

pytestmark = pytest.mark.shared


def test_hit_lugged_wheel_from_the_smooth_one(shared):
    table = shared.parent / 'reference' / 'measured_single_wheel.csv'
    smooth = hit_wheels.read(table, 'HIT_Wh34_smooth')
    lugged = hit_wheels.read(table, 'HIT_Wh32_lug10')
    model, _ = fit(hit_wheels.BASE, [smooth], hit_wheels.SIGMA, hit_wheels.SMOOTH_PARAMETERS)
    start = model.with_values({**hit_wheels.PUBLISHED_LUGS, 'effects.lug_digging.rework': 1.0})
    lugs, values = fit(start, [lugged], hit_wheels.SIGMA, hit_wheels.FITTED_LUGS)
    assert len(values) == 2
    misfit = Misfit.of(lugs.predict(lugged[0]), lugged[1])
    assert misfit.pull_rms < 0.10 * misfit.pull_range
    assert misfit.sinkage_rms < 0.0015


def test_plates_predict_the_rolling_cmu_wheel(shared):
    folder = shared / 'cmu_single_wheel'
    soil, rms, _ = cmu_wheel.plates(folder / 'pressure_sinkage.csv')
    assert rms < 0.15
    model = cmu_wheel.Model(soil, {})
    depth = model.predict(cmu_wheel.OperatingPoints(0.0, 24.5, cmu_wheel.WHEEL))[0, 0]
    assert depth == pytest.approx(0.0144, rel=0.15)  # mean of the measured rolling rows


@pytest.mark.parametrize(
    ('name', 'case'), [('cmu_sand_fit', shipped_soils.cmu_sand), ('grc3_fit', shipped_soils.grc3)]
)
def test_shipped_soil_is_its_fit_and_states_its_deviations(name, case, shared):
    model, data, sigma, free = case(shared.parent)
    fitted, values = fit(model, data, sigma, free)
    std = deviations(fitted, data, sigma, free)
    text = (configuration_folder() / 'soils' / f'{name}.yaml').read_text(encoding='utf-8')
    stated = yaml.safe_load(text)['/**']['ros__parameters']
    for key, value in values.items():
        *folders, last = key.split('.')
        place = stated
        for folder in folders:
            place = place[folder]
        angle = last.endswith('friction_angle')
        unit, ending = (np.degrees(1.0), '_deg') if angle else (1.0, '')
        assert place[f'{last}{ending}'] == pytest.approx(unit * value, abs=0.05 * unit * std[key])
        assert place[f'{last}_std{ending}'] == pytest.approx(unit * std[key], rel=0.2)


def test_shipped_cmu_sand_agrees_with_its_own_rows(shared, tmp_path):
    case = cmu_fitted(shared.parent)
    few = Options(effects=('bulldozing', 'cohesion', 'drivetrain_friction'))
    diagnosis = diagnose(case.table, case.configuration, options=few)
    assert diagnosis.verdict == 'agrees'
    assert diagnosis.gap['sinkage'].before < 0.0016
    assert diagnosis.gap['drawbar_pull'].before < 0.85
    write_files(diagnosis, tmp_path, pictures=False)
    written = reader.load([tmp_path / 'model.yaml'], complete=False)
    assert diagnose(case.table, written, options=few).verdict == 'agrees'


def test_mound_predicts_the_rows_it_did_not_see_on_grc3(shared):
    slip, measured = grc3_wheel.read(shared.parent)
    even = np.arange(slip.size) % 2 == 0
    data = [(grc3_wheel.points_at(slip[even]), measured[even])]
    errors = []
    for free in ((*grc3_wheel.SOIL, *grc3_wheel.MOUND), grc3_wheel.SOIL):
        model, _ = fit(grc3_wheel.BASE, data, grc3_wheel.SIGMA, free)
        error = model.predict(grc3_wheel.points_at(slip[~even])) - measured[~even]
        errors.append(np.sqrt(np.mean(error[:, 1] ** 2)) / np.ptp(measured[:, 1]))
    assert errors[0] < 0.10
    assert errors[0] < 0.8 * errors[1]
