# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Truth models beside the package: their closures against the published figures."""

import numpy as np
import pytest

from wheel_terra_lab.trials.campaign import Plan, make_campaign
from wheel_terra_lab.trials.other_worlds import WORLDS, hump_share, resistive_stress


def test_a_flat_plate_pushed_down_feels_the_generic_stress():
    """Li, Zhang and Goldman 2013: the coefficients are scaled to 1 there; no side force."""
    back, up = resistive_stress(np.zeros(1), np.full(1, 0.5 * np.pi))
    assert up[0] == pytest.approx(1.0, abs=1e-3)
    assert back[0] == pytest.approx(0.0, abs=1e-9)


def test_a_plate_drawn_upwards_feels_far_less():
    _, down = resistive_stress(np.zeros(1), np.full(1, 0.5 * np.pi))
    _, up = resistive_stress(np.zeros(1), np.full(1, -0.5 * np.pi))
    assert abs(up[0]) < 0.3 * down[0]


def test_shear_peaks_at_the_hump_and_falls_to_the_residual():
    way = np.linspace(0.0, 12.0, 1201)
    share = hump_share(way, 0.7)
    assert share[100] == pytest.approx(1.0)
    assert share[-1] == pytest.approx(0.7, abs=1e-3)
    assert way[np.argmax(share)] == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize('world', sorted(WORLDS))
def test_a_campaign_of_another_world_has_a_table_and_a_truth(world):
    campaign = make_campaign(1, 'basic16', Plan(hide='outside', world=world))
    again = campaign.true_outputs(campaign.rows)
    assert again['torque'] == pytest.approx(campaign.noise_free['torque'])
    order = np.argsort(campaign.rows['slip'])
    pull = campaign.noise_free['drawbar_pull'][order]
    assert pull[-4:].mean() > pull[:4].mean()
