# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Find where model and measurement disagree, and name the missing effect."""
