# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip, sinkage and drawbar pull of rover wheels in loose soil."""

__version__ = '0.1.0'
