# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Closed form: linearised stresses."""

from __future__ import annotations

from typing import Any

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.terms import Terms


def forces(contact: Contact, terms: Terms) -> tuple[Any, Any, Any]:
    raise NotImplementedError
