# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Declared parameters and the reader of ROS parameter files, without ROS."""

from wheel_terra_estimator.configuration.configuration import Configuration

__all__ = ['Configuration']
