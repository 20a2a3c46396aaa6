# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of one MCAP or SQLite recording, whole or damaged, and what is missing in it.

It knows nothing of rovers: of the package it imports nothing but its error.
"""
