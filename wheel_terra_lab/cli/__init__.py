# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Commands of ``wheel-terra`` that belong to the laboratory, found by their entry points."""
