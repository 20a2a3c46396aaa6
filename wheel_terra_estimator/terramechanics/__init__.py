# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheel-soil physics: pure functions of numpy arrays and floats, no ROS, no files."""
