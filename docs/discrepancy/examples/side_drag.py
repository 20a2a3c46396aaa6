# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""An effect of one's own: the side walls of a sunken wheel rub in the soil.

Used with ``wheel-terra diagnose DATA.csv --effects side_drag.py -o DIR``, or, so that ``replay``,
``predict`` and the node know it as well, with ``effect_file: side_drag.py`` in a parameter file.
"""

import numpy as np

from wheel_terra_estimator.terramechanics.effects import Effect, EffectParameter


def rub(contact, p):
    """Friction of both sides under the weight of the soil beside them, over the sunken segment."""
    depth = contact.radius * (1.0 - np.cos(contact.entrance_angle))
    area = depth * np.sqrt(2.0 * contact.radius * depth)
    force = p.gain * contact.density * contact.gravity * contact.tan_friction * depth * area
    contact.torque = contact.torque + contact.direction * contact.radius * force
    contact.drawbar_pull = contact.drawbar_pull - contact.direction * force


EFFECT = Effect(
    name='side_drag',
    claim='the side walls rub in the soil: more torque, less pull, the more the deeper it runs',
    symbol='T += r S, F -= S, S = gain rho g tan(phi) z sqrt(2 r z) z',
    parameters=(
        EffectParameter(
            'gain', '-', 10.0, 0.0, 2000.0, 100.0, 'half_normal', 'rubbing over the plain estimate'
        ),
    ),
    touches=frozenset({'drawbar_pull', 'torque'}),
    validity='sinkage below half the radius',
    source='own assumption, for demonstration',
    on_outputs=rub,
)
