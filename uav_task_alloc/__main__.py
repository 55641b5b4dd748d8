# SPDX-License-Identifier: Apache-2.0
"""The command line: `python -m uav_task_alloc COMMAND`; needs no ROS."""
from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

from uav_task_alloc.errors import AllocError

# The command NAME is the function `main(argv)` of the module uav_task_alloc.cli.NAME, which is
# imported only when the command is run: numba and matplotlib take seconds to load.
COMMANDS = {
    'plan': 'plan the tasks of a scenario file',
    'study': "regenerate the paper's figures and tables, or run an experiment",
    'bench': 'compare the solvers on benchmark instances',
    'report': 'print the table of a recorded run and draw its map again',
    'params': 'print the tables of parameters and scenario keys; --write: into config/ and docs/',
    'compile': 'compile the kernels ahead of time into the cache on disk',
}
_INTERRUPTED = 130  # exit status of a shell after Ctrl-C


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: the command and its arguments; None: those of the process.

    Returns:
        The exit status: that of the command, 1 after an error of the package or the operating
        system, which is printed to stderr, 130 after Ctrl-C.
    """
    parser = argparse.ArgumentParser(
        prog='python -m uav_task_alloc', formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='commands:\n' + '\n'.join(
            f'  {name:8} {text}' for name, text in COMMANDS.items()))
    parser.add_argument('command', choices=COMMANDS, metavar='COMMAND')
    parser.add_argument('rest', nargs=argparse.REMAINDER, metavar='...',
                        help="the command's own arguments; -h after it lists them")
    args = parser.parse_args(argv)
    try:
        return int(importlib.import_module(f'uav_task_alloc.cli.{args.command}').main(args.rest))
    except (AllocError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return _INTERRUPTED


if __name__ == '__main__':
    sys.exit(main())
