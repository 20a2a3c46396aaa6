# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
# ruff: noqa: D102  (numpy documents the functions)
"""The few functions that effect terms may use, for floats as numpy has them for arrays.

A term is written once: with ``maths = numpy`` it runs on arrays (quadrature, batches), with
``maths = ScalarMaths`` on floats, several times faster for six wheels than numpy.
"""

from __future__ import annotations

import math
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

Quantity: TypeAlias = 'float | NDArray[np.float64]'
"""A number, or an array of a common shape."""


class Maths(Protocol):
    """The functions, as numpy and `ScalarMaths` both have them."""

    pi: float
    nan: float

    def sin(self, x: Any, /) -> Any: ...
    def cos(self, x: Any, /) -> Any: ...
    def tan(self, x: Any, /) -> Any: ...
    def arccos(self, x: Any, /) -> Any: ...
    def arctan(self, x: Any, /) -> Any: ...
    def exp(self, x: Any, /) -> Any: ...
    def expm1(self, x: Any, /) -> Any: ...
    def log(self, x: Any, /) -> Any: ...
    def sqrt(self, x: Any, /) -> Any: ...
    def abs(self, x: Any, /) -> Any: ...
    def copysign(self, x: Any, y: Any, /) -> Any: ...
    def isnan(self, x: Any, /) -> Any: ...
    def maximum(self, a: Any, b: Any, /) -> Any: ...
    def minimum(self, a: Any, b: Any, /) -> Any: ...
    def where(self, condition: Any, a: Any, b: Any, /) -> Any: ...


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
