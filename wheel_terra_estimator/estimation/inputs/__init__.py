# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Readings between two cycles of the filter: sums, means, and how old they are."""
