# SPDX-License-Identifier: Apache-2.0
"""The journal: on disk when put returns, all rows or none, errors with file and reason."""
import os
import signal
import sqlite3
import subprocess
import sys

import pytest

from uav_task_alloc.errors import JournalCorrupt, JournalError, JournalForeign, JournalInUse
from uav_task_alloc.journal import (
    FILE_NAME,
    VERSION,
    Journal,
    JournalRow,
    _primary_code,
)

WRITER = """
import sys
from itertools import count
from uav_task_alloc.journal import Journal, JournalRow
journal = Journal(sys.argv[1])
for k in count():
    journal.put([JournalRow('a', str(k), k), JournalRow('b', str(k), k)])
    print(k, flush=True)
"""


@pytest.mark.parametrize(('text', 'code'), [
    ('database is locked', 'SQLITE_BUSY'), ('database table is locked: x', 'SQLITE_LOCKED'),
    ('file is not a database', 'SQLITE_NOTADB'),
    ('malformed database schema (x)', 'SQLITE_CORRUPT'),
    ('database disk image is malformed', 'SQLITE_CORRUPT')])
def test_an_error_without_a_code_as_in_python_3_10_is_known_by_its_text(text, code):
    error = sqlite3.OperationalError(text)
    assert not hasattr(error, 'sqlite_errorcode')
    if hasattr(sqlite3, code):
        assert _primary_code(error) == getattr(sqlite3, code)
    assert _primary_code(sqlite3.OperationalError(f'no such table: {text}')) == 0
    assert _primary_code(OSError(text)) == 0


def test_rows_that_were_put_are_loaded_after_a_restart(tmp_path):
    journal = Journal(str(tmp_path / 'new' / 'folder'))
    journal.put([JournalRow('task', 't1', {'x': 1.5}), JournalRow('task', 't2', [1, 2])])
    journal.put([JournalRow('task', 't1', {'x': float('inf')}), JournalRow('task', 't2', None)])
    journal.close()
    assert Journal(str(tmp_path / 'new' / 'folder')).load() == [
        JournalRow('task', 't1', {'x': float('inf')})]


