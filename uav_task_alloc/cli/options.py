# SPDX-License-Identifier: Apache-2.0
"""The parser of a command: ranges, units and defaults in its help, an error in one line."""
from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

from uav_task_alloc.errors import InvalidValue

_MOST_TASKS = 10_000  # of an instance: its distances take 0.8 GB


class OptionParser(argparse.ArgumentParser):
    """A parser that names the option, the value and what it expects, in one line.

    Args:
        command: follows `uav_task_alloc`; '' for none.
        description: a sentence or more.
        epilog: printed as it is after the options.

    Arguments of methods:
        message: of argparse.
        argv: arguments of the command.
    """

    def __init__(self, command: str, description: str, epilog: str = '') -> None:
        super().__init__(prog=f'uav_task_alloc {command}'.rstrip(), description=description,
                         epilog=epilog, formatter_class=_Formatter)
        self.register('type', Path, _path)
        # so that -33.9,151.2,0 and -1e2 are values, not options
        self._negative_number_matcher = re.compile(r'-\.?\d')
        self._ranges: dict[str, tuple[str, float, float, str]] = {}

    def number(self, option: str, low: float, high: float, text: str, *, unit: str = '',
               default: float | None = None, default_text: str = '', whole: bool = False) -> None:
        """Add an option that takes a number.

        Args:
            option: `--budget`.
            low, high: the range, both included.
            text: a sentence for the help.
            unit: of the number; '' for none.
            default: its value where it is not given.
            default_text: shown for it; '' shows the value.
            whole: only whole numbers are accepted.
        """
        expected = (f'a {"whole " * whole}number in {_range(low, high)}'
                    + f' {unit}' * bool(unit))
        dest = option.lstrip('-').replace('-', '_')
        self._ranges[dest] = option, low, high, expected
        self.add_argument(
            option, type=_number_reader(expected, int if whole else float), default=default,
            metavar='N' if whole else (unit or 'X').upper()[:1],
            help=f'{text}: {expected} (default: {default_text or _plain(default or 0)})')

    def parsed(self, argv: Sequence[str]) -> argparse.Namespace:
        """Parse the arguments and check the ranges of all numbers.

        Raises:
            InvalidValue: a number is out of its range.
            SystemExit: the arguments are malformed, or ask for the help.
        """
        args, unknown = self.parse_known_args(argv)
        if unknown:
            self.error(self._unknown(unknown[0]))
        for dest, (option, low, high, expected) in self._ranges.items():
            value = getattr(args, dest)
            if value is not None and not low <= value <= high:
                raise InvalidValue(option, value, expected)
        return args

    def error(self, message: str) -> NoReturn:
        """Print one line to stderr and exit with status 2."""
        text = re.sub(r"^argument (\S+?)(/\S+)?: (?=')", r'\1 = ', message)
        self.exit(2, f'{self.prog}: {text.removeprefix("argument ")}; '
                     f'{self.prog} -h lists the options\n')

    def _unknown(self, word: str) -> str:
        known = [name for name in self._option_string_actions if name.startswith('--')]
        near = get_close_matches(word.partition('=')[0], known, 1, 0.6)
        return (f'{word!r} is unknown' if not near or not word.startswith('-')
                else f'{word!r} is unknown; nearest is {near[0]}')


class _Formatter(argparse.HelpFormatter):
    """Wraps a paragraph, and leaves the lines of a list as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return text if '\n' in text else super()._fill_text(text, width, indent)


def add_executor_options(parser: OptionParser, jobs: int) -> None:
    """Add --jobs, with this default, and --dask."""
    parser.number('--jobs', 1, 1024, 'processes of this machine', default=jobs, whole=True)
    parser.add_argument('--dask', metavar='tcp://HOST:PORT', help='run on the workers of this '
                        'Dask scheduler instead (default: none)')


def one_of(*names: str) -> Callable[[str], str]:
    """A reader of one of these names."""
    def read(text: str) -> str:
        if text not in names:
            raise argparse.ArgumentTypeError(f'{text!r}: expected one of {", ".join(names)}')
        return text
    return read


def list_of_names(*names: str) -> Callable[[str], list[str]]:
    """A reader of names separated by commas."""
    def read(text: str) -> list[str]:
        return [one_of(*names)(part) for part in text.split(',')]
    return read


def sizes(text: str) -> list[str]:
    """Read sizes of instances, UAVs x tasks: `4x20,8x50`."""
    for part in text.split(','):
        match = re.fullmatch(r'(\d{1,6})x(\d{1,6})', part, re.ASCII)
        if not match or not all(1 <= int(number) <= _MOST_TASKS for number in match.groups()):
            raise argparse.ArgumentTypeError(
                f'{part!r}: expected UAVs x tasks, each in [1, {_MOST_TASKS}], as 4x20')
    return text.split(',')


def size(text: str) -> str:
    """Read the size of an instance, UAVs x tasks: `4x20`."""
    return sizes(text.replace(',', ' '))[0]


def budgets(text: str) -> tuple[float, ...]:
    """Read CPU times [s] in ascending order: `0.1,1`."""
    read = _number_reader('a number in [0.001, 86400] s', float)
    values = tuple(sorted(read(part) for part in text.split(',')))
    if not 0.001 <= values[0] <= values[-1] <= 86400.0:
        raise argparse.ArgumentTypeError(f'{text!r}: expected numbers in [0.001, 86400] s')
    return values


def _path(text: str) -> Path:
    if not text:  # an unset variable of the shell: Path('') is the working directory
        raise argparse.ArgumentTypeError("'': expected a path")
    return Path(text)


def _number_reader(expected: str, kind: Callable[[str], float]) -> Callable[[str], Any]:
    def read(text: str) -> float:
        try:
            value = kind(text)
            if math.isnan(value):
                raise ValueError
        except ValueError:
            raise argparse.ArgumentTypeError(f'{text!r}: expected {expected}') from None
        return value
    return read


def _range(low: float, high: float) -> str:
    return (f'{"(" if math.isinf(low) else "["}{_plain(low)}, {_plain(high)}'
            f'{")" if math.isinf(high) else "]"}')


def _plain(value: float) -> str:
    return str(value) if isinstance(value, int) else f'{value:g}'
