# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Parts of the ablation study: which treatments, how each is switched off, on which drives."""
