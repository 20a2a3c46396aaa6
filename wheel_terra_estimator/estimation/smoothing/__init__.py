# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Fixed-interval smoothing: what a whole recording says of each of its instants."""