def test_a_killed_writer_loses_nothing_it_acknowledged(tmp_path):
    writer = subprocess.Popen([sys.executable, '-c', WRITER, str(tmp_path)],
                              stdout=subprocess.PIPE, text=True, cwd=os.getcwd(),
                              env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    for line in writer.stdout:
        if int(line) >= 20:
            writer.send_signal(signal.SIGKILL)
            break
    acknowledged = [line, *writer.stdout][-1]
    writer.wait()
    writer.stdout.close()
    rows = Journal(str(tmp_path)).load()
    put = {kind: {row.body for row in rows if row.kind == kind} for kind in 'ab'}
    assert put['a'] == put['b']  # all rows or none
    assert put['a'] >= set(range(int(acknowledged) + 1))


def test_a_torn_end_of_the_log_is_ignored(tmp_path):
    journal = Journal(str(tmp_path))
    journal.put([JournalRow('a', '1', 1)])
    log = tmp_path / (FILE_NAME + '-wal')
    copy = tmp_path / 'copy'
    copy.mkdir()
    (copy / FILE_NAME).write_bytes((tmp_path / FILE_NAME).read_bytes())
    whole = log.read_bytes()
    journal.put([JournalRow('a', '2', 2)])
    torn = log.read_bytes()
    assert len(torn) > len(whole)
    (copy / (FILE_NAME + '-wal')).write_bytes(torn[:len(whole) + (len(torn) - len(whole)) // 2])
    assert Journal(str(copy)).load() == [JournalRow('a', '1', 1)]


def test_a_second_allocator_on_the_same_folder_is_refused(tmp_path):
    first = Journal(str(tmp_path))
    first.put([JournalRow('a', '1', 1)])
    with pytest.raises(JournalInUse, match='cannot be opened: database is locked'):
        Journal(str(tmp_path))


def test_a_file_that_is_not_a_journal_is_refused_and_unchanged(tmp_path):
    (tmp_path / FILE_NAME).write_bytes(b'something else entirely ' * 100)
    with pytest.raises(JournalError, match='cannot be opened: file is not a database'):
        Journal(str(tmp_path))
    assert (tmp_path / FILE_NAME).read_bytes().startswith(b'something else')


def test_a_journal_of_a_newer_version_is_refused(tmp_path):
    Journal(str(tmp_path)).close()
    database = sqlite3.connect(tmp_path / FILE_NAME)
    database.execute(f'PRAGMA user_version = {VERSION + 1}')
    database.close()
    with pytest.raises(JournalError, match='layout version = 2: expected at most 1'):
        Journal(str(tmp_path))


def test_a_folder_that_cannot_be_created_is_refused(tmp_path):
    (tmp_path / 'file').touch()
    with pytest.raises(JournalError, match=r'file/state.*cannot be opened: \[Errno'):
        Journal(str(tmp_path / 'file' / 'state'))


def test_a_full_disk_is_reported_and_changes_nothing(tmp_path):
    journal = Journal(str(tmp_path))
    journal.put([JournalRow('a', '1', 1)])
    pages = journal._db.execute('PRAGMA page_count').fetchone()[0]
    journal._db.execute(f'PRAGMA max_page_count = {pages}')
    with pytest.raises(JournalError, match='cannot be written: database or disk is full'):
        journal.put([JournalRow('a', '1', 2), JournalRow('a', '2', 'x' * 100_000)])
    assert journal.load() == [JournalRow('a', '1', 1)]
    journal._db.execute('PRAGMA max_page_count = 1000000')
    journal.put([JournalRow('a', '1', 3)])
    assert journal.load() == [JournalRow('a', '1', 3)]


@pytest.mark.parametrize('size', [0, 1, 15])
def test_finding_23_an_emptied_file_is_not_a_new_journal(tmp_path, size):
    Journal(str(tmp_path)).close()
    with (tmp_path / FILE_NAME).open('r+b') as file:
        file.truncate(size)
    with pytest.raises(JournalCorrupt, match=f'size = {size} bytes: expected at least 16'):
        Journal(str(tmp_path))
    assert (tmp_path / FILE_NAME).stat().st_size == size


def test_finding_23_an_emptied_file_keeps_its_log(tmp_path):
    journal = Journal(str(tmp_path))
    journal.put([JournalRow('a', '1', 1)])
    log = tmp_path / (FILE_NAME + '-wal')
    held = log.read_bytes()
    journal.close()
    (tmp_path / FILE_NAME).write_bytes(b'')
    log.write_bytes(held)
    with pytest.raises(JournalCorrupt):
        Journal(str(tmp_path))
    assert log.read_bytes() == held


def test_finding_23_a_database_without_the_table_is_empty(tmp_path):
    database = sqlite3.connect(tmp_path / FILE_NAME)
    database.execute('PRAGMA user_version = 0')
    database.execute('VACUUM')  # a header, and nothing else
    database.close()
    with pytest.raises(JournalCorrupt, match=r'layout version = 0.*it is empty'):
        Journal(str(tmp_path))


def test_finding_23_a_database_of_another_program_is_unchanged(tmp_path):
    database = sqlite3.connect(tmp_path / FILE_NAME)
    database.execute('CREATE TABLE birds (name TEXT)')
    database.close()
    with pytest.raises(JournalForeign, match='a database of another program'):
        Journal(str(tmp_path))


def test_finding_23_an_interrupted_creation_leaves_no_empty_journal(tmp_path, monkeypatch):
    def kill(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr('uav_task_alloc.journal._move_into_place', kill)
    with pytest.raises(KeyboardInterrupt):
        Journal(str(tmp_path))
    monkeypatch.undo()
    assert not (tmp_path / FILE_NAME).exists()
    assert Journal(str(tmp_path)).load() == []
    assert sorted(path.name for path in tmp_path.iterdir() if 'new' in path.name) == []


def test_finding_23_a_file_system_without_links_gets_a_journal(tmp_path, monkeypatch):
    def no_links(*_):
        raise PermissionError(1, 'Operation not permitted')

    monkeypatch.setattr('os.link', no_links)
    journal = Journal(str(tmp_path))
    journal.put([JournalRow('a', '1', 1)])
    journal.close()
    assert Journal(str(tmp_path)).load() == [JournalRow('a', '1', 1)]


def test_finding_23_locked_in_the_path_is_not_a_foreign_lock(tmp_path):
    (tmp_path / 'locked').touch()
    with pytest.raises(JournalError, match='cannot be opened') as caught:
        Journal(str(tmp_path / 'locked' / 'state'))
    assert not isinstance(caught.value, JournalForeign)


def test_rows_that_zeros_on_disk_hide_are_a_damage_not_an_empty_journal(tmp_path):
    journal = Journal(tmp_path)
    journal.put([JournalRow('a', str(k), k) for k in range(20)])
    journal.close()
    path = tmp_path / FILE_NAME
    held = bytearray(path.read_bytes())
    held[4096 + 3:4096 + 5] = bytes(2)  # the number of rows in the header of their page
    path.write_bytes(held)
    with pytest.raises(JournalCorrupt, match='malformed'):
        Journal(tmp_path)
