# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Studies of hours or days, each started by hand: ``python -m wheel_terra_lab.studies.NAME``."""

import os

# Studies use processes, not threads: their matrices are small. To be said before numpy is imported.
for _library in ('OMP', 'OPENBLAS'):
    os.environ.setdefault(f'{_library}_NUM_THREADS', '1')
