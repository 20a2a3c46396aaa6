# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A law for a gap that no listed effect explains: search, cross-validation, text."""
