# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Published relations that no part of the product asks for, held against its models by tests.

- ``inverse``: from measurements back to stresses and equivalent soil parameters.
- ``equivalent_contact``: drawbar pull from measured torque, load and contact.
- ``longitudinal_sinkage``: slip-sinkage constructed from a slip surface.
- ``steady_sinkage``: load to sinkage with derivatives, plain floats, a second way beside the model.
"""
