# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Entrapment: what is observed, its criteria, its forecast, the warning."""
