# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The discrepancy workflow on measurements of other people: one command, a report per case.

    python -m wheel_terra_lab.studies.discrepancy_demonstrations -o demonstrations \
        [--only hit kls1 ...]
    python -m wheel_terra_lab.studies.discrepancy_demonstrations -o demonstrations --no-pictures

Measured data are looked for in ``../shared`` (``--shared`` says where else); a case whose data are
not there is skipped, visibly. Each case writes ``report.json``, ``report.html``, ``model.yaml``
and pictures into a folder of its name; the verdicts are listed on the terminal and in
``summary.md``. What they mean is discussed in ``docs/discrepancy/demonstrations.md``.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.discrepancy.report.model_file import write_files
from wheel_terra_estimator.discrepancy.result import Diagnosis
from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.tables.steady_table import SteadyTable
from wheel_terra_estimator.discrepancy.workflow import diagnose
from wheel_terra_estimator.errors import UserError

Rows = dict[str, list[float]]


@dataclass(frozen=True)
class Case:
    """A table, the model believed in, and what one would expect beforehand."""

    question: str
    table: SteadyTable
    configuration: Configuration
    reference: SteadyTable | None = None
    notes: tuple[str, ...] = field(default_factory=tuple)


def _published(shared: Path, prefix: str, std: Mapping[str, float]) -> Rows:
    """Return digitised single-wheel rows of one series, with a reading error per cell."""
    path = shared / 'measured' / 'published_single_wheel' / 'single_wheel_experiments.csv'
    columns = {
        'slip': 'slip', 'normal_load': 'vertical_load_n', 'wheel_radius': 'wheel_radius_m',
        'wheel_width': 'wheel_width_m', 'lug_height': 'grouser_height_m',
        'lug_count': 'grouser_count', 'drawbar_pull': 'meas_drawbar_pull_n',
        'sinkage': 'meas_sinkage_m', 'torque': 'meas_torque_nm',
    }  # fmt: skip
    rows: Rows = {key: [] for key in (*columns, *(f'{key}_std' for key in std))}
    with path.open(encoding='utf-8') as stream:
        for row in csv.DictReader(stream):
            if not row['case_id'].startswith(prefix):
                continue
            for key, name in columns.items():
                rows[key].append(float(row[name] or 'nan'))
            for key, size in std.items():
                # Read off a figure: a fixed part, and 5 % of the value.
                rows[f'{key}_std'].append(math.hypot(size, 0.05 * rows[key][-1]))
    # A torque listed as exactly 0 at slip 0 is a convention of the figure, not a reading.
    rows['torque'] = [math.nan if t == 0.0 else t for t in rows['torque']]
    return rows


# Reading errors of the published figures: +-0.5 mm, +-1 N, +-0.2 N m at best.
_READING = {'sinkage': 0.5e-3, 'drawbar_pull': 1.0, 'torque': 0.2}
# What the soil files assume without a source is free within wide bounds.
_ASSUMED = (
    'soil.peak_stress_ratio_std:=0.1',
    'soil.leaving_angle_ratio:=-0.2',
    'soil.leaving_angle_ratio_std:=0.15',
)


def _known_to(share: float, soil: str) -> list[str]:
    """Return overrides that state every number of a soil file to a share of its value."""
    values = reader.load([soil], complete=False).flat()
    names = ('frictional_modulus', 'sinkage_exponent', 'cohesion', 'shear_modulus')
    stated = [f'soil.{n}_std:={share * float(values[f"soil.{n}"])!r}' for n in names]  # type: ignore[arg-type]
    angle = float(values['soil.friction_angle_deg'])  # type: ignore[arg-type]
    return [*stated, f'soil.friction_angle_std_deg:={0.5 * share * angle!r}', *_ASSUMED]


def _hit(shared: Path, question: str, kind: str, paired: bool = False) -> Case:
    """HIT wheel, smooth or with 10 mm lugs, against the soil as measured, no effect on."""
    reference = _hit_rows(shared, 'smooth') if paired else None
    return Case(question, _hit_rows(shared, kind), _on_rim('hit_lss1', 0.3), reference)


