# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of steady rows: parsed, checked for units and signs, averaged."""
