# SPDX-License-Identifier: Apache-2.0
"""Files replaced atomically, or read whole; folders synced, or locked for one process."""
from __future__ import annotations

import fcntl
import os
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_TEMPORARY = '.uav_task_alloc_'  # before 8 hexadecimal digits and the suffix of the result
_MOST_LINKS = 40  # that lead to one another, as of Linux


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


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Within `with`, a result is written beside a file, which it replaces once it is complete.

    A link stays, the file that it leads to is replaced; other names of the same file (hard links)
    keep the old content. A pipe and a device are written themselves, as is a file in a folder in
    which no other one can be made. A file whose name cannot be given to another one, as of another
    user in /tmp, or a mount point, is overwritten at the end. Nothing is synced to disk. What
    killed processes have left beside the file is removed.

    Args:
        path: of the file; where `with` is left by an exception, it stays as it was.

    Returns:
        The file to write; its suffix is that of the path.

    Raises:
        OSError: the file cannot be replaced.
    """
    target = _link_target(path)
    if target.is_symlink() or not _writable(target.parent) or (
            target.exists() and not (target.is_file() and _writable(target))):
        yield path
        return
    _remove_stale(target.parent)
    temporary, descriptor = _locked_file(target.parent, path.suffix)
    try:
        yield temporary
        if target.exists():
            shutil.copymode(target, temporary)
        try:
            os.replace(temporary, target)
        except OSError:
            shutil.copyfile(temporary, target)
            temporary.unlink()
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    finally:
        os.close(descriptor)


def _link_target(path: Path) -> Path:
    """The file that a link leads to; a link of the system, as /dev/stdout, where it is one."""
    for _ in range(_MOST_LINKS):
        if not path.is_symlink() or path.parent.resolve().parts[1:2] in (('dev',), ('proc',)):
            break
        path = path.parent / path.readlink()
    return path


def _locked_file(folder: Path, suffix: str) -> tuple[Path, int]:
    """A new file, and a descriptor that has it locked until it is closed, or the process ends."""
    while True:
        path = folder / f'{_TEMPORARY}{secrets.token_hex(4)}{suffix}'
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
        with suppress(OSError):  # where a file system has no locks, none removes it either
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        if path.exists():
            return path, descriptor
        os.close(descriptor)  # another process has removed it before it was locked


def _remove_stale(folder: Path) -> None:
    """Remove the files of `_locked_file` whose processes have ended."""
    for path in folder.glob(_TEMPORARY + 8 * '[0-9a-f]' + '*'):
        with suppress(OSError), open(path, 'r+b') as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            path.unlink()


def _writable(path: Path) -> bool:
    return os.access(path, os.W_OK, effective_ids=True)


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
