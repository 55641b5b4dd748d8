# SPDX-License-Identifier: Apache-2.0
"""Journals that cannot be used in their place: renamed, and what is readable read from a copy."""
from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from pathlib import Path

from uav_task_alloc.errors import JournalCorrupt, JournalError, JournalForeign
from uav_task_alloc.journal import (
    FILE_NAME,
    Journal,
    JournalRow,
    check_links,
    readable_rows,
)

_SUFFIXES = ('', '-wal', '-shm')  # of the files of SQLite
_MAX_SIZE = 2**30  # [bytes] a corrupt header may declare any length
_MEMORY = '/dev/shm'  # for a copy where no disk can be written to


def set_aside(state_dir: str) -> Path:
    """Rename the journal, so that a new one can be created.

    Args:
        state_dir: folder of the journal.

    Returns:
        The new name.

    Raises:
        JournalError: it cannot be renamed.
    """
    path = Path(state_dir).expanduser() / FILE_NAME
    aside = next(name for k in count(1)
                 if not (name := path.with_name(f'{FILE_NAME}.damaged-{k}')).exists())
    try:
        for suffix in _SUFFIXES:
            if Path(f'{path}{suffix}').exists():
                Path(f'{path}{suffix}').rename(f'{aside}{suffix}')
    except OSError as error:
        raise JournalError(f'{path} cannot be renamed: {error}') from error
    return aside


def read_copy(state_dir: str) -> list[JournalRow]:
    """Read a journal that cannot be opened in its place, as on a read-only disk.

    Args:
        state_dir: folder of the journal.

    Returns:
        Its rows, from a temporary copy; none where there is no journal.

    Raises:
        JournalError: it cannot be copied or read.
    """
    path = Path(state_dir).expanduser() / FILE_NAME
    with suppress(OSError):  # of a folder that may not be read, which the copy names
        check_links(path)
    if all(_is_missing(Path(f'{path}{suffix}')) for suffix in _SUFFIXES[:2]):
        return []

    def read(folder: str) -> list[JournalRow]:
        journal = Journal(folder)
        try:
            return journal.load()
        finally:
            journal.close()

    return _with_copy(path, read)


def recover_rows(path: Path) -> list[JournalRow]:
    """Read what is readable of a corrupt file: around each error, from both sides.

    Args:
        path: the file, which is not changed.

    Returns:
        Each readable row once.

    Raises:
        JournalError: it cannot be copied.
    """
    def read(folder: str) -> list[JournalRow]:
        _pad(Path(folder, FILE_NAME))
        return readable_rows(Path(folder, FILE_NAME))

    return _with_copy(path, read)


def _is_missing(path: Path) -> bool:
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return True
    except OSError:  # as where its folder may not be read
        return False
    return False


def _with_copy(path: Path, read: Callable[[str], list[JournalRow]]) -> list[JournalRow]:
    """Call `read` with the folder of a temporary copy: on disk, else in memory.

    Raises JournalError.
    """
    first_error: Exception | None = None
    for parent in (None, _MEMORY):
        try:
            with tempfile.TemporaryDirectory(dir=parent) as folder:
                _copy(path, folder)
                return read(folder)
        except (JournalCorrupt, JournalForeign) as error:
            raise type(error)(str(error).replace(folder, str(path.parent))) from error
        except (OSError, JournalError) as error:
            first_error = first_error or error
    raise JournalError(f'{path} cannot be copied: {first_error}') from first_error


def _pad(path: Path) -> None:
    """Extend a truncated file with zeros: SQLite reads no page of a shorter one."""
    with path.open('r+b') as file:
        header = file.read(32)
        page = int.from_bytes(header[16:18], 'big')
        length = min(page * int.from_bytes(header[28:32], 'big'), _MAX_SIZE)
        if path.stat().st_size < length:
            file.truncate(length)


def _copy(path: Path, folder: str) -> None:
    """Copy the files of a journal under its usual name. Raises OSError."""
    for suffix in _SUFFIXES[:2]:
        if not _is_missing(Path(f'{path}{suffix}')):
            shutil.copyfile(f'{path}{suffix}', Path(folder, FILE_NAME + suffix))
