# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The discrepancy workflow on measurements of other people: one command, a report per case.

    python -m wheel_terra_lab.studies.discrepancy_demonstrations -o demonstrations \
        [--only hit kls1 ...]
    python -m wheel_terra_lab.studies.discrepancy_demonstrations -o demonstrations --no-pictures \
        --page cases.md
    python -m wheel_terra_lab.studies.discrepancy_demonstrations -o demonstrations --only \
        --table bin=bed.csv --config bin=bed.yaml

Measured data are looked for in ``../shared`` (``--shared`` says where else); a case whose data are
not there is skipped, visibly. ``--table NAME=FILE`` adds a table of one's own, such as other rows
of the virtual soil bin, with ``--config NAME=FILE`` and ``--reference NAME=FILE`` for its model and
for a table without the effect. Each case writes ``report.json``, ``report.html``, ``model.yaml``
and pictures into a folder of its name; the verdicts are listed on the terminal and in
``summary.md``; ``--page`` writes the table of all cases, each with its gap and whether it was
halved or why not. What they mean is discussed in ``docs/discrepancy/demonstrations.md``.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.discrepancy.report.model_file import write_files
from wheel_terra_estimator.discrepancy.result import Diagnosis
from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.tables.parsing import read_table
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, UNITS, SteadyTable
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


def hit(shared: Path) -> Case:
    """HIT wheel with 10 mm lugs against the model fitted to its smooth twin."""
    return Case(
        'What do 10 mm lugs add to the smooth wheel of the same size, in the same sand?',
        _lugs(shared),
        # The share of rim friction that lugs take away was fitted to this very wheel: put back.
        reader.load(
            ['hit_fit'],
            ['slip_radius:=rim', 'effects.rim_friction.ring_height:=0.03'],
            complete=False,
        ),
    )


def _lugs(shared: Path) -> SteadyTable:
    return check_table('HIT wheel, 10 mm lugs', _published(shared, 'ding2011_lug10', _READING))


def _smooth(shared: Path) -> SteadyTable:
    return check_table('HIT wheel, smooth', _published(shared, 'ding2011_smooth', _READING))


def _on_rim(soil: str, share: float) -> Configuration:
    """Return the soil as measured, its numbers known to a share; slip is that of the rim."""
    return reader.load([soil], ['slip_radius:=rim', *_known_to(share, soil)], complete=False)


def hit_smooth(shared: Path) -> Case:
    """HIT smooth wheel against the measured soil, no effect on."""
    question = 'Smooth HIT wheel against the soil as measured, no effect switched on.'
    return Case(question, _smooth(shared), _on_rim('hit_lss1', 0.3))


def hit_paired(shared: Path) -> Case:
    """The same question with the smooth rows as the table in which the effect is absent."""
    question = 'The same, from the soil as measured, the smooth wheel being the reference table.'
    return Case(question, _lugs(shared), _on_rim('hit_lss1', 0.3), _smooth(shared))


def hit_static(shared: Path) -> Case:
    """HIT lugged wheel alone against the measured soil, no effect on."""
    question = 'Lugged HIT wheel against the soil as measured, no effect switched on.'
    return Case(question, _lugs(shared), _on_rim('hit_lss1', 0.3))


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
    """Return the rows against static Bekker from plates of the same rig."""
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


def cmu(shared: Path) -> Case:
    """CMU smooth wheel, driving."""
    return _cmu_plates(shared, 0.0)


def cmu_braking(shared: Path) -> Case:
    """The same with its braking rows, the locked wheel aside."""
    return _cmu_plates(shared, -0.98)


def cmu_fitted(shared: Path) -> Case:
    """The same rows, driving and braking, against the shipped soil that was fitted to them."""
    return Case(
        'Does the shipped soil cmu_sand_fit agree with the rows that it was fitted to?',
        _cmu_rows(shared, -0.98, 0.95),
        reader.load(['cmu_sand_fit'], complete=False),
    )


