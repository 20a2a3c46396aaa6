# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What was left out of the inputs is counted once, whoever left it out."""

import math
from typing import Any

from estimate_sets import STAMP

from wheel_terra_estimator.messages.pipeline import Pipeline

TOPIC = 'joint_states'
NAMES = ('left', 'right')


def test_refusals_of_transport_converter_and_core_are_counted_together(rover, factory):
    def joints(milliseconds: int, velocity: tuple[float, ...]) -> Any:
        return factory.joint_state(
            factory.header(STAMP + milliseconds * 1_000_000), NAMES, velocity=velocity
        )

    pipeline = Pipeline(rover)
    assert not pipeline.rejected
    pipeline.refuse(TOPIC, 'damaged')  # transport
    pipeline.hear(TOPIC, joints(0, (1.0,)))  # converter
    pipeline.hear(TOPIC, joints(20, (1.0, -1.0)))
    pipeline.hear(TOPIC, joints(20, (1.0, -1.0)))  # core, merged
    pipeline.hear(TOPIC, joints(20, (1.0, -1.0)))
    pipeline.hear(TOPIC, joints(40, (math.inf, math.inf)))  # core, refused
    reasons = {reason: n for (topic, reason), n in pipeline.rejected.items() if topic == TOPIC}
    assert reasons.pop('damaged') == 1
    assert reasons.pop('velocity and name differ in length') == 1
    assert reasons.pop('stamp repeated, merged') == 2
    assert sum(reasons.values()) == 1, reasons
    assert sum(pipeline.rejected.values()) == 5
    assert pipeline.received[TOPIC] == 6
