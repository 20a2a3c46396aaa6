# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 nodes; the only folder that imports rclpy."""
