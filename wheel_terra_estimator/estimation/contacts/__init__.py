# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheels on the ground: loads, forces, turning, wheels without load, wheels that stand."""
