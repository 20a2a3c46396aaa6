# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Speed beside a floor (the least that any program must do) or a peer (the plain way)."""
