# SPDX-License-Identifier: Apache-2.0
"""State on disk: rows by kind and id in SQLite, committed to disk before they are acknowledged."""
from __future__ import annotations

import json
import os
import sqlite3
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from uav_task_alloc.atomic_files import sync_folder
from uav_task_alloc.errors import JournalCorrupt, JournalError, JournalForeign, JournalInUse
from uav_task_alloc.key_ranges import ALL_KEYS, KeyRange, RowKey, after

FILE_NAME = 'journal.sqlite3'
VERSION = 1  # of the table layout; a file with a newer one is refused
WAIT = 0.5  # [s] for the lock of another process
_MIN_SIZE = 16  # [bytes] header of SQLite, which takes a shorter file for a new database
_COLUMNS = ['kind', 'id', 'body']
# primary result codes of SQLite, and its texts for them: Python has the codes of errors
# from 3.11 on
_BUSY, _LOCKED, _CORRUPT, _NOTADB = 5, 6, 11, 26
_IN_USE, _DAMAGED = frozenset({_BUSY, _LOCKED}), frozenset({_CORRUPT, _NOTADB})
_TEXTS = {'database is locked': _BUSY, 'database table is locked': _LOCKED,
          'database disk image is malformed': _CORRUPT, 'malformed database schema': _CORRUPT,
          'file is not a database': _NOTADB}
# a text of SQLite that quotes a corrupt file may be no UTF-8
_FAILURES = (sqlite3.Error, OSError, UnicodeDecodeError)
_SELECT = 'SELECT kind, id, body FROM world'
_MOST_GAPS = 10_000  # of a corrupt file that are looked into: a second


class JournalRow(NamedTuple):
    """One record; a body of None deletes it."""

    kind: str  # 'task', 'list' and so on
    id: str  # within its kind; '' where there is one row of a kind
    body: Any  # JSON; bytes where the text on disk is not JSON


class Journal:
    """A journal file in a folder, locked by this process until `close`.

    Args:
        state_dir: the folder; created where missing.
        wait: [s] for the lock of another process.

    Raises:
        JournalCorrupt: the file is corrupt, empty or not a journal.
        JournalInUse: another process has it open.
        JournalForeign: a newer version or another program wrote it.
        JournalError: it cannot be opened. Each text names the file and the reason.
    """

    def __init__(self, state_dir: str, wait: float = WAIT) -> None:
        self.path = Path(state_dir).expanduser() / FILE_NAME
        self._db: Any = None
        try:
            check_links(self.path)
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if not self.path.exists():
                _create(self.path)
            _check_length(self.path)
            # exclusive: a second allocator would publish the same revisions
            self._db = _connect(self.path, wait)
            self._prepare()
            self._inode = self.path.stat().st_ino
        except _FAILURES as error:
            self.close()
            raise self._error('opened', error) from error
        except JournalError:
            self.close()
            raise

    def _prepare(self) -> None:
        self._db.execute('PRAGMA locking_mode = EXCLUSIVE')
        self._db.execute('PRAGMA journal_mode = WAL')
        self._db.execute('PRAGMA synchronous = FULL')  # on disk when commit returns
        version = self._db.execute('PRAGMA user_version').fetchone()[0]
        if version > VERSION:
            raise JournalForeign(f'{self.path}: layout version = {version}: expected at most '
                                 f'{VERSION}, a newer uav_task_alloc wrote it')
        self._check_layout(version)
        # zeros in the header of a page make SQLite find no rows there, without an error
        if self._db.execute('PRAGMA quick_check(1)').fetchone()[0] != b'ok':
            raise JournalCorrupt(f'{self.path}: database disk image is malformed')
        self._db.execute('BEGIN IMMEDIATE')  # fails unless the lock is ours
        self._db.execute('COMMIT')

    def _check_layout(self, version: int) -> None:
        columns = [row[1].decode() for row in self._db.execute('PRAGMA table_info(world)')]
        if version == VERSION and columns == _COLUMNS:
            return
        text = (f'{self.path}: layout version = {version}, columns = {columns}: '
                f'expected {VERSION} and {_COLUMNS}')
        if self._db.execute('SELECT count(*) FROM sqlite_master').fetchone()[0]:
            raise JournalForeign(f'{text}; it is a database of another program')
        raise JournalCorrupt(f'{text}; it is empty')

    def load(self) -> list[JournalRow]:
        """Read all rows.

        Returns:
            By kind and id; a body that is not JSON as its bytes.

        Raises:
            JournalError: the file cannot be read.
        """
        try:
            return [_row(*row) for row in self._db.execute(f'{_SELECT} ORDER BY kind, id')]
        except _FAILURES as error:
            raise self._error('read', error) from error

    def put(self, rows: Iterable[JournalRow]) -> None:
        """Store or delete rows in one transaction; they are on disk when this returns.

        Args:
            rows: a row without a body deletes one.

        Raises:
            JournalError: nothing was stored.
        """
        try:
            if not self.is_in_place():
                raise FileNotFoundError('it was removed or replaced')
            self._db.execute('BEGIN IMMEDIATE')
            for row in rows:
                if row.body is None:
                    self._db.execute('DELETE FROM world WHERE kind = ? AND id = ?', row[:2])
                else:
                    self._db.execute('INSERT OR REPLACE INTO world VALUES (?, ?, ?)',
                                     (row.kind, row.id, json.dumps(row.body)))
            self._db.execute('COMMIT')
        except _FAILURES as error:
            if self._db.in_transaction:
                self._db.execute('ROLLBACK')
            raise self._error('written', error) from error

    def is_in_place(self) -> bool:
        """Whether the file still exists; rows put into a removed one would be lost."""
        try:
            return self.path.stat().st_ino == self._inode
        except OSError:
            return False

    def close(self) -> None:
        """Close the file and release its lock."""
        if self._db is not None:
            self._db.close()

    def _error(self, what: str, error: Exception) -> JournalError:
        kind, code = JournalError, _primary_code(error)
        if code in _IN_USE:
            kind = JournalInUse
        elif code in _DAMAGED:
            kind = JournalCorrupt
        return kind(f'{self.path} cannot be {what}: {error}{_denied(self.path)}')


