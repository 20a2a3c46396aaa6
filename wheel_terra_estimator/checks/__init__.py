# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a recording or a rover file, told from the recording itself."""
