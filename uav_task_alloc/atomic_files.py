# SPDX-License-Identifier: Apache-2.0
"""Files replaced atomically, or read whole; folders synced, or locked for one process."""
from __future__ import annotations

import fcntl
import os
import stat
from pathlib import Path


def replace_file(path: Path, text: str) -> None:
    """Replace a file atomically: at any crash it has the old content or the new one.

    Args:
        path: of the file; a temporary one with `.tmp` after its name is beside it meanwhile.
        text: new content, written as UTF-8; on disk when this returns.

    Raises:
        OSError: it cannot be written; the old content stays.
    """
    temporary = path.with_name(f'{path.name}.tmp')
    try:
        with open(temporary, 'w', encoding='utf-8') as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def read_file(path: Path, limit: int) -> str:
    """Read a small file; never waits, as for the writer of a pipe.

    Args:
        path: of the file.
        limit: [bytes] of its length.

    Returns:
        Its content, as UTF-8.

    Raises:
        OSError: it cannot be read.
        ValueError: it is longer, no regular file, or not UTF-8.
    """
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), 'rb') as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise ValueError('no regular file')
        data = file.read(limit + 1)
    if len(data) > limit:
        raise ValueError(f'larger than {limit} bytes')
    return data.decode('utf-8')


def sync_folder(folder: Path) -> None:
    """Write the entries of a folder to disk, as after a file in it was renamed or removed.

    Args:
        folder: that exists.

    Raises:
        OSError: it cannot be opened or written.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def lock_folder(folder: Path) -> int | None:
    """Lock a folder for this process; the lock ends with the process, however it ends.

    Args:
        folder: that exists.

    Returns:
        A descriptor, whose closing ends the lock; None where the file system has no locks.

    Raises:
        BlockingIOError: another process has locked it.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise
    except OSError:
        os.close(descriptor)
        return None
    return descriptor
