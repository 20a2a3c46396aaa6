# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Sections of the validation page, one module each; ``validate_models.py`` runs them."""
