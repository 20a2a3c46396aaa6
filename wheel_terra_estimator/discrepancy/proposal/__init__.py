# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A law for what no listed effect explains: found, judged on what was left out, put in words."""