def hit(shared: Path) -> Case:
    """HIT wheel with 10 mm lugs against the model fitted to its smooth twin."""
    return Case(
        'What do 10 mm lugs add to the smooth wheel of the same size, in the same sand?',
        _hit_rows(shared, 'lug10'),
        # The share of rim friction that lugs take away was fitted to this very wheel: put back.
        reader.load(
            ['hit_fit'],
            ['slip_radius:=rim', 'effects.rim_friction.ring_height:=0.03'],
            complete=False,
        ),
    )


def _hit_rows(shared: Path, kind: str) -> SteadyTable:
    title = {'smooth': 'HIT wheel, smooth', 'lug10': 'HIT wheel, 10 mm lugs'}[kind]
    return check_table(title, _published(shared, f'ding2011_{kind}', _READING))


def _on_rim(soil: str, share: float) -> Configuration:
    """Return the soil as measured, its numbers known to a share; slip is that of the rim."""
    return reader.load([soil], ['slip_radius:=rim', *_known_to(share, soil)], complete=False)


def kls1(shared: Path) -> Case:
    """KLS-1 wheel, smooth and with lugs: nearly constant torque excess."""
    return Case(
        'Why is the torque of the KLS-1 wheels so high?',
        check_table('KLS-1 wheels', _published(shared, 'kls1', _READING)),
        _on_rim('kls1_proxy', 0.4),
        notes=('moduli of the soil are proxies: all soil parameters stated to 40 %',),
    )


def _cmu_rows(shared: Path, least: float, most: float) -> SteadyTable:
    """Return the steady rows of the smooth wheel without side slip, between two slips."""
    folder = shared / 'measured' / 'cmu_single_wheel'
    names = ('slip', 'normal_load', 'sinkage', 'drawbar_pull')
    rows: Rows = {name: [] for name in (*names, 'sinkage_std', 'drawbar_pull_std')}
    with (folder / 'steady_state.csv').open(encoding='utf-8') as stream:
        for row in csv.DictReader(stream):
            if row['wheel'] != 'smooth' or abs(float(row['slip_angle_deg'])) > 5:
                continue
            slip = float(row['slip_ratio'])
            if not least <= slip <= most:
                continue
            rows['slip'].append(slip)
            rows['normal_load'].append(float(row['vertical_load_N']))
            rows['sinkage'].append(1e-3 * float(row['sinkage_mm']))
            rows['drawbar_pull'].append(float(row['drawbar_pull_N']))
            rows['sinkage_std'].append(1e-3)  # repeated tests scatter by about this much
            rows['drawbar_pull_std'].append(0.5)
    count = len(rows['slip'])
    rows['wheel_radius'], rows['wheel_width'] = [0.058] * count, [0.050] * count
    return check_table('CMU smooth wheel', rows)


def _cmu_plates(shared: Path, least: float) -> Case:
    """CMU smooth wheel from a slip on, against static Bekker from plates of the same rig."""
    from wheel_terra_lab.studies.model_validation.cmu_wheel import plates

    soil, scatter, _ = plates(shared / 'measured' / 'cmu_single_wheel' / 'pressure_sinkage.csv')
    settings = {
        'cohesive_modulus': soil.cohesive_modulus,
        'frictional_modulus': soil.frictional_modulus,
        'sinkage_exponent': soil.sinkage_exponent,
        'sinkage_exponent_std': 0.05,
        'cohesion': 50.0,
        'cohesion_std': 50.0,
        'friction_angle_deg': 30.0,
        'friction_angle_std_deg': 3.0,
        'shear_modulus': 0.008,
        'shear_modulus_std': 0.004,
        'peak_stress_ratio': 0.4,
        'peak_stress_ratio_std': 0.1,
        'leaving_angle_ratio': -0.2,
        'leaving_angle_ratio_std': 0.15,
    }
    return Case(
        'Is a static pressure-sinkage law, fitted to plates, enough for the wheel at high slip?',
        _cmu_rows(shared, least, 0.9),
        reader.load([], [f'soil.{k}:={float(v)!r}' for k, v in settings.items()], complete=False),
        notes=(f'plates fitted to {100 * scatter:.0f} % in pressure; no torque was measured',),
    )


