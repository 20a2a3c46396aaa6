# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What was left out of the inputs is counted once, whoever left it out."""

import math

import numpy as np
from estimate_sets import STAMP

from wheel_terra_estimator.messages.pipeline import Pipeline
from wheel_terra_estimator.messages.unpack import Message

TOPIC = 'joint_states'
NAMES = ('left', 'right')


def test_refusals_of_transport_converter_and_core_are_counted_together(rover):
    def joints(milliseconds: int, velocity: tuple[float, ...]) -> Message:
        none = np.zeros(0)
        return Message(STAMP + milliseconds * 1_000_000, NAMES, (none, np.array(velocity), none))

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
