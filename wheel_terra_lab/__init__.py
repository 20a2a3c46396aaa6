# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The laboratory: what proves and measures the estimator, and no robot needs."""
