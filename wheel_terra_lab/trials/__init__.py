# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Blind trials: an effect hidden by a second, independent quadrature, to be found by a diagnosis.

``truth`` shares no line with ``terramechanics``; ``hidden`` has the effects, other formulas of them
and strangers; ``campaign`` draws wheel, soil, design and noise; ``trial`` diagnoses and opens the
seal.
"""
