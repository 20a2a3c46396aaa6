# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the estimates mean: slip, slip classes, pull margin, entrapment."""
