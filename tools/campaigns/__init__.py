# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Campaigns with something hidden in them, made by an implementation of its own.

Used by the tests (60 campaigns) and by ``tools/discrepancy_study.py`` (1,000 and more). Nothing
here is imported by the package, and nothing here imports it.
"""

from .campaign import Campaign, Plan, make_campaign
from .designs import DESIGNS

__all__ = ['DESIGNS', 'Campaign', 'Plan', 'make_campaign']
