# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Groups and scores of many campaigns (``wheel_terra_lab.trials``), for studies and tests."""

from wheel_terra_lab.trials.campaign import Campaign, Plan, make_campaign
from wheel_terra_lab.trials.designs import DESIGNS

__all__ = ['DESIGNS', 'Campaign', 'Plan', 'make_campaign']
