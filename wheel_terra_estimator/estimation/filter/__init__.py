# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Extended Kalman filter: state, process, one module per measurement."""