def _frostyboy(shared: Path, event: str) -> Case:
    """FrostyBoy in deep snow, up to its immobilisation."""
    from wheel_terra_estimator.bags.reader import parse_remaps
    from wheel_terra_estimator.discrepancy.drives.windows import rows_from_bag

    bag = shared / 'measured' / 'bags' / f'frostyboy_event_{event}_mcap'
    if not bag.exists():
        raise FileNotFoundError(2, 'no such bag', str(bag))
    configuration = reader.load(['frostyboy'])
    rows = rows_from_bag(bag, configuration, parse_remaps(['reference_odom:=/truth/odometry']))
    return Case(
        'What does the model lack in deep snow?',
        rows.table(),
        configuration,
        notes=('torque is not calibrated, the soil is assumed', *rows.notes),
    )


def frostyboy_4(shared: Path) -> Case:
    """Event 1-4."""
    return _frostyboy(shared, '1_4')


def frostyboy_6(shared: Path) -> Case:
    """Event 1-6."""
    return _frostyboy(shared, '1_6')


def pathfinder(shared: Path) -> Case:
    """Pathfinder rover on firm ground: the stated radius is 6 % too small."""
    from wheel_terra_estimator.bags.reader import parse_remaps
    from wheel_terra_estimator.discrepancy.drives.windows import rows_from_bag

    bag = shared / 'measured' / 'bags' / 'wvu_pathfinder_test17_mcap'
    configuration = reader.load(['pathfinder'])
    rows = rows_from_bag(bag, configuration, parse_remaps(['reference_odom:=/truth/odometry']))
    return Case(
        'Why does a rover that rolls freely seem to skid by 5 %?',
        rows.table(),
        configuration,
        notes=rows.notes,
    )


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


def _soilbin(title: str, *tables: str) -> Case:
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


def soilbin_pull(_: Path) -> Case:
    """Virtual soil bin, free travel, pull raised in steps."""
    return _soilbin('soil bin, pull sweep', 'pull_sweep.csv')


def soilbin_slip(_: Path) -> Case:
    """Virtual soil bin, travel speed imposed."""
    return _soilbin('soil bin, slip sweep', 'slip_sweep.csv')


def soilbin_slope(_: Path) -> Case:
    """Virtual soil bin, free travel: pull raised in steps, and slopes of 5 to 25 degrees."""
    return _soilbin('soil bin, pull and slopes', 'pull_sweep.csv', 'slope_sweep.csv')


CASES: dict[str, Callable[[Path], Case]] = {
    'hit': hit,
    'hit_paired': hit_paired,
    'hit_static': hit_static,
    'hit_smooth': hit_smooth,
    'kls1': kls1,
    'cmu': cmu,
    'cmu_braking': cmu_braking,
    'cmu_fitted': cmu_fitted,
    'pathfinder': pathfinder,
    'frostyboy_4': frostyboy_4,
    'frostyboy_6': frostyboy_6,
    'grc3': grc3,
    'soilbin_pull': soilbin_pull,
    'soilbin_slip': soilbin_slip,
    'soilbin_slope': soilbin_slope,
}


def from_table(name: str, arguments: argparse.Namespace) -> Case:
    """Return the case of a table of one's own (``--table``, ``--config``, ``--reference``)."""
    tables, configs, references = (
        dict(text.partition('=')[::2] for text in texts)
        for texts in (arguments.table, arguments.config, arguments.reference)
    )
    return Case(
        f'Table {tables[name]}.',
        read_table(tables[name]),
        reader.load([configs[name]] if name in configs else [], complete=False),
        read_table(references[name]) if name in references else None,
    )


def write(folder: Path, diagnosis: Diagnosis, *, pictures: bool) -> None:
    """Write what the command ``wheel-terra diagnose`` writes."""
    folder.mkdir(parents=True, exist_ok=True)
    write_files(diagnosis, folder, pictures=pictures)


