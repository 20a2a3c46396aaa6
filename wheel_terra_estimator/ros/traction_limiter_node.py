# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Entry point of the traction limiter; the node itself is ``limiter_node.TractionLimiter``."""

from __future__ import annotations

import sys

from wheel_terra_estimator.ros.process import run_node


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run_node('limiter_node', 'TractionLimiter', args)


if __name__ == '__main__':
    sys.exit(main())
