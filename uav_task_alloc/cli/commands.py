# SPDX-License-Identifier: Apache-2.0
"""The table of commands, and what becomes of their errors: one line and an exit status."""
from __future__ import annotations

import os
import sys
from collections.abc import Sequence

# all else is imported where Ctrl-C ends the process in good order
from uav_task_alloc.cli.interrupt import INTERRUPTED, prompt_interrupt

# The command NAME is the function `main(argv)` of the module uav_task_alloc.cli.NAME, which is
# imported only when the command is run: numba and matplotlib take seconds to load. The name of a
# module cannot be a word of Python.
COMMANDS = {
    'plan': 'plan the tasks of a scenario file',
    'import': 'make a scenario file of KML, GeoJSON, .plan and CSV files',
    'study': "regenerate the paper's figures and tables, or run an experiment",
    'bench': 'compare the solvers on benchmark instances',
    'report': 'draw a recorded flight, or print the table of a demo and draw its map again',
    'params': 'print the tables of parameters and scenario keys; --write: into config/ and docs/',
    'order': 'give an order to a running allocator: pin, pause, return, undo ...',
    'compile': 'compile the kernels ahead of time into the cache on disk',
}
_MODULES = {'import': 'import_files'}
_NO_READER = 141  # exit status of a shell after SIGPIPE


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: the command and its arguments; None: those of the process.

    Returns:
        The exit status: that of the command, 1 after an error of the package or the operating
        system, which is printed to stderr, 130 after Ctrl-C, 141 where nobody reads the output.
    """
    for name in ('stdout', 'stderr'):
        if getattr(sys, name) is None:  # closed by the shell: `2>&-`
            setattr(sys, name, open(os.devnull, 'w'))  # noqa: SIM115
    with prompt_interrupt():
        return _status(sys.argv[1:] if argv is None else argv)


def _status(argv: Sequence[str]) -> int:
    """Run a command; its expected failures become one line and a status."""
    from uav_task_alloc.errors import AllocError
    try:
        try:
            return _run(argv)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        _discard_output()
        return _NO_READER
    except AllocError as error:
        return _failed(str(error))
    except OSError as error:
        _discard_output()
        return _failed(f'{error.filename or "output"}: {error.strerror or error}')
    except ModuleNotFoundError as error:
        from uav_task_alloc.cli.outputs import NotInstalled
        if not error.name or error.name.startswith('uav_task_alloc.'):
            raise
        return _failed(str(NotInstalled(argv[0], error.name.partition('.')[0])))
    except MemoryError:
        return _failed(f'{argv[0]}: out of memory: expected a smaller problem')
    except KeyboardInterrupt:
        return _failed('interrupted', INTERRUPTED)


def _run(argv: Sequence[str]) -> int:
    from difflib import get_close_matches

    from uav_task_alloc import __version__
    from uav_task_alloc.cli.options import OptionParser
    from uav_task_alloc.quick_import import import_quickly
    parser = OptionParser(
        '', 'Online task allocation for several UAVs around no-fly zones.', 'commands:\n'
        + '\n'.join(f'  {name:8} {text}' for name, text in COMMANDS.items())
        + '\n\nuav_task_alloc COMMAND -h lists the options of a command.')
    parser.usage = 'uav_task_alloc [-h] [--version] COMMAND ...'
    parser.add_argument('--version', action='version', version=f'uav_task_alloc {__version__}',
                        help='print the version and exit')
    if not argv or argv[0].startswith('-'):
        parser.parsed(argv)
        parser.print_help()
        return 0
    if argv[0] not in COMMANDS:
        near = get_close_matches(argv[0], COMMANDS, 1, 0.0)[0]
        parser.error(f'{argv[0]!r}: expected one of {", ".join(COMMANDS)}; nearest is {near}')
    command = import_quickly(f'uav_task_alloc.cli.{_MODULES.get(argv[0], argv[0])}')
    return int(command.main(argv[1:]))


def _failed(text: str, status: int = 1) -> int:
    print(text, file=sys.stderr)
    return status


def _discard_output() -> None:
    """Keep Python from writing the rest at exit, which would fail again."""
    from contextlib import suppress
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
