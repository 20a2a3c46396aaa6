# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What an effect is: a name, a claim, parameters with priors, and terms in the contact model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from types import SimpleNamespace
from typing import Any, TypeAlias

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics.contact import Contact

OUTPUTS = ('sinkage', 'drawbar_pull', 'torque')
TOUCHABLE = (*OUTPUTS, 'lateral_force')
PRIORS = ('half_normal', 'normal')
STAGES = ('on_inputs', 'on_contact', 'on_normal_stress', 'on_outputs')

# A term changes the contact in place; `parameters.kd` is the value of the parameter ``kd``;
# its quantities are numbers or arrays.
Term: TypeAlias = Callable[[Contact, SimpleNamespace], None]
# Of the wheel of Ding et al. 2010, 165 mm wide: load [N], rim radius [m], pressure [Pa].
REFERENCE_LOAD, REFERENCE_RADIUS, REFERENCE_PRESSURE = 80.0, 0.157, 3000.0
# Effect name -> parameter -> value; ``form`` names the form where it is not the first one.
EffectSettings: TypeAlias = Mapping[str, Mapping[str, Any]]
FORM_MARK = ':'  # between the name of an effect and that of its form in the key of a variant


def effect_of(key: str) -> str:
    """Return the name of the effect, whichever its form: ``multipass`` for ``multipass:rut``."""
    return key.partition(FORM_MARK)[0]


@dataclass(frozen=True)
class EffectParameter:
    """One number of an effect."""

    # ``name``, ``unit``, ``meaning``: as in the configuration key ``effects.<effect>.<name>``
    name: str
    unit: str
    default: float  # value where the effect is switched on and no other value is given
    # ``lower``, ``upper``: allowed range
    lower: float
    upper: float
    # ``prior_scale``, ``prior_mean``: standard deviation and centre of the prior
    prior_scale: float
    prior: str  # ``half_normal`` (on the side of `default` from `prior_mean`) or ``normal``
    meaning: str
    prior_mean: float = 0.0
    neutral: float = 0.0  # value at which the term vanishes
    free: bool = True  # False: kept at its value by the discrepancy workflow
    # True: `prior_scale` is that of the reference wheel, and grows with the load, a torque's with
    # load times radius
    by_load: bool = False

    def __post_init__(self) -> None:
        if self.prior not in PRIORS:
            raise ValueError(f'prior of {self.name} is {self.prior!r}; allowed: {PRIORS}')
        if not self.lower <= self.default <= self.upper:
            raise ValueError(
                f'default of {self.name} is {self.default}; allowed is [{self.lower}, {self.upper}]'
            )


def _of_prior(
    prior: str,
    about_default: bool,
    name: str,
    unit: str,
    default: float,
    lower: float,
    upper: float,
    scale: float,
    meaning: str,
    *,
    free: bool = True,
    by_load: bool = False,
) -> EffectParameter:
    """Return a parameter whose prior has its centre at the default, or at 0."""
    centre = default if about_default else 0.0
    limits = default, lower, upper, scale
    return EffectParameter(name, unit, *limits, prior, meaning, centre, free=free, by_load=by_load)


magnitude = partial(_of_prior, 'half_normal', False)
"""A parameter that is the size of a term, with the sign of its default."""
signed = partial(_of_prior, 'normal', False)
"""A parameter that is the size of a term, of either sign."""
shape = partial(_of_prior, 'normal', True)
"""A parameter that shapes a term (an onset, a depth)."""


@dataclass(frozen=True)
class Form:
    """A law of an effect, beside the one that the effect itself states.

    None: as of the effect.
    """

    name: str  # value of the configuration key ``effects.<effect>.form``
    claim: str  # one line: what it stands for
    symbol: str  # the term as a formula
    parameters: tuple[EffectParameter, ...]  # at least one; `on_*` receives their values by name
    # Which of `TOUCHABLE` it is seen by (soil and rim change the lateral force as they do pull)
    touches: frozenset[str] | None = None
    # ``validity``, ``source``: where it holds; paper and equation
    validity: str | None = None
    source: str = ''
    # Columns of a table that must be there, and vary, for the effect to be seen
    needs: tuple[str, ...] | None = None
    # False: never tried by the discrepancy workflow unless asked for by name
    candidate: bool | None = None
    why_aside: str = ''  # the reason for that
    # ``on_inputs``, ``on_contact``, ``on_normal_stress``, ``on_outputs``: the terms of this law,
    # ``term(contact, parameters)``: see ``Contact`` for what each may change
    on_inputs: Term | None = None
    on_contact: Term | None = None
    on_normal_stress: Term | None = None
    on_outputs: Term | None = None