def _denied(path: Path) -> str:
    """What this process may not write to, which SQLite calls an I/O error; '' for nothing."""
    return next((f' (this user may not write to {each})' for each in (path, path.parent)
                 if os.access(each, os.F_OK) and not os.access(each, os.W_OK)), '')


def _primary_code(error: Exception) -> int:
    """The low byte of SQLite's result code; 0 for errors that are not of SQLite."""
    if isinstance(error, UnicodeDecodeError):
        return _CORRUPT
    if not isinstance(error, sqlite3.Error):
        return 0
    code = getattr(error, 'sqlite_errorcode', None)
    if code is None:
        return next((each for text, each in _TEXTS.items() if str(error).startswith(text)), 0)
    return int(code) & 0xff


def _connect(path: Path, wait: float = WAIT) -> Any:
    db = sqlite3.connect(path, timeout=wait, isolation_level=None, check_same_thread=False)
    db.text_factory = bytes  # corrupt text must fail in its own row only
    return db


def _create(path: Path) -> None:
    """Create a journal without rows, atomically, so that an empty file is always damage."""
    temporary = path.with_name(f'{path.name}.new-{os.getpid()}')
    try:
        temporary.unlink(missing_ok=True)
        db = _connect(temporary)
        try:
            db.execute('BEGIN IMMEDIATE')
            db.execute('CREATE TABLE world (kind TEXT, id TEXT, body TEXT NOT NULL, '
                       'PRIMARY KEY (kind, id)) WITHOUT ROWID')
            db.execute(f'PRAGMA user_version = {VERSION}')
            db.execute('COMMIT')
        finally:
            db.close()
        _move_into_place(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _move_into_place(temporary: Path, path: Path) -> None:
    """Rename the file unless another process was first; on disk when this returns."""
    try:
        os.link(temporary, path)
    except FileExistsError:
        return
    except OSError:  # a file system without hard links
        temporary.rename(path)
    sync_folder(path.parent)


def check_links(path: Path) -> None:
    """Refuse a path through a link to what is missing, as to a disk that is not mounted.

    Args:
        path: of a file, which may be missing.

    Raises:
        JournalError: names the link.
        OSError: a folder may not be read.
    """
    for each in (path, *path.parents):
        if each.is_symlink() and not each.exists():
            raise JournalError(f'{path} cannot be opened: {each} is a link to '
                               f'{os.readlink(each)}, which is missing')


def _check_length(path: Path) -> None:
    """Raise JournalCorrupt for a file that SQLite would take for a new database."""
    size = path.stat().st_size
    if size < _MIN_SIZE:
        raise JournalCorrupt(f'{path} cannot be opened: size = {size} bytes: expected at least '
                             f'{_MIN_SIZE}, it was emptied or cut short')


def _row(kind: Any, id: Any, text: Any) -> JournalRow:
    return JournalRow(_text(kind), _text(id), _body(text))


def _text(value: Any) -> str:
    return value.decode(errors='replace') if isinstance(value, bytes) else str(value)


def _body(text: Any) -> Any:
    try:
        return json.loads(text)
    except (ValueError, TypeError, RecursionError):
        return text if isinstance(text, bytes) else repr(text).encode()


def readable_rows(path: Path) -> list[JournalRow]:
    """Read what is readable of a corrupt file: around each error, from both sides.

    Args:
        path: the file; SQLite may write to it.

    Returns:
        Each readable row once; where very much is corrupt, not all of them.
    """
    found: dict[RowKey, JournalRow] = {}
    db = _connect(path)
    try:
        unread = deque(_read_towards(db, ALL_KEYS, 'ASC', found))
        unread = deque(each for gap in unread for each in _read_towards(db, gap, 'DESC', found))
        for _ in range(_MOST_GAPS):
            if not unread:
                break
            gap = unread.popleft()
            middle = gap.middle()
            if middle is not None:
                unread += _read_towards(db, KeyRange(gap.low, middle), 'DESC', found)
                unread += _read_towards(db, KeyRange(middle, gap.high), 'ASC', found)
    finally:
        db.close()
    return list(found.values())


def _read_towards(db: Any, keys: KeyRange, order: str,
                  found: dict[RowKey, JournalRow]) -> list[KeyRange]:
    """Read a range from one end up to the first error; returns the rest, if any."""
    low, high = keys
    try:
        for each in db.execute(f'{_SELECT} WHERE (kind, id) >= (?, ?) AND (kind, id) < (?, ?) '
                               f'ORDER BY kind {order}, id {order}', (*low, *high)):
            row = _row(*each)
            key = row.kind, row.id
            found.setdefault(key, row)
            low, high = (after(key), high) if order == 'ASC' else (low, key)
    except _FAILURES:
        return [KeyRange(low, high)]
    return []
