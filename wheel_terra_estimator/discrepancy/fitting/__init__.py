# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The model fitted to the rows: free coordinates, forward model, noise, evidence."""
