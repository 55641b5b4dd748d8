# SPDX-License-Identifier: Apache-2.0
"""The world on disk: rows by kind and id in SQLite, safe before they are acknowledged."""
from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from uav_task_alloc.errors import JournalError

FILE_NAME = 'journal.sqlite3'
VERSION = 1  # of the layout; a file of a newer one is refused


class Row(NamedTuple):
    """One thing of the world; a body of None takes it out."""

    kind: str
    id: str
    body: Any  # JSON


class Journal:
    """A file in `state_dir`. Raises JournalError, which names the file and the reason."""

    def __init__(self, state_dir: str) -> None:
        self.path = Path(state_dir).expanduser() / FILE_NAME
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            # one process owns it: a second allocator would hand out the same revisions
            self._db = sqlite3.connect(self.path, timeout=0.5, isolation_level=None,
                                       check_same_thread=False)
            self._prepare()
        except (sqlite3.Error, OSError) as error:
            raise self._error('opened', error) from error

    def _prepare(self) -> None:
        self._db.execute('PRAGMA locking_mode = EXCLUSIVE')
        self._db.execute('PRAGMA journal_mode = WAL')
        self._db.execute('PRAGMA synchronous = FULL')  # on disk when commit returns
        version = self._db.execute('PRAGMA user_version').fetchone()[0]
        if version > VERSION:
            raise JournalError(f'{self.path}: layout version = {version}: expected at most '
                               f'{VERSION}, a newer uav_task_alloc wrote it')
        self._db.execute('BEGIN IMMEDIATE')
        self._db.execute('CREATE TABLE IF NOT EXISTS world (kind TEXT, id TEXT, '
                         'body TEXT NOT NULL, PRIMARY KEY (kind, id)) WITHOUT ROWID')
        self._db.execute(f'PRAGMA user_version = {VERSION}')
        self._db.execute('COMMIT')

    def load(self) -> list[Row]:
        """Everything that was put and not taken out."""
        try:
            rows = self._db.execute('SELECT kind, id, body FROM world ORDER BY kind, id')
            return [Row(kind, id, json.loads(body)) for kind, id, body in rows]
        except (sqlite3.Error, ValueError) as error:
            raise self._error('read', error) from error

    def put(self, rows: Iterable[Row]) -> None:
        """All rows or none; they are on disk when this returns."""
        try:
            self._db.execute('BEGIN IMMEDIATE')
            for row in rows:
                if row.body is None:
                    self._db.execute('DELETE FROM world WHERE kind = ? AND id = ?', row[:2])
                else:
                    self._db.execute('INSERT OR REPLACE INTO world VALUES (?, ?, ?)',
                                     (row.kind, row.id, json.dumps(row.body)))
            self._db.execute('COMMIT')
        except sqlite3.Error as error:
            if self._db.in_transaction:
                self._db.execute('ROLLBACK')
            raise self._error('written', error) from error

    def close(self) -> None:
        """Let go of the file."""
        self._db.close()

    def _error(self, what: str, error: Exception) -> JournalError:
        return JournalError(f'{self.path} cannot be {what}: {error}')
