# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Which effects, if any: candidates, their weights, verdict and confidence."""
