# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Velocity commands slowed down or stopped on soil that gives way; no ROS, no file format."""
