# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A rover with ground truth, on slopes and changing soil; shares only the soil physics."""
