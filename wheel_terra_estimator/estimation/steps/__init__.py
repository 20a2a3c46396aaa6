# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Steps of the wheel-soil estimator, one module each, as functions over one context."""
