# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""ROS-shaped messages to typed measurements, estimates to messages; no bag, no rclpy."""
