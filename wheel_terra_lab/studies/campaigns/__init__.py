# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Groups, scores and tables of the study over many campaigns (``wheel_terra_lab.trials``).

Used by the tests (60 campaigns) and by ``discrepancy_study.py`` (1,000 and more).
"""

from wheel_terra_lab.trials.campaign import Campaign, Plan, make_campaign
from wheel_terra_lab.trials.designs import DESIGNS

__all__ = ['DESIGNS', 'Campaign', 'Plan', 'make_campaign']
