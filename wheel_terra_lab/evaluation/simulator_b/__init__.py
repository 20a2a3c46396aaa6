# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Simulator B: written apart from ``simulation/`` by another hand.

It shares with the estimator the types of the measurements and the reader of configuration files
and nothing else: neither the wheel-soil library nor a line of the first simulator.
``wheel-terra evaluate --simulator B`` drives in it.
"""
