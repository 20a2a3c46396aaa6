# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Inputs checked, put in the order of their stamps, released when due."""
