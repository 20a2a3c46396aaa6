# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Lets the tests of this folder import its helpers."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
