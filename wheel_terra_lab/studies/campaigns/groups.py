# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The groups of campaigns that are scored."""

from __future__ import annotations

from dataclasses import dataclass

from wheel_terra_lab.trials.campaign import Plan
from wheel_terra_lab.trials.designs import DESIGNS

# Noise is Gaussian or Student-t by lot, some cells are empty: what a laboratory hands over.
_LAB = {'noise': 'mixed', 'missing': 0.03}
DRIVE = ('drive',)


@dataclass(frozen=True)
class Group:
    """A plan and the designs it runs over."""

    plan: Plan
    designs: tuple[str, ...] = DESIGNS


def _lab(**changes: object) -> Plan:
    return Plan(**{**_LAB, **changes})  # type: ignore[arg-type]


GROUPS: dict[str, Group] = {
    'one': Group(_lab()),
    'none': Group(_lab(hide='none')),
    'none, soil 2.5x': Group(_lab(hide='none', soil_error=2.5)),
    'one, soil 2.5x': Group(_lab(soil_error=2.5)),
    'other formula': Group(_lab(other_formula=True, structure=0.02)),
    'other formula, none': Group(_lab(hide='none', structure=0.02)),
    'outliers': Group(_lab(outliers=0.03)),
    'outliers, none': Group(_lab(hide='none', outliers=0.03)),
    'noise not given': Group(_lab(noise_given=False)),
    'noise not given, none': Group(_lab(hide='none', noise_given=False)),
    'outside': Group(_lab(hide='outside')),
    'two': Group(_lab(hide='two')),
    'no torque': Group(_lab(drop='torque')),
    'no drawbar_pull': Group(_lab(drop='drawbar_pull')),
    'no sinkage': Group(_lab(drop='sinkage')),
    'drive': Group(Plan(drive=True), DRIVE),
    'drive, none': Group(Plan(hide='none', drive=True), DRIVE),
}
