# SPDX-License-Identifier: Apache-2.0
"""The files that a command writes: checked before it computes; errors name the option."""
from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from uav_task_alloc.atomic_files import replacing
from uav_task_alloc.errors import AllocError, InvalidValue

FIGURE_SUFFIXES = ('.png', '.pdf', '.svg')
MAP_SUFFIXES = ('.geojson', '.kml')
PLAN_MAP_SUFFIXES = (*MAP_SUFFIXES, '.plan')
_INPUT_SUFFIXES = ('.yaml', '.yml', '.mcap')  # a file that took long to make is not replaced
EXTRAS = {  # of setup.py, by the package that is imported
    'matplotlib': 'plot', 'aiohttp': 'view', 'mcap': 'view', 'mcap_ros2': 'view',
    'plotly': 'view', 'distributed': 'study', 'ortools': 'study', 'pyvrp': 'study'}


class NotInstalled(AllocError):
    """A package is not installed; the text names what asks for it, and what installs it.

    Args:
        place: what needs the package, for the text.
        package: name of the module that is missing.
    """

    def __init__(self, place: str, package: str) -> None:
        extra = EXTRAS.get(package)
        what = f"'.[{extra}]'" if extra else '.'
        super().__init__(f'{place}: {package} is not installed: expected pip install {what} '
                         'in the folder of uav_task_alloc')


def check_installed(place: str, *packages: str) -> None:
    """Raise NotInstalled for the first of the packages that is missing."""
    for package in packages:
        if importlib.util.find_spec(package) is None:
            raise NotInstalled(place, package)


def check_file(option: str, path: Path | None, suffixes: Sequence[str] = (),
               inputs: Sequence[Path] = ()) -> None:
    """Check that a file can be written, before it takes time to compute what goes into it.

    Args:
        option: for errors: `--json`.
        path: of the file; None, where the option is not given, is accepted.
        suffixes: the name ends with one of them; none: any but those of inputs.
        inputs: files that the command reads or writes otherwise, and that it must not be.

    Raises:
        InvalidValue: the name has another suffix, or the file cannot be written.
    """
    if path is None:
        return
    if str(path) == '-':
        raise InvalidValue(option, '-', 'the name of a file; /dev/stdout is standard output')
    if suffixes and path.suffix.lower() not in suffixes:
        raise InvalidValue(option, str(path), f'a name that ends with {" or ".join(suffixes)}')
    if not suffixes and path.suffix.lower() in _INPUT_SUFFIXES:
        raise InvalidValue(option, str(path), f'a name that does not end with {path.suffix}, as '
                           'scenarios and recordings do')
    with naming(option, path):
        if path.is_dir():
            raise InvalidValue(option, str(path), 'a file, and this is a folder')
        if not path.parent.is_dir():
            raise InvalidValue(option, str(path),
                               f'a file in a folder that exists, not {path.parent}')
        if path.resolve() in [each.resolve() for each in inputs]:
            raise InvalidValue(option, str(path), 'another file than the command uses otherwise')
        _try_to_write(path)


def check_folder(option: str, path: Path | None) -> None:
    """Check that files can be written into a folder, or that it can be made.

    Raises:
        InvalidValue: it cannot.
    """
    if path is not None:
        with naming(option, path):
            there = next(each for each in (path, *path.absolute().parents) if each.exists())
            _try_to_write(there / f'.uav_task_alloc_{os.getpid()}')


@contextmanager
def naming(option: str, path: Path) -> Iterator[None]:
    """Within `with`, an OSError becomes an InvalidValue that names the option.

    A pipe that nobody reads any more is no error of the option.

    Args:
        option: for errors: `--json`.
        path: of the option.

    Returns:
        None.

    Raises:
        InvalidValue: the text has the OSError.
    """
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise InvalidValue(option, str(path), 'a place that can be written: '
                           f'{error.strerror or error}') from None


@contextmanager
def writing(option: str, path: Path) -> Iterator[Path]:
    """Within `with`, the file of an option is written, complete or not at all.

    Args:
        option: for errors: `--json`.
        path: of the option.

    Returns:
        The file to write, which replaces that of the option at the end.

    Raises:
        InvalidValue: it cannot be written; the old content stays.
    """
    with naming(option, path), replacing(path) as file:
        yield file


def _try_to_write(path: Path) -> None:
    """Open and close a file as a check; one that was not there is removed again."""
    try:
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL))
        path.unlink()
    except FileExistsError:
        if path.is_file():  # others, as a pipe, may not be opened twice
            os.close(os.open(path, os.O_WRONLY))
