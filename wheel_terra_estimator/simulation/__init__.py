# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A rover on loose soil with ground truth, of higher fidelity than the estimator's model."""
