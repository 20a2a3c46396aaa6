# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What an effect is: a name, a claim, parameters with priors, and terms in the contact model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, TypeAlias

from wheel_terra_estimator.terramechanics.contact import Contact

OUTPUTS = ('sinkage', 'drawbar_pull', 'torque')
PRIORS = ('half_normal', 'normal')
STAGES = ('on_inputs', 'on_contact', 'on_normal_stress', 'on_outputs')

# A term changes the contact in place; `parameters.kd` is the value of the parameter ``kd``;
# `maths` is numpy or ScalarMaths.
Term: TypeAlias = Callable[[Contact, SimpleNamespace, Any], None]
EffectSettings: TypeAlias = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class EffectParameter:
    """One number of an effect.

    Attributes
    ----------
    name, unit, meaning : str
        As in the configuration key ``effects.<effect>.<name>``.
    default : float
        Value where the effect is switched on and no other value is given.
    lower, upper : float
        Allowed range.
    prior : str
        ``half_normal`` (on the side of `default` from `prior_mean`) or ``normal``.
    prior_scale, prior_mean : float
        Standard deviation and centre of the prior.
    neutral : float
        Value at which the term vanishes.
    free : bool
        False: kept at its value by the discrepancy workflow.
    """

    name: str
    unit: str
    default: float
    lower: float
    upper: float
    prior_scale: float
    prior: str
    meaning: str
    prior_mean: float = 0.0
    neutral: float = 0.0
    free: bool = True

    def __post_init__(self) -> None:
        if self.prior not in PRIORS:
            raise ValueError(f'prior of {self.name} is {self.prior!r}; allowed: {PRIORS}')
        if not self.lower <= self.default <= self.upper:
            raise ValueError(
                f'default of {self.name} is {self.default}; allowed is [{self.lower}, {self.upper}]'
            )


@dataclass(frozen=True)
class Effect:
    """One physical or instrument effect of the catalogue.

    Attributes
    ----------
    name : str
        As in the public contract.
    claim : str
        One line: what it stands for.
    symbol : str
        The term as a formula.
    parameters : tuple of EffectParameter
        At least one; `on_*` receives their values by name.
    touches : frozenset of str
        Which of sinkage, drawbar_pull, torque it can change.
    instrument : bool
        True for an error of the measurement, False for physics of the soil.
    needs : tuple of str
        Columns of a table that must be there, and vary, for the effect to be seen.
    confounded_with : mapping
        Name of another effect -> what separates the two.
    incompatible_with : frozenset of str
        Effects that must not be on at the same time.
    validity, source : str
        Where it holds; paper and equation.
    candidate : bool
        False: never tried by the discrepancy workflow unless asked for by name.
    on_inputs, on_contact, on_normal_stress, on_outputs : callable or None
        The terms, ``term(contact, parameters, maths)``: see ``Contact`` for what each may change.
    """

    name: str
    claim: str
    symbol: str
    parameters: tuple[EffectParameter, ...]
    touches: frozenset[str]
    validity: str
    source: str
    instrument: bool = False
    needs: tuple[str, ...] = ()
    confounded_with: Mapping[str, str] = field(default_factory=dict)
    incompatible_with: frozenset[str] = frozenset()
    candidate: bool = True
    on_inputs: Term | None = None
    on_contact: Term | None = None
    on_normal_stress: Term | None = None
    on_outputs: Term | None = None

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise ValueError(f'effect name is {self.name!r}; allowed is a Python identifier')
        if not self.parameters:
            raise ValueError(f'effect {self.name} has no parameter; it needs at least one')
        if not self.touches or not self.touches <= set(OUTPUTS):
            raise ValueError(f'effect {self.name} touches {set(self.touches)}; allowed: {OUTPUTS}')
        if all(getattr(self, stage) is None for stage in STAGES):
            raise ValueError(f'effect {self.name} has no term; it needs one of {STAGES}')

    def parameter(self, name: str) -> EffectParameter:
        """Return the parameter of that name; ``KeyError`` if there is none."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(name)

    def defaults(self) -> dict[str, float]:
        """Return the default value of each parameter."""
        return {p.name: p.default for p in self.parameters}

    def neutral(self) -> dict[str, float]:
        """Return values at which the effect vanishes.

        Strengths at their neutral value; what only shapes the term (an onset, a depth: parameters
        whose prior is centred away from the neutral value) at its default.
        """
        first = self.parameters[0]
        return {
            p.name: p.neutral if p is first or p.prior_mean == p.neutral else p.default
            for p in self.parameters
        }
