# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The groups of campaigns that the study scores, one per row of the target table."""

from __future__ import annotations

from dataclasses import dataclass

from wheel_terra_lab.trials.campaign import Plan
from wheel_terra_lab.trials.designs import DESIGNS

# Noise is Gaussian or Student-t by lot, some cells are empty: what a laboratory hands over.
_LAB = {'noise': 'mixed', 'missing': 0.03}
DRIVE = ('drive',)


@dataclass(frozen=True)
class Group:
    """A plan, the designs it runs over and how many campaigns of it (per design) a study makes."""

    plan: Plan
    count: int
    designs: tuple[str, ...] = DESIGNS


def _lab(**changes: object) -> Plan:
    return Plan(**{**_LAB, **changes})  # type: ignore[arg-type]


GROUPS: dict[str, Group] = {
    'one': Group(_lab(), 60),
    'none': Group(_lab(hide='none'), 60),
    'none, soil 2.5x': Group(_lab(hide='none', soil_error=2.5), 24),
    'one, soil 2.5x': Group(_lab(soil_error=2.5), 12),
    'other formula': Group(_lab(other_formula=True, structure=0.02), 30),
    'other formula, none': Group(_lab(hide='none', structure=0.02), 24),
    'outliers': Group(_lab(outliers=0.03), 20),
    'outliers, none': Group(_lab(hide='none', outliers=0.03), 20),
    'noise not given': Group(_lab(noise_given=False), 20),
    'noise not given, none': Group(_lab(hide='none', noise_given=False), 20),
    'outside': Group(_lab(hide='outside'), 30),
    'two': Group(_lab(hide='two'), 30),
    'no torque': Group(_lab(drop='torque'), 8),
    'no drawbar_pull': Group(_lab(drop='drawbar_pull'), 8),
    'no sinkage': Group(_lab(drop='sinkage'), 8),
    'drive': Group(Plan(drive=True), 90, DRIVE),
    'drive, none': Group(Plan(hide='none', drive=True), 60, DRIVE),
}
