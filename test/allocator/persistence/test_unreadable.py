# SPDX-License-Identifier: Apache-2.0
"""Journals that are there but cannot be read: nothing starts without the tasks in them."""
import errno
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from uav_task_alloc.allocator.persistence.persistence import Persistence
from uav_task_alloc.errors import JournalError, JournalUnreadable
from uav_task_alloc.journal import FILE_NAME, VERSION, Journal, JournalRow
from uav_task_alloc.journal_recovery import read_copy

# user id: an administrator may read everything, others not what they have closed to themselves
OTHER = os.getuid() or 65534
ROW = JournalRow('revision', '', 7)
START = """
import os, sys
from uav_task_alloc.allocator.persistence.persistence import Persistence
os.setuid(int(sys.argv[2]))
errors = []
try:
    saved = Persistence(sys.argv[1], errors.append).saved
except Exception as error:
    print(type(error).__name__, error)
else:
    print(saved.revision, *errors)
"""


def journal(folder, rows=(ROW,)):
    """A journal with these rows; returns its file."""
    folder.mkdir(parents=True, exist_ok=True)
    kept = Journal(str(folder))
    kept.put(rows)
    kept.close()
    return folder / FILE_NAME


@pytest.fixture
def open_path():
    """A folder that all users may enter; the parents of `tmp_path` are closed to them."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        yield Path(folder)


def start_as_other(folder):
    """What another user's allocator says: the error, or the revision and what is logged."""
    done = subprocess.run([sys.executable, '-c', START, str(folder), str(OTHER)], text=True,
                          check=True, stdout=subprocess.PIPE,
                          env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    return done.stdout.strip()


@pytest.mark.parametrize('what', ['file', 'folder'])
def test_what_another_user_may_not_read_is_refused(open_path, what):
    file = journal(open_path / 'state')
    (file if what == 'file' else file.parent).chmod(0)
    said = start_as_other(open_path / 'state')
    assert said.startswith(f'JournalUnreadable {file} cannot be copied: [Errno 13] Permission ')
    assert said.endswith(': expected a journal that can be read, as the tasks in it would be '
                         'forgotten: make it readable, or set another state_dir')


def test_a_journal_that_another_user_may_only_read_is_restored(open_path):
    file = journal(open_path / 'state')
    for path, mode in ((file.parent, 0o555), (file, 0o444)):
        path.chmod(mode)
    said = start_as_other(open_path / 'state')
    assert said.startswith(f'7 {file} cannot be opened: ')
    assert said.endswith(f' (this user may not write to {file}); tried again every 1 s')


def test_a_folder_that_may_not_be_written_and_has_no_journal_ends_no_start(open_path):
    (open_path / 'state').mkdir(mode=0o555)
    said = start_as_other(open_path / 'state')
    assert said.startswith(f'0 {open_path / "state" / FILE_NAME} cannot be opened: ')
    assert said.endswith(f' (this user may not write to {open_path / "state"}); '
                         'tried again every 1 s')


def test_a_folder_in_the_place_of_the_journal_is_refused(tmp_path):
    (tmp_path / FILE_NAME).mkdir()
    with pytest.raises(JournalUnreadable, match='Is a directory'):
        Persistence(str(tmp_path), print)


@pytest.mark.parametrize('linked', ['state', f'state/{FILE_NAME}'])
def test_a_link_to_a_disk_that_is_not_mounted_is_refused(tmp_path, linked):
    file = journal(tmp_path / 'state')
    there = tmp_path / 'disk'
    shutil.move(tmp_path / linked, there)
    (tmp_path / linked).symlink_to(there)
    same = Persistence(str(file.parent), print)
    assert same.saved.revision == 7
    same.close()
    there.rename(tmp_path / 'unmounted')
    said = []
    with pytest.raises(JournalUnreadable) as caught:
        Persistence(str(file.parent), said.append)
    assert (f'{file} cannot be opened: {tmp_path / linked} is a link to {there}, which is '
            'missing: expected ') in str(caught.value)
    assert said == []
    assert not there.exists()
    with pytest.raises(JournalError, match='is a link to'):
        read_copy(str(file.parent))


def test_what_can_be_read_of_a_damaged_journal_on_a_read_only_disk_is_restored(
        tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    file = journal(tmp_path, [JournalRow('off', '', ['uav_1']), ROW, *(
        JournalRow('demand', str(k), 'x' * 90) for k in range(300))])
    file.write_bytes(file.read_bytes()[:-4096])
    said = []
    monkeypatch.setattr('pathlib.Path.rename', refuse)
    persistence = Persistence(str(tmp_path), said.append)
    assert (persistence.saved.revision, persistence.saved.switched_off) == (7, ['uav_1'])
    assert 'malformed' in said[0]
    assert 'Read-only file system; it has ' in said[0]
    assert ' rows that can be read; tried again every 1 s' in said[0]


def test_a_newer_journal_on_a_read_only_disk_is_left_alone(tmp_path, monkeypatch):
    file = journal(tmp_path)
    kept = Journal(str(tmp_path))
    kept._db.execute(f'PRAGMA user_version = {VERSION + 1}')
    kept.close()

    def unopenable(*_):
        raise JournalError('attempt to write a readonly database')

    monkeypatch.setattr('uav_task_alloc.allocator.persistence.persistence.Journal', unopenable)
    before = file.read_bytes()
    with pytest.raises(JournalUnreadable, match=r'layout version = .* a newer uav_task_alloc'):
        Persistence(str(tmp_path), print)
    assert file.read_bytes() == before
