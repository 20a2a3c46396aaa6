# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The virtual soil bin: discrete elements on an external engine."""
