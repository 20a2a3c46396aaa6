# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The few functions that effect terms may use, for floats as numpy has them for arrays.

A term is written once: with ``maths = numpy`` it runs on arrays (quadrature, batches), with
``maths = ScalarMaths`` on floats, several times faster for six wheels than numpy.
"""

from __future__ import annotations

import math
from typing import Any


class ScalarMaths:
    """Subset of numpy's functions for plain floats."""

    pi = math.pi
    nan = math.nan
    sin = staticmethod(math.sin)
    cos = staticmethod(math.cos)
    tan = staticmethod(math.tan)
    arccos = staticmethod(math.acos)
    arctan = staticmethod(math.atan)
    exp = staticmethod(math.exp)
    expm1 = staticmethod(math.expm1)
    log = staticmethod(math.log)
    sqrt = staticmethod(math.sqrt)
    abs = staticmethod(math.fabs)
    copysign = staticmethod(math.copysign)
    isnan = staticmethod(math.isnan)

    @staticmethod
    def maximum(a: float, b: float) -> float:
        """Return the larger of two floats."""
        return a if a >= b else b

    @staticmethod
    def minimum(a: float, b: float) -> float:
        """Return the smaller of two floats."""
        return a if a <= b else b

    @staticmethod
    def where(condition: bool, a: Any, b: Any) -> Any:
        """Return a if the condition holds, else b."""
        return a if condition else b