def cmu_fitted(shared: Path) -> Case:
    """The same rows, driving and braking, against the shipped soil that was fitted to them."""
    return Case(
        'Does the shipped soil cmu_sand_fit agree with the rows that it was fitted to?',
        _cmu_rows(shared, -0.98, 0.95),
        reader.load(['cmu_sand_fit'], complete=False),
    )


def _drive(shared: Path, question: str, bag: str, rover: str, *notes: str) -> Case:
    """Rows of a recorded drive, its reference velocity the true one."""
    from wheel_terra_estimator.bags.reader import parse_remaps
    from wheel_terra_estimator.discrepancy.drives.windows import rows_from_bag

    path = shared / 'measured' / 'bags' / bag
    if not path.exists():
        raise FileNotFoundError(2, 'no such bag', str(path))
    configuration = reader.load([rover])
    rows = rows_from_bag(path, configuration, parse_remaps(['reference_odom:=/truth/odometry']))
    return Case(question, rows.table(), configuration, notes=(*notes, *rows.notes))


def grc3(shared: Path) -> Case:
    """Single wheel on GRC-3: pull that goes on rising to a slip of 0.8."""
    path = shared / 'reference' / 'measured_viper_slip_slope.csv'
    load = 17.5 * 9.80665
    rows: Rows = {'slip': [], 'normal_load': [], 'drawbar_pull': []}
    with path.open(encoding='utf-8') as stream:
        for row in csv.DictReader(stream):
            if row['series'] == 'TREC_single_wheel':
                rows['slip'].append(float(row['slip']))
                rows['normal_load'].append(load)
                rows['drawbar_pull'].append(load * float(row['equivalent_DP_over_W']))
    count = len(rows['slip'])
    # Not in the data: size of the wheel as commonly given.
    for key, value in (
        ('wheel_radius', 0.25), ('wheel_width', 0.2), ('lug_height', 0.025), ('lug_count', 24.0)
    ):  # fmt: skip
        rows[key] = [value] * count
    return Case(
        'Why does pull still rise at a slip of 0.8?',
        check_table('wheel on GRC-3', rows),
        reader.load(['grc3'], ['slip_radius:=rim', *_known_to(0.2, 'grc3')], complete=False),
        notes=('pull only; size of the wheel is not in the data; noise not stated',),
    )


def _soilbin(_: Path, title: str, *tables: str) -> Case:
    """Return the rows of sweeps of the discrete elements against the model of their wheel."""
    folder = Path(__file__).resolve().parents[2] / 'docs' / 'laboratory' / 'soilbin'
    rows: Rows = {}
    for table in tables:
        with (folder / table).open(encoding='utf-8') as stream:
            for row in csv.DictReader(stream):
                # The rearmost contact of the grains is no end of the stress: no leaving angle.
                for name in set(row) - {'leaving_angle'}:
                    rows.setdefault(name, []).append(float(row[name] or 'nan'))
    return Case(
        'What does the closed form lack against discrete elements of wheel 2?',
        check_table(title, rows),
        reader.load(['nakashima_wheel_2', 'fjs1_kanamori'], complete=False),
        notes=('the soil of the model is the simulant, the grains are another soil: see `refit`',),
    )


