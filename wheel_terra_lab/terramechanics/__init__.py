# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Published relations that no part of the product asks for, held against its models by tests."""
