# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The paper's four stages: consolidation, turning, free sinkage, travel. Engine process only."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

from wheel_terra_lab.soilbin import geometry, snapshots
from wheel_terra_lab.soilbin.bookkeeping import SERIES, STATE, sums
from wheel_terra_lab.soilbin.case import Case
from wheel_terra_lab.soilbin.engine import BinEngine

Report = Callable[[str, float], None]
CHUNK = 400  # steps between two looks at the interrupt flag


class InterruptedRunError(Exception):
    """The user wants to stop; the state has been saved."""


class NotSettledError(Exception):
    """The bed does not come to rest."""


class Run:
    """One case from the grains' first fall to the end of the travel."""

    def __init__(
        self,
        case: Case,
        folder: Path,
        cache: Path | None,
        report: Report,
        stop_asked: Callable[[], bool],
        checkpoint_every: float,
        clock: Callable[[], float],
    ):
        self.case = case
        self.folder = folder
        self.cache = cache
        self.report = report
        self.stop_asked = stop_asked
        self.checkpoint_every = checkpoint_every
        self.clock = clock
        self.engine = BinEngine(case)
        self.facts: dict[str, float] = {'time_step': self.engine.time_step}

    def steps(self, duration: float) -> int:
        """Return the number of steps of a duration [s]."""
        return max(1, round(duration / self.engine.time_step))

    def advance(self, stage: str, total: int, look: Callable[[], None] | None = None) -> None:
        """Run the steps of an untravelled stage in chunks; `look` may raise after each."""
        done = 0
        while done < total:
            chunk = min(CHUNK, total - done)
            self.engine.run(chunk)
            done += chunk
            self.report(stage, done / total)
            if look:
                look()
            if self.stop_asked():
                raise InterruptedRunError

    # -- bed ------------------------------------------------------------------------------------

    def prepare_bed(self) -> None:
        """Stages (i) and (ii): settle, turn; both are kept for other runs."""
        settled = snapshots.path(self.cache, self.case, 'settled')
        turned = snapshots.path(self.cache, self.case, 'turned')
        if not self._load_kept(turned):
            if not self._load_kept(settled):
                self.consolidate()
                snapshots.store(settled, self.engine.save)
            self.turn()
            snapshots.store(turned, self.engine.save)
        self.engine.tilt(self.case.operation.slope, self.case.operation.slope, 1)

    def _load_kept(self, bed: Path | None) -> bool:
        """Load a kept bed; one that the engine cannot read is removed and made again."""
        if bed is None or not bed.exists():
            return False
        try:
            self.engine.load_bed(bed)
        except Exception:  # the engine knows no other kind
            bed.unlink(missing_ok=True)
            self.engine.close()
            self.engine = BinEngine(self.case)
            return False
        return True

    def consolidate(self) -> None:
        """Stage (i): the grains settle under their own weight in the level bin."""
        bed = self.case.bed
        self.engine.build_bed(self.folder)
        duration = bed.settling_time * self._slowness()
        if bed.preparation_friction >= 0:
            self.engine.set_contacts(bed.preparation_friction)
            self.advance('consolidation', self.steps(duration))
            self.engine.set_contacts()
        for _ in range(3):
            self.advance('consolidation', self.steps(duration))
            if self.engine.rms_speed() <= bed.settled_speed:
                return
        raise NotSettledError(
            f'the level bed still moves at {1000 * self.engine.rms_speed():.1f} mm/s (rms) after '
            f'{3 * duration:.1f} s: raise soilbin.bed.settling_time, '
            'soilbin.bed.settled_speed or soilbin.grains.damping_ratio'
        )

    def _slowness(self) -> float:
        """Falls take longer where gravity is weak (the paper: six times longer in 1/6 g)."""
        return math.sqrt(9.80665 / self.case.operation.gravity)

    def turn(self) -> None:
        """Stage (ii): the bin turns to the slope (gravity does)."""
        operation = self.case.operation
        if operation.slope == 0:
            return
        steps = self.steps(operation.turning_time * self._slowness())
        self.engine.tilt(0.0, operation.slope, steps)
        self.advance('turning', steps)
        self.engine.tilt(operation.slope, operation.slope, 1)
        self.advance('turning', self.steps(0.5 * self._slowness()))
        speed = self.engine.rms_speed()
        if speed > self.case.bed.settled_speed:
            raise NotSettledError(
                f'the bed itself slides on a slope of {math.degrees(operation.slope):g} deg: '
                f'{1000 * speed:.1f} mm/s (rms) with no wheel on it. These grains are too weak '
                'for this slope: raise soilbin.grains.rolling_friction, or flatten the slope'
            )

    # -- wheel ----------------------------------------------------------------------------------

    def sink(self) -> None:
        """Stage (iii): the locked wheel sinks freely while its load grows.

        A standing wheel carries its weight's share along the slope as well, as a braked rover's
        does, and slides until the soil holds it. The paper does not say which of the two it did.
        """
        operation, wheel, engine = self.case.operation, self.case.wheel, self.engine
        _, centres, radii, _ = engine.grains()
        self.facts['surface'] = geometry.surface_height(
            centres, radii, operation.start - 0.1, operation.start + 0.3
        )
        area = float(np.sum(math.pi * radii**2))
        self.facts['solid_fraction'] = area / (self.case.bed.length * self.facts['surface'])
        random = np.random.default_rng([self.case.bed.seed, 7])
        phase = -math.pi / 2
        if wheel.lug_count:
            phase += random.uniform(0, 2 * math.pi / wheel.lug_count)
        lugs = geometry.lug_discs(wheel, phase)
        height = geometry.touching_height(operation.start, wheel.rim_radius, lugs, centres, radii)
        height += 1e-5 + operation.drop_height
        engine.place_wheel((operation.start, height), phase)
        standing = operation.free_sinkage == 'standing' and operation.slope > 0
        engine.hold_wheel(self.folder / 'wheel.body', free=(standing, True))
        load = operation.vertical_load * math.cos(operation.slope)
        along = operation.vertical_load * math.sin(operation.slope) if standing else 0.0
        steps = self.steps(operation.loading_time)
        ramp = f'((step-{engine.step})/{steps})'
        engine.load_wheel(f'-{along}*{ramp}', f'-{load}*{ramp}')
        self.advance('free sinkage', steps, self._look_for_trouble)
        engine.load_wheel(f'-{along}', f'-{load}')
        self.advance('free sinkage', self.steps(operation.resting_time), self._look_for_trouble)

    def _look_for_trouble(self) -> None:
        trouble = self._trouble()
        if trouble:
            raise NotSettledError(f'before it turned, {trouble}')

    def travel(self, resumed: dict | None, series: list[list[float]]) -> str:
        """Stage (iv): the wheel turns at a constant rate; return why it stopped early, or ''."""
        case, engine = self.case, self.engine
        operation = case.operation
        total = self.steps(case.travel_time)
        every = max(1, total // case.numerics.samples)
        frame_every = max(1, case.numerics.samples // max(1, case.numerics.frames))
        imposed = not math.isnan(operation.imposed_slip)
        if resumed is None:
            first = engine.step
            x, y = engine.axle()
            self.facts |= {'first_step': first, 'start_x': x, 'start_y': y}
            speed = 0.0
            if imposed:
                speed = (1 - operation.imposed_slip) * case.rim_rate * case.wheel.tip_radius
            engine.hold_wheel(self.folder / 'wheel.body', (not imposed, True), speed, case.rim_rate)
        else:
            self.facts |= resumed['facts']
            first = int(self.facts['first_step'])
        weight = operation.vertical_load
        along = weight * math.sin(operation.slope) + operation.hitch_pull
        borne = weight * math.sin(operation.slope) * (operation.free_sinkage == 'standing')
        added = along - borne  # what the soil did not carry yet while the wheel stood
        ramp_time = operation.pull_ramp / (operation.speed_factor * operation.tip_speed)
        ramp = self.steps(ramp_time)
        engine.load_wheel(
            f'-{along}+{added}*((step-{first})<{ramp})*(1-(step-{first})/{ramp})',
            f'-{weight * math.cos(operation.slope)}',
        )
        saved = self.clock()
        while engine.step - first < total:
            engine.run(every)
            done = engine.step - first
            series.append(self._sample(done * engine.time_step))
            if len(series) % frame_every == 0:
                self._frame(len(series), done * engine.time_step)
            self.report('travel', min(1.0, done / total))
            trouble = self._trouble()
            if trouble:
                return trouble
            asked = self.stop_asked()
            if asked or self.clock() - saved > self.checkpoint_every:
                self.checkpoint(series)
                saved = self.clock()
            if asked:
                raise InterruptedRunError
        return ''

    def _sample(self, time: float) -> list[float]:
        x, y = self.engine.axle()
        values = sums(self.engine.contacts())
        values |= {'time': time, 'position': x, 'height': y}
        values['body_torque'] = self.engine.body_torque()
        return [values[name] for name in SERIES]

    def _frame(self, number: int, time: float) -> None:
        _, centres, radii, velocity = self.engine.grains()
        x, y = self.engine.axle()
        frames = self.folder / 'frames'
        frames.mkdir(exist_ok=True)
        np.savez_compressed(
            frames / f'{number:06d}.npz',
            centres=centres.astype(np.float32),
            velocity=velocity.astype(np.float32),
            radii=radii.astype(np.float32),
            axle=np.array([x, y]),
            lugs=self.engine.lug_positions().astype(np.float32),
            time=time,
        )

    def _trouble(self) -> str:
        """Say why the wheel cannot go on, or ''."""
        x, y = self.engine.axle()
        reach, length = self.case.wheel.tip_radius, self.case.bed.length
        if x + reach > length:
            return 'the wheel reached the high end wall: use a longer soilbin.bed.length'
        if x - reach < 0:
            return 'the wheel slid down to the low end wall: raise soilbin.operation.start'
        if y - reach < 0.5 * float(self.case.grain_diameters.min()):
            return 'the wheel dug down to the floor of the bin: use more soilbin.bed.rows'
        return ''

    # -- checkpoints ----------------------------------------------------------------------------

    def checkpoint(self, series: list[list[float]]) -> None:
        """Keep the state so that a later run goes on from here; the old one goes last."""
        new, old = self.folder / 'checkpoint.new', self.folder / 'checkpoint'
        shutil.rmtree(new, ignore_errors=True)
        new.mkdir()
        self.engine.save(new / 'state')
        if not (new / 'state').exists() or not (new / 'state.rigid').exists():
            raise OSError(
                f'the checkpoint in {self.folder} could not be written: is the disk full?'
            )
        np.save(new / 'series.npy', np.asarray(series))
        (new / STATE).write_text(json.dumps({'facts': self.facts}))
        shutil.rmtree(old, ignore_errors=True)
        new.replace(old)

    def restart(self) -> tuple[dict, list[list[float]]] | None:
        """Load the checkpoint, if there is a whole one."""
        for name in ('checkpoint', 'checkpoint.new'):
            kept = self.folder / name
            if (kept / STATE).exists():
                self.engine.load_bed(kept / 'state')
                self.engine.tilt(self.case.operation.slope, self.case.operation.slope, 1)
                self.engine.resume_wheel(kept / 'state.rigid', self.case)
                resumed = json.loads((kept / STATE).read_text())
                return resumed, np.load(kept / 'series.npy').tolist()
        return None
