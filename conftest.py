# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Before any test imports numpy: one thread of linear algebra for each process.

Matrices are small; on a busy machine several threads take ten times as long.
"""

import os

os.environ |= {'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1'}
