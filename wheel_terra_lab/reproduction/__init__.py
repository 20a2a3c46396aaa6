# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What three papers state in figures, tables and numbers, beside what this package computes."""
