# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Simulator C: a third simulator of rover drives, written without sight of the other two.

It shares no physics with the estimator: bearing by capacity factors, shear by an elastoplastic
state that travels through the contact, sinkage by excavation over time. See
docs/laboratory/simulators.md.
"""
