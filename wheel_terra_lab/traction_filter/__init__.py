# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A small filter on the traction curve of the soil file: candidate for the estimator's core."""