def summary(name: str, case: Case, diagnosis: Diagnosis) -> str:
    """Return the verdict as Markdown."""
    lines = [f'## {name}', '', case.question, '', f'**{diagnosis.verdict}**: {diagnosis.sentence}']
    lines += [
        '',
        '| | as configured | soil refitted | in the end | noise |',
        '|---|---|---|---|---|',
    ]
    for quantity, gap in diagnosis.gap.items():
        noise = '-' if gap.noise is None else f'{gap.noise:.2g}'
        lines.append(
            f'| {quantity} | {gap.before:.3g} | {gap.refit:.3g} | {gap.after:.3g} | {noise} |'
        )
    best = [
        f'{c.label} {c.log_evidence:+.1f}' for c in diagnosis.candidates[:6] if c.why_not or c.names
    ]
    lines += ['', f'ln evidence: {", ".join(best)}. {diagnosis.where.sentence}.']
    pulls = [f'{s.name} {s.z_score:+.1f}' for s in diagnosis.soil if abs(s.z_score) > 3.0]
    if pulls:
        lines.append(f'Soil pulled by more than 3 stated deviations: {", ".join(pulls)}.')
    if diagnosis.next_measurement:
        lines.append(f'Next: {diagnosis.next_measurement[0].what}.')
    lines += [f'({note})' for note in case.notes]
    return '\n'.join(lines) + '\n'


def gap_row(name: str, diagnosis: Diagnosis) -> str:
    """Return a row of the table of gaps: as configured, soil refitted, in the end (noise)."""
    cells = []
    for quantity in QUANTITIES:
        gap, scale = diagnosis.gap.get(quantity), 1e3 if UNITS[quantity] == 'm' else 1.0
        if gap is None:
            cells.append('-')
            continue
        values = [f'{scale * value:.3g}' for value in (gap.before, gap.refit, gap.after)]
        noise = '' if gap.noise is None else f' ({scale * gap.noise:.2g})'
        cells.append(' → '.join(values) + noise)
    return f'| {name} | {diagnosis.verdict} | {" | ".join(cells)} |'


_GAP_HEAD = """## Gap before and after

Root-mean-square error on rows that the fit did not see: as configured → soil refitted → in the end
(noise).

| case | verdict | sinkage [mm] | pull [N] | torque [N m] |
|---|---|---|---|---|
"""


_PAGE_HEAD = """# Every real case: was the gap halved?

Written by `python -m wheel_terra_lab.studies.discrepancy_demonstrations -o demonstrations
--no-pictures --page cases.md`; do not edit.
What the cases mean: [demonstrations](demonstrations.md).

Root-mean-square error on rows that the fit did not see. *In the end* is the named effect, or the
proposed law where nothing is named. The gap is the error beyond the noise, sqrt(error² - noise²);
the last column but one is what is left of the gap of the model as configured, and of the refitted
soil. A case is halved where the gaps of its quantities, each over its noise, together (root of the
sum of squares) are at most half of those as configured.

| case | verdict | quantity | configured | refitted | end | noise | left of | halved |
|---|---|---|---|---|---|---|---|---|
"""
_HALF = 0.5
# Why a case keeps more than half of its gap, in one sentence each.
REASONS: dict[str, str] = {
    'hit': 'six rows of one load and lug height hold what lugs add at one to two noise deviations, '
    'and seven soil numbers fit it nearly as well as any effect',
    'hit_paired': 'twelve rows of one load; a structural error of 25 % of the range, as both '
    'tables show it, lies over the six that have the effect',
    'cmu_fitted': 'the model as configured is the fit itself, and agrees; its 1.4 mm and '
    '0.8 N are what that law leaves of rows whose repeats lie within 1 mm and 0.3 N, and slips '
    'left out are not predicted better by another soil',
    'grc3': 'pull alone; the mound that is nearest is too doubtful to be named',
    'soilbin_slope': 'on slips left out the law leaves 10.8 mm, where a soil refit alone goes to '
    '50 mm',
    'frostyboy_4': 'no window of 4 s at a constant wheel rate without a turn; the rover digs in at '
    'once',
}


