# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Fixed-interval smoothing: estimates of each instant from the whole recording."""
