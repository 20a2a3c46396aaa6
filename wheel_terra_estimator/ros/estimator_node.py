# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Entry point of the estimator node; the node itself is ``lifecycle_node.EstimatorNode``."""

from __future__ import annotations

import sys

from wheel_terra_estimator.ros.process import run_node


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run_node('lifecycle_node', 'EstimatorNode', args)


if __name__ == '__main__':
    sys.exit(main())
