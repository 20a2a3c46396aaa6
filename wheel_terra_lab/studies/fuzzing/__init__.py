# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Damaged files of every kind that the program reads, and what must come of them."""
