# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The estimator core: typed measurements in, estimates out; no ROS, no file format."""