_STATIC = 'HIT wheel against the soil as measured, no effect switched on'
_PAIRED = 'The same, from the soil as measured, the smooth wheel being the reference table.'
_SNOW = ('What does the model lack in deep snow?', 'torque is not calibrated, the soil is assumed')
_ROLLING = 'Why does a rover that rolls freely seem to skid by 5 %?'  # its radius is 6 % too small
# Name -> the rows with their model, of the folder of measured data. The soil bin: free travel under
# a pull raised in steps, travel speed imposed, and slopes of 5 to 25 degrees beside the pulls.
CASES: dict[str, Callable[[Path], Case]] = {
    'hit': hit,
    'hit_paired': lambda shared: _hit(shared, _PAIRED, 'lug10', paired=True),
    'hit_static': lambda shared: _hit(shared, f'Lugged {_STATIC}.', 'lug10'),
    'hit_smooth': lambda shared: _hit(shared, f'Smooth {_STATIC}.', 'smooth'),
    'kls1': kls1,
    'cmu': lambda shared: _cmu_plates(shared, 0.0),
    'cmu_braking': lambda shared: _cmu_plates(shared, -0.98),  # the locked wheel aside
    'cmu_fitted': cmu_fitted,
    'pathfinder': lambda s: _drive(s, _ROLLING, 'wvu_pathfinder_test17_mcap', 'pathfinder'),
    'frostyboy_4': lambda s: _drive(s, _SNOW[0], 'frostyboy_event_1_4_mcap', 'frostyboy', _SNOW[1]),
    'frostyboy_6': lambda s: _drive(s, _SNOW[0], 'frostyboy_event_1_6_mcap', 'frostyboy', _SNOW[1]),
    'grc3': grc3,
    'soilbin_pull': lambda s: _soilbin(s, 'soil bin, pull sweep', 'pull_sweep.csv'),
    'soilbin_slip': lambda s: _soilbin(s, 'soil bin, slip sweep', 'slip_sweep.csv'),
    'soilbin_slope': lambda s: _soilbin(
        s, 'soil bin, pull and slopes', 'pull_sweep.csv', 'slope_sweep.csv'
    ),
}


def summary(name: str, case: Case, diagnosis: Diagnosis) -> str:
    """Return the verdict as Markdown."""
    lines = [f'## {name}', '', case.question, '', f'**{diagnosis.verdict}**: {diagnosis.sentence}']
    lines += [
        '',
        '| | as configured | soil refitted | in the end | noise |',
        '|---|---|---|---|---|',
    ]
    for quantity, gap in diagnosis.gap.items():
        lines.append(
            f'| {quantity} | {gap.before:.3g} | {gap.refit:.3g} | {gap.after:.3g} '
            f'| {gap.noise:.2g} |'
        )
    best = [
        f'{c.name} {c.log_evidence:+.1f}' for c in diagnosis.candidates[:6] if c.why_not or c.names
    ]
    lines += ['', f'ln evidence: {", ".join(best)}. {diagnosis.where.sentence}.']
    pulls = [f'{s.name} {s.z_score:+.1f}' for s in diagnosis.soil if abs(s.z_score) > 3.0]
    if pulls:
        lines.append(f'Soil pulled by more than 3 stated deviations: {", ".join(pulls)}.')
    if diagnosis.next_measurement:
        lines.append(f'Next: {diagnosis.next_measurement[0].what}.')
    lines += [f'({note})' for note in case.notes]
    return '\n'.join(lines) + '\n'


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    default = Path(__file__).resolve().parents[3] / 'shared'
    parser.add_argument('-o', '--output', type=Path, required=True)
    parser.add_argument('--shared', type=Path, default=default, help='folder of measured data')
    parser.add_argument('--only', nargs='*', default=list(CASES), choices=list(CASES))
    parser.add_argument('--no-pictures', action='store_true', help='no report.html')
    arguments = parser.parse_args()
    parts: list[str] = []
    for name in arguments.only:
        try:
            case = CASES[name](arguments.shared)
        except FileNotFoundError as missing:
            parts.append(f'## {name}\n\nskipped: {missing.filename} is not here\n')
        except UserError as error:
            parts.append(f'## {name}\n\nno verdict: {error}\n')
        else:
            diagnosis = diagnose(case.table, case.configuration, case.reference)
            folder = arguments.output / name
            folder.mkdir(parents=True, exist_ok=True)
            write_files(diagnosis, folder, pictures=not arguments.no_pictures)
            parts.append(summary(name, case, diagnosis))
        print(parts[-1], flush=True)
    arguments.output.mkdir(parents=True, exist_ok=True)
    (arguments.output / 'summary.md').write_text('\n'.join(parts), encoding='utf-8')


if __name__ == '__main__':
    main()
