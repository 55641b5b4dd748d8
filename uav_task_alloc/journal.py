# SPDX-License-Identifier: Apache-2.0
"""The world on disk: rows by kind and id in SQLite, safe before they are acknowledged."""
from __future__ import annotations

import json
import shutil
import sqlite3
import tempfile
from collections.abc import Iterable
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from uav_task_alloc.errors import JournalCorrupt, JournalError, JournalForeign

FILE_NAME = 'journal.sqlite3'
SIDE_FILES = ('', '-wal', '-shm')
VERSION = 1  # of the layout; a file of a newer one is refused


class Row(NamedTuple):
    """One thing of the world; a body of None takes it out."""

    kind: str
    id: str
    body: Any  # JSON


class Journal:
    """A file in `state_dir`.

    Raises JournalError, which names the file and the reason: JournalCorrupt where the file is
    damaged, JournalForeign where it is not ours.
    """

    def __init__(self, state_dir: str) -> None:
        self.path = Path(state_dir).expanduser() / FILE_NAME
        self._db: Any = None
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            # one process owns it: a second allocator would hand out the same revisions
            self._db = sqlite3.connect(self.path, timeout=0.5, isolation_level=None,
                                       check_same_thread=False)
            self._prepare()
            self._inode = self.path.stat().st_ino
        except (sqlite3.Error, OSError) as error:
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
        self._db.execute('BEGIN IMMEDIATE')
        self._db.execute('CREATE TABLE IF NOT EXISTS world (kind TEXT, id TEXT, '
                         'body TEXT NOT NULL, PRIMARY KEY (kind, id)) WITHOUT ROWID')
        self._db.execute(f'PRAGMA user_version = {VERSION}')
        self._db.execute('COMMIT')

    def load(self) -> list[Row]:
        """Everything that was put and not taken out; a body that is no JSON as its text."""
        try:
            rows = self._db.execute('SELECT kind, id, body FROM world ORDER BY kind, id')
            return [Row(kind, id, _body(text)) for kind, id, text in rows]
        except sqlite3.Error as error:
            raise self._error('read', error) from error

    def put(self, rows: Iterable[Row]) -> None:
        """All rows or none; they are on disk when this returns."""
        try:
            if not self.in_place():
                raise FileNotFoundError('it was removed or replaced')
            self._db.execute('BEGIN IMMEDIATE')
            for row in rows:
                if row.body is None:
                    self._db.execute('DELETE FROM world WHERE kind = ? AND id = ?', row[:2])
                else:
                    self._db.execute('INSERT OR REPLACE INTO world VALUES (?, ?, ?)',
                                     (row.kind, row.id, json.dumps(row.body)))
            self._db.execute('COMMIT')
        except (sqlite3.Error, OSError) as error:
            if self._db.in_transaction:
                self._db.execute('ROLLBACK')
            raise self._error('written', error) from error

    def in_place(self) -> bool:
        """The file is still where it was opened; one that was removed takes rows for nobody."""
        try:
            return self.path.stat().st_ino == self._inode
        except OSError:
            return False

    def close(self) -> None:
        """Let go of the file."""
        if self._db is not None:
            self._db.close()

    def _error(self, what: str, error: Exception) -> JournalError:
        kind = JournalError
        if 'locked' in str(error):
            kind = JournalForeign
        elif type(error) is sqlite3.DatabaseError:  # its subclasses mean other troubles
            kind = JournalCorrupt
        return kind(f'{self.path} cannot be {what}: {error}')


def _body(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def set_aside(state_dir: str) -> Path:
    """Rename the journal, so that a new one can begin; returns the name. Raises JournalError."""
    path = Path(state_dir).expanduser() / FILE_NAME
    aside = next(name for k in count(1)
                 if not (name := path.with_name(f'{FILE_NAME}.damaged-{k}')).exists())
    try:
        for end in SIDE_FILES:
            if Path(f'{path}{end}').exists():
                Path(f'{path}{end}').rename(f'{aside}{end}')
    except OSError as error:
        raise JournalError(f'{path} cannot be renamed: {error}') from error
    return aside


def read_copy(state_dir: str) -> list[Row]:
    """What a journal holds that cannot be opened in its place, as on a read-only disk.

    Raises JournalError.
    """
    path = Path(state_dir).expanduser() / FILE_NAME
    with tempfile.TemporaryDirectory() as folder:
        try:
            for end in SIDE_FILES[:2]:
                if Path(f'{path}{end}').exists():
                    shutil.copyfile(f'{path}{end}', Path(folder, FILE_NAME + end))
        except OSError as error:
            raise JournalError(f'{path} cannot be read: {error}') from error
        journal = Journal(folder)
        try:
            return journal.load()
        finally:
            journal.close()
