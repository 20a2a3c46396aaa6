# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A second simulator, written apart from ``simulation/``, as another world for the bench.

It shares with the estimator the types of the measurements and the reader of configuration files
and nothing else: neither the wheel-soil library nor a line of the first simulator. It stands in
the package, not among the tools, so that ``wheel-terra evaluate --world rival`` finds it where the
package is installed without its repository.
"""
