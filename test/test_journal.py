# SPDX-License-Identifier: Apache-2.0
"""The journal: on disk when put returns, whole or not at all, honest about trouble."""
import os
import signal
import sqlite3
import subprocess
import sys

import pytest

from uav_task_alloc.errors import JournalError
from uav_task_alloc.journal import FILE_NAME, VERSION, Journal, Row

WRITER = """
import sys
from itertools import count
from uav_task_alloc.journal import Journal, Row
journal = Journal(sys.argv[1])
for k in count():
    journal.put([Row('a', str(k), k), Row('b', str(k), k)])
    print(k, flush=True)
"""


def test_what_was_put_is_there_after_a_restart(tmp_path):
    journal = Journal(str(tmp_path / 'new' / 'folder'))
    journal.put([Row('task', 't1', {'x': 1.5}), Row('task', 't2', [1, 2])])
    journal.put([Row('task', 't1', {'x': float('inf')}), Row('task', 't2', None)])
    journal.close()
    assert Journal(str(tmp_path / 'new' / 'folder')).load() == [
        Row('task', 't1', {'x': float('inf')})]


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
    assert put['a'] == put['b']  # whole or not at all
    assert put['a'] >= set(range(int(acknowledged) + 1))


def test_a_torn_end_of_the_log_is_left_out(tmp_path):
    journal = Journal(str(tmp_path))
    journal.put([Row('a', '1', 1)])
    log = tmp_path / (FILE_NAME + '-wal')
    copy = tmp_path / 'copy'
    copy.mkdir()
    (copy / FILE_NAME).write_bytes((tmp_path / FILE_NAME).read_bytes())
    whole = log.read_bytes()
    journal.put([Row('a', '2', 2)])
    torn = log.read_bytes()
    assert len(torn) > len(whole)
    (copy / (FILE_NAME + '-wal')).write_bytes(torn[:len(whole) + (len(torn) - len(whole)) // 2])
    assert Journal(str(copy)).load() == [Row('a', '1', 1)]


def test_a_second_allocator_on_the_same_folder_is_refused(tmp_path):
    first = Journal(str(tmp_path))
    first.put([Row('a', '1', 1)])
    with pytest.raises(JournalError, match='cannot be opened: database is locked'):
        Journal(str(tmp_path))


def test_a_file_that_is_no_journal_is_refused_and_left_alone(tmp_path):
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


def test_a_folder_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / 'file').touch()
    with pytest.raises(JournalError, match=r'file/state.*cannot be opened: \[Errno'):
        Journal(str(tmp_path / 'file' / 'state'))


def test_a_full_disk_is_reported_and_changes_nothing(tmp_path):
    journal = Journal(str(tmp_path))
    journal.put([Row('a', '1', 1)])
    pages = journal._db.execute('PRAGMA page_count').fetchone()[0]
    journal._db.execute(f'PRAGMA max_page_count = {pages}')
    with pytest.raises(JournalError, match='cannot be written: database or disk is full'):
        journal.put([Row('a', '1', 2), Row('a', '2', 'x' * 100_000)])
    assert journal.load() == [Row('a', '1', 1)]
    journal._db.execute('PRAGMA max_page_count = 1000000')
    journal.put([Row('a', '1', 3)])
    assert journal.load() == [Row('a', '1', 3)]
