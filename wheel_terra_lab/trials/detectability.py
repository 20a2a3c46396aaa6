# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""d': how far, in noise standard deviations, an effect stands beyond the best soil refit.

The soil is refitted under its stated uncertainty (Gaussian, `SOIL_SD`, centred on the true soil),
without noise; d' is the length of the whitened residual that this refit leaves. All with the
quadrature of `truth`, none of it with the code under test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from wheel_terra_lab.trials.hidden import LISTED, Kind
from wheel_terra_lab.trials.truth import (
    OUTPUTS,
    SOIL_SD,
    FloatArray,
    Hidden,
    Rows,
    TrueSoil,
    moved_soil,
    solve,
)

_STEP = 0.2


class Ruler:
    """Measures d' for one set of rows, soil and noise."""

    def __init__(self, rows: Rows, soil: TrueSoil, std: Rows):
        self.rows, self.soil = rows, soil
        self._std = np.stack([std[key] for key in OUTPUTS], 1)  # nan = not measured
        zero = np.zeros(len(SOIL_SD))
        self.base = self.whitened(zero, ())
        columns = []
        for i in range(len(SOIL_SD)):
            u = zero.copy()
            u[i] = _STEP
            columns.append((self.whitened(u, ()) - self.base) / _STEP)
        self._jacobian = np.stack(columns, 1)

    def whitened(self, units: FloatArray, hidden: tuple[Hidden, ...]) -> FloatArray:
        """Outputs over noise, one vector; cells that were not measured are left out."""
        out = solve(self.rows, moved_soil(self.soil, units), hidden)
        y = np.stack([out[key] for key in OUTPUTS], 1) / self._std
        return y[np.isfinite(self._std)]

    def distance(self, hidden: tuple[Hidden, ...], competitors: tuple[Kind, ...] = ()) -> float:
        """Distance of ``hidden`` beyond the best refit of soil and of each competitor's size."""
        target = self.whitened(np.zeros(len(SOIL_SD)), hidden)
        if not np.all(np.isfinite(target)):
            return float('nan')
        if not competitors:
            return float(np.linalg.norm(self._refit(target, None, 0.5)))
        return min(
            float(np.linalg.norm(self._refit(target, competitor, secondary)))
            for competitor in competitors
            for secondary in (
                (0.1, 0.5, 0.9) if competitor.largest in (20,) or competitor.needs == () else (0.5,)
            )
        )

    def distance_of(self, outputs: Rows) -> float:
        """Distance of given outputs beyond the best refit of the soil."""
        y = np.stack([outputs[key] for key in OUTPUTS], 1) / self._std
        return float(np.linalg.norm(self._refit(y[np.isfinite(self._std)], None, 0.5)))

    def _refit(self, target: FloatArray, competitor: Kind | None, secondary: float) -> FloatArray:
        """Damped Gauss-Newton over soil units and a competitor's size; returns the residual."""
        n = len(SOIL_SD)
        x = np.zeros(n + (competitor is not None))
        typical = competitor.typical(self.rows, self.soil) if competitor else 0.0

        def model(x: FloatArray) -> FloatArray:
            if competitor is None:
                return self.whitened(x, ())
            effect = competitor.make(float(x[n]) * typical, secondary, self.rows, self.soil)
            return self.whitened(x[:n], (effect,))

        def cost(r: FloatArray, x: FloatArray) -> float:
            return float(r @ r + x[:n] @ x[:n]) if np.all(np.isfinite(r)) else np.inf

        prior = np.zeros((n, x.size))
        prior[:, :n] = np.eye(n)
        residual = target - model(x)
        best = cost(residual, x)
        for _ in range(6 if competitor else 4):
            jacobian = self._jacobian
            if competitor is not None:
                probe = x.copy()
                probe[n] += 0.05
                column = (model(probe) - (target - residual)) / 0.05
                jacobian = np.column_stack([jacobian, np.nan_to_num(column)])
            step = np.linalg.lstsq(
                np.vstack([jacobian, prior]), np.concatenate([residual, -x[:n]]), rcond=None
            )[0]
            gain = 0.0
            for damping in (1.0, 0.4, 0.15):
                trial = x + damping * step
                trial[:n] = np.clip(trial[:n], -4, 4)
                if competitor is not None:
                    low = -competitor.largest if competitor.signed else 0.0
                    trial[n] = np.clip(trial[n], low, competitor.largest)
                new = target - model(trial)
                if (value := cost(new, trial)) < best:
                    gain, x, residual, best = best - value, trial, new, value
                    break
            if gain < 0.01 * max(best, 1.0):
                break
        return residual


_LUGS: Mapping[str, Callable[[FloatArray], bool]] = {
    'lug_height': lambda height: bool(np.any(height > 0.0)),
    'tall_lugs': lambda height: len(np.unique(height[height > _TALL])) > 1,
    'bare_rim': lambda height: bool(np.any(height == 0.0)),
}
_TALL = 0.006  # [m]


def listed_kinds(rows: Rows, kinds: Mapping[str, Kind] = LISTED) -> dict[str, Kind]:
    """Return the effects that these rows could show at all."""

    def visible(kind: Kind) -> bool:
        return all(
            _LUGS[column](rows['lug_height']) if column in _LUGS else np.ptp(rows[column]) > 0
            for column in kind.needs
        )

    return {name: kind for name, kind in kinds.items() if visible(kind)}


def size_for(
    kind: Kind, wanted: float, secondary: float, sign: float, ruler: Ruler
) -> tuple[float, Hidden, float]:
    """Return size, effect and d', with d' near ``wanted`` as far as the largest size allows."""
    typical = kind.typical(ruler.rows, ruler.soil) * sign
    factor = 1.0
    result = None
    for _ in range(4):
        effect = kind.make(factor * typical, secondary, ruler.rows, ruler.soil)
        reached = ruler.distance((effect,))
        if np.isfinite(reached):
            result = (factor * typical, effect, reached)
            close = abs(np.log(max(reached, 1e-3) / wanted)) < 0.15
            if close or (kind.all_or_nothing and secondary < 0.5):
                break
            new = float(np.clip(factor * wanted / max(reached, 1e-3), 0.01, kind.largest))
            if new == factor:
                break
            factor = new
        else:
            factor /= 3
    if result is None or result[2] < 0.5:
        raise ValueError('the wheel sinks in, or nothing at all can be seen')
    return result