@dataclass(frozen=True)
class Effect(Form):
    """One physical or instrument effect of the catalogue.

    The fields state its first form. ``forms`` has all of them, each as an effect of one form:
    the first under the effect's name, another under ``name:form``. These keys stand wherever
    effects are settled by name and value, so that two forms can be weighed side by side. The name
    is that of docs/effects.md and of configuration keys.
    """

    touches: frozenset[str] = frozenset(OUTPUTS)
    validity: str = ''
    needs: tuple[str, ...] = ()
    candidate: bool = True
    instrument: bool = False  # True for an error of the measurement, False for physics of the soil
    # Name of another effect -> what separates the two
    confounded_with: Mapping[str, str] = field(default_factory=dict)
    incompatible_with: frozenset[str] = frozenset()  # effects that must not be on at the same time
    # True: parameters that are not given are absent instead of at their defaults, and configuration
    # files state the others as flat lists (``learned_closure``)
    sparse: bool = False
    form: str = 'standard'  # name of the first form
    # Further forms; a parameter that several forms share is the same object in each
    other_forms: tuple[Form, ...] = ()

    def __post_init__(self) -> None:
        if not self.base_name.isidentifier():
            raise ValueError(f'effect name is {self.name!r}; allowed is a Python identifier')
        if not self.parameters:
            raise ValueError(f'effect {self.name} has no parameter; it needs at least one')
        if not self.touches or not self.touches <= set(TOUCHABLE):
            raise ValueError(
                f'effect {self.name} touches {set(self.touches)}; allowed: {TOUCHABLE}'
            )
        if all(getattr(self, stage) is None for stage in STAGES):
            raise ValueError(f'effect {self.name} has no term; it needs one of {STAGES}')
        names = [self.form, *(form.name for form in self.other_forms)]
        if len(set(names)) < len(names):
            raise ValueError(f'forms of effect {self.name} are {names}; each needs its own name')
        shared: dict[str, EffectParameter] = {}
        for parameters in (self.parameters, *(form.parameters for form in self.other_forms)):
            for parameter in parameters:
                if shared.setdefault(parameter.name, parameter) != parameter:
                    raise ValueError(
                        f'effect {self.name} states the parameter {parameter.name} in two ways; '
                        'forms share a parameter or name it apart'
                    )

    @property
    def base_name(self) -> str:
        """Name of the effect, whichever its form."""
        return effect_of(self.name)

    @cached_property
    def forms(self) -> tuple[Effect, ...]:
        """All forms, the first one first, each as an effect of that form alone."""
        if not self.other_forms:
            return (self,)
        first = replace(self, other_forms=())
        return (first, *(_variant(first, form) for form in self.other_forms))

    @cached_property
    def all_parameters(self) -> tuple[EffectParameter, ...]:
        """Parameters of all forms, each once."""
        return tuple({p.name: p for form in self.forms for p in form.parameters}.values())

    def in_form(self, form: str) -> Effect:
        """Return the effect in one form alone; ``ValueError`` if it has no such form."""
        forms = {variant.form: variant for variant in self.forms}
        if form not in forms:
            raise ValueError(f'effect {self.name} has no form {form!r}; it has {", ".join(forms)}')
        return forms[form]

    def sized(self, load: float, radius: float) -> Effect:
        """Return the effect with the priors of forces and torques for such a wheel [N], [m]."""

        def of_wheel(parameters: tuple[EffectParameter, ...]) -> tuple[EffectParameter, ...]:
            force = load / REFERENCE_LOAD
            torque = force * radius / REFERENCE_RADIUS
            return tuple(
                replace(p, prior_scale=p.prior_scale * (force if p.unit == 'N' else torque))
                if p.by_load
                else p
                for p in parameters
            )

        others = (replace(f, parameters=of_wheel(f.parameters)) for f in self.other_forms)
        return replace(self, parameters=of_wheel(self.parameters), other_forms=tuple(others))

    def parameter(self, name: str) -> EffectParameter:
        """Return the parameter of that name; ``KeyError`` if there is none."""
        return {parameter.name: parameter for parameter in self.parameters}[name]

    def defaults(self) -> dict[str, float]:
        """Return the default value of each parameter; none of a sparse effect."""
        if self.sparse:
            return {}
        return {p.name: p.default for p in self.parameters}

    def neutral(self) -> dict[str, float]:
        """Return values at which the effect vanishes.

        Strengths at their neutral value; what only shapes the term (an onset, a depth: parameters
        whose prior is centred away from the neutral value) at its default.
        """
        first = self.parameters[0]
        if self.sparse:
            return {}
        return {
            p.name: p.neutral if p is first or p.prior_mean == p.neutral else p.default
            for p in self.parameters
        }


def relative_pressure(contact: Contact) -> Quantity:
    """Mean pressure W/(b r) over `REFERENCE_PRESSURE` [-]: what grows with the load."""
    return contact.normal_load / (contact.width * contact.rim_radius * REFERENCE_PRESSURE)


def _variant(first: Effect, form: Form) -> Effect:
    """Return the effect in another form; its key is ``name:form``."""
    own = {f.name: getattr(form, f.name) for f in fields(form)}
    stated = {key: value for key, value in own.items() if value is not None or key in STAGES}
    names = {'name': f'{first.name}{FORM_MARK}{form.name}', 'form': form.name}
    return replace(first, **{**stated, **names})