def case_rows(name: str, diagnosis: Diagnosis) -> str:
    """Return the rows of a case: each quantity with its gaps, and whether they were halved."""
    proposal = diagnosis.proposal
    said = ' + '.join(effect.name for effect in diagnosis.effects) or diagnosis.verdict
    gaps = diagnosis.gap if proposal is None else proposal.gap
    rows, before_all, after_all = [], 0.0, 0.0
    for quantity, gap in gaps.items():
        scale, unit = (1e3, 'mm') if UNITS[quantity] == 'm' else (1.0, UNITS[quantity])
        noise = gap.noise or 1e-12
        before, refit, after = (
            math.sqrt(max((value / noise) ** 2 - 1.0, 0.0))
            for value in (gap.before, gap.refit, gap.after)
        )
        before_all, after_all = before_all + before**2, after_all + after**2
        # A gap below half of the noise is none.
        left = ', '.join(
            '-' if of <= _HALF else f'{100 * after / of:.0f} %' for of in (before, refit)
        )
        values = [f'{scale * v:.3g}' for v in (gap.before, gap.refit, gap.after, noise)]
        rows.append([f'{quantity.replace("_", " ")} [{unit}]', *values, left])
    halved = after_all <= max(_HALF**2 * before_all, _HALF**2)
    said = f'{said}, law proposed' if proposal else said
    verdict = 'yes' if halved else f'no: {REASONS.get(name, "no reason stated")}'
    lines = []
    for k, row in enumerate(rows):
        head = [name, said] if k == 0 else ['', '']
        lines.append(f'| {" | ".join([*head, *row, verdict if k == 0 else ""])} |')
    return '\n'.join(lines)


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    default = Path(__file__).resolve().parents[3] / 'shared'
    parser.add_argument('-o', '--output', type=Path, required=True)
    parser.add_argument('--shared', type=Path, default=default, help='folder of measured data')
    parser.add_argument('--only', nargs='*', default=list(CASES), choices=list(CASES))
    parser.add_argument('--table', action='append', default=[], metavar='NAME=FILE')
    parser.add_argument('--config', action='append', default=[], metavar='NAME=FILE')
    parser.add_argument('--reference', action='append', default=[], metavar='NAME=FILE')
    parser.add_argument('--no-pictures', action='store_true', help='no report.html')
    parser.add_argument('--page', type=Path, help='Markdown page of all cases, to be written')
    arguments = parser.parse_args()
    cases: dict[str, Callable[[], Case]] = {
        name: lambda name=name: CASES[name](arguments.shared)  # type: ignore[misc]
        for name in arguments.only
    }
    for text in arguments.table:
        name = text.partition('=')[0]
        cases[name] = lambda name=name: from_table(name, arguments)  # type: ignore[misc]
    parts: list[str] = []
    gaps: list[str] = []
    judged: list[str] = []
    for name, make in cases.items():
        try:
            case: Any = make()
        except FileNotFoundError as missing:
            parts.append(f'## {name}\n\nskipped: {missing.filename} is not here\n')
        except UserError as error:
            parts.append(f'## {name}\n\nno verdict: {error}\n')
            why = REASONS.get(name, 'no reason stated')
            judged.append(f'| {name} | no verdict | | | | | | | no: {why} |')
        else:
            diagnosis = diagnose(case.table, case.configuration, case.reference)
            write(arguments.output / name, diagnosis, pictures=not arguments.no_pictures)
            judged.append(case_rows(name, diagnosis))
            parts.append(summary(name, case, diagnosis))
            gaps.append(gap_row(name, diagnosis))
        print(parts[-1], flush=True)
    parts.append(_GAP_HEAD + '\n'.join(gaps) + '\n')
    print(parts[-1])
    arguments.output.mkdir(parents=True, exist_ok=True)
    (arguments.output / 'summary.md').write_text('\n'.join(parts), encoding='utf-8')
    if arguments.page:
        arguments.page.write_text(_PAGE_HEAD + '\n'.join(judged) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
