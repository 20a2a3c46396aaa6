# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheel-soil physics: pure functions of numpy arrays and floats, no ROS, no files.

- What is given: ``wheel``, ``soil``, ``operating_points``; ``effects`` is the catalogue.
- Laws: ``kinematics`` (slip, shear displacement), ``stresses`` (pressure, shear), ``contact`` and
  ``terms`` (one contact with its effects).
- Forces at given angles: ``quadrature``, ``closed_form``.
- Load to sinkage, pull, torque: ``model`` (by ``load_balance``); sinkage to torque and pull:
  ``conditioned`` (for the filter).
"""
