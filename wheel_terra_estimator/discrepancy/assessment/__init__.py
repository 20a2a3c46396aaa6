# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis means: unseen rows, where the gap is, what to measure next."""
