# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Entry point of ``wheel-terra``: parse, run the sub-command, turn user errors into one line."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence

from wheel_terra_estimator import __version__
from wheel_terra_estimator.errors import UserError

# Each module has SUMMARY, add_arguments(parser) and run(arguments) -> exit status; it imports
# heavy libraries inside run, so that help and the light commands start at once.
COMMANDS = ('simulate', 'replay', 'predict', 'diagnose', 'effects', 'soilbin', 'evaluate', 'demo')


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all sub-commands."""
    parser = argparse.ArgumentParser(
        prog='wheel-terra',
        description='Slip, sinkage and drawbar pull of rover wheels in loose soil.',
    )
    parser.add_argument('--version', action='version', version=__version__)
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    for name in COMMANDS:
        module = importlib.import_module(f'wheel_terra_estimator.cli.{name}')
        sub = commands.add_parser(name, help=module.SUMMARY, description=module.SUMMARY)
        module.add_arguments(sub)
        sub.set_defaults(run=module.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run ``wheel-terra`` and return the exit status (2 for input that cannot be used)."""
    # Our matrices are small: threads of the linear algebra only get into each other's way. It has
    # to be said before numpy is imported; what the user has set stays.
    for library in ('OMP', 'OPENBLAS'):
        os.environ.setdefault(f'{library}_NUM_THREADS', '1')
    arguments = build_parser().parse_args(argv)
    try:
        return int(arguments.run(arguments) or 0)
    except UserError as error:
        print(f'wheel-terra {arguments.command}: {error}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f'wheel-terra {arguments.command}: interrupted', file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader of our output (head, less) has gone: not an error of ours.
        sys.stderr.close()
        return 0


if __name__ == '__main__':
    sys.exit(main())
