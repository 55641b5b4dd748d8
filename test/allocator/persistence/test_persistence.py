# SPDX-License-Identifier: Apache-2.0
"""Disks that are full, read-only, damaged or removed: logged, survived, and written later."""
import errno
import os
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from allocation import AllocatorDriver

from uav_task_alloc import journal
from uav_task_alloc.allocator.persistence.persistence import Persistence
from uav_task_alloc.allocator.records import SavedState
from uav_task_alloc.errors import JournalUnreadable, OriginMismatch
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.journal import FILE_NAME, VERSION, Journal, JournalRow

FULL = """
import resource, sys
from allocation import AllocatorDriver
from uav_task_alloc.allocator.persistence.persistence import Persistence
errors = []
driver, persistence = AllocatorDriver(), Persistence(sys.argv[1], errors.append)
resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, resource.RLIM_INFINITY))
for k in range(200):
    driver.add((f't{k}', 100, 0))
    persistence.save(driver.core, driver.now + k)
print(len(errors), persistence.error)
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
persistence.save(driver.core, driver.now + 1000.0)
print(repr(persistence.error))
"""


class Disk:
    """Persistence in a folder, with an allocator and the errors logged."""

    def __init__(self, folder, origin=None):
        self.folder, self.errors = folder, []
        self.persistence = Persistence(str(folder), self.errors.append, origin)
        self.driver = AllocatorDriver(self.persistence.saved)

    def add(self, *ids):
        """Announce tasks and save, after any rest between two tries."""
        self.driver.now += 10.0
        self.driver.add(*((task_id, 100, 0) for task_id in ids))
        self.save()

    def save(self):
        self.persistence.save(self.driver.core, self.driver.now)

    def again(self):
        """The tasks that the next run restores."""
        self.persistence.close()
        persistence = Persistence(str(self.folder), self.errors.append)
        persistence.close()
        return {record.task.id for record in persistence.saved.tasks}


@pytest.fixture
def disk(tmp_path):
    return Disk(tmp_path)


def test_saved_tasks_are_restored(disk):
    disk.add('t1')
    assert disk.driver.core.rows() == []
    assert disk.again() == {'t1'}
    assert Persistence('', print).saved == SavedState()


def test_a_full_disk_is_logged_once_and_written_to_when_there_is_room(disk):
    database = disk.persistence._journal._db
    database.execute('PRAGMA max_page_count = 3')
    for k in range(300):
        disk.add(f't{k}')
    assert len(disk.errors) == 1
    assert disk.persistence.error.endswith('database or disk is full; tried again every 1 s')
    database.execute('PRAGMA max_page_count = 1000000')
    disk.add('last')
    assert disk.persistence.error == ''
    assert len(disk.again()) == 301


def test_a_disk_that_is_back_is_no_error_only_when_all_is_written(disk):
    database = disk.persistence._journal._db
    database.execute('PRAGMA max_page_count = 3')
    for k in range(300):
        disk.add(f't{k}')
    database.execute('PRAGMA max_page_count = 1000000')
    disk.driver.now += 10.0
    errors = []
    while not disk.persistence.save(disk.driver.core, disk.driver.now, 100):
        errors.append(disk.persistence.error)
    assert errors
    assert all(errors)
    assert disk.persistence.error == ''
    assert len(disk.again()) == 300
    assert len(disk.errors) == 1


def test_what_a_full_disk_cannot_take_at_the_end_is_logged(disk):
    disk.add('t1')
    read_only(disk)
    disk.add('t2', 't3')
    disk.persistence.save_last(disk.driver.core)
    [_, last] = disk.errors
    assert last.endswith(' rows of the journal could not be written before the end')
    assert disk.again() == {'t1'}


def test_files_that_may_not_grow_are_logged_once_and_written_later(tmp_path):
    done = subprocess.run([sys.executable, '-c', FULL, str(tmp_path)], text=True, check=True,
                          stdout=subprocess.PIPE, env={
                              **os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    first, last = done.stdout.splitlines()
    assert first.startswith(f'1 {tmp_path / FILE_NAME} cannot be written: ')
    assert last == "''"
    assert len(Persistence(str(tmp_path), print).saved.tasks) == 200


def read_only(disk):
    """As a disk that was remounted read-only; file modes would not stop an administrator."""
    disk.persistence._journal._db.execute('PRAGMA query_only = ON')


def test_a_disk_that_becomes_read_only_is_logged_and_written_later(disk):
    read_only(disk)
    disk.add('t1')
    assert disk.persistence.error == (
        f'{disk.folder / FILE_NAME} cannot be written: attempt to write a readonly database; '
        'tried again every 1 s')
    disk.persistence._journal._db.execute('PRAGMA query_only = OFF')
    disk.add('t2')
    assert (disk.persistence.error, disk.again()) == ('', {'t1', 't2'})


@pytest.fixture
def unopenable(monkeypatch):
    """From now on no journal opens in its place, until the function is called."""
    def journal(state_dir, wait=0.0):
        error = sqlite3.OperationalError('attempt to write a readonly database')
        raise Journal.__new__(Journal)._error('opened', error) from error

    monkeypatch.setattr(Journal, 'path', Path('there'), raising=False)
    name = 'uav_task_alloc.allocator.persistence.persistence.Journal'
    monkeypatch.setattr(name, journal)
    return lambda: monkeypatch.setattr(name, Journal)


def test_a_journal_on_a_read_only_disk_is_read_and_written_later(disk, unopenable):
    disk.add('t1')
    disk.persistence.close()
    later = Disk(disk.folder)
    assert [record.task.id for record in later.persistence.saved.tasks] == ['t1']
    later.add('t2')
    assert 'readonly database; tried again' in later.persistence.error
    unopenable()
    later.add('t3')
    assert (later.persistence.error, later.again()) == ('', {'t1', 't2', 't3'})


def test_a_disk_that_comes_late_with_another_world_is_left_alone(disk, unopenable, tmp_path):
    late = Disk(tmp_path / 'mount')
    late.add('mine')
    disk.add('theirs')
    disk.persistence.close()
    unopenable()
    (tmp_path / 'mount').mkdir()
    shutil.copy(disk.folder / FILE_NAME, tmp_path / 'mount' / FILE_NAME)
    late.add('more')
    assert 'has 1 task not read at the start, theirs say; nothing is kept' in (
        late.persistence.error)
    assert late.again() == {'theirs'}


def test_a_folder_that_cannot_be_made_is_tried_again(tmp_path):
    (tmp_path / 'file').touch()
    disk = Disk(tmp_path / 'file' / 'state')
    disk.add('t1')
    assert 'cannot be opened' in disk.persistence.error
    (tmp_path / 'file').unlink()
    disk.add('t2')
    assert (disk.persistence.error, disk.again()) == ('', {'t1', 't2'})


def test_a_folder_that_was_removed_gets_the_whole_world_again(disk):
    disk.add('t1')
    shutil.rmtree(disk.folder)
    disk.add('t2')
    assert 'it was removed or replaced' in disk.persistence.error
    disk.add('t3')
    assert (disk.persistence.error, disk.again()) == ('', {'t1', 't2', 't3'})


def test_a_damaged_file_is_set_aside_and_a_new_one_kept(tmp_path):
    damaged = b'no database at all ' * 50
    for k in (1, 2):
        (tmp_path / FILE_NAME).write_bytes(damaged)
        disk = Disk(tmp_path)
        disk.add(f't{k}')
        assert disk.errors == [disk.persistence.error]
        assert f'file is not a database; set aside as {FILE_NAME}.damaged-{k}' in disk.errors[0]
        assert (tmp_path / f'{FILE_NAME}.damaged-{k}').read_bytes() == damaged
        assert disk.again() == {f't{k}'}


def test_a_page_that_was_overwritten_is_noticed(disk):
    disk.add(*(f't{k}' for k in range(50)))
    disk.persistence.close()
    held = bytearray((disk.folder / FILE_NAME).read_bytes())
    held[4096:] = b'x' * (len(held) - 4096)
    (disk.folder / FILE_NAME).write_bytes(held)
    later = Disk(disk.folder)
    assert 'malformed; set aside as' in later.persistence.error
    later.add('t99')
    assert later.again() == {'t99'}


def test_one_bad_row_costs_that_row_only(disk):
    disk.add('t1', 't2')
    disk.persistence._journal.put([JournalRow('task', 't1', {'state': 'odd'})])
    disk.persistence._journal._db.execute("UPDATE world SET body = '{' WHERE kind = 'revision'")
    disk.persistence.close()
    later = Disk(disk.folder)
    assert [record.task.id for record in later.persistence.saved.tasks] == ['t2']
    assert 'left out: journal row ' in later.persistence.error


@pytest.mark.parametrize(('statement', 'why'), [
    (f'PRAGMA user_version = {VERSION + 1}', 'a newer uav_task_alloc wrote it'),
    ('ALTER TABLE world RENAME TO birds', 'it is a database of another program')])
def test_a_journal_of_another_version_or_program_is_left_alone(tmp_path, statement, why):
    Journal(str(tmp_path)).close()
    database = sqlite3.connect(tmp_path / FILE_NAME)
    database.execute(statement)
    database.close()
    before = (tmp_path / FILE_NAME).read_bytes()
    with pytest.raises(JournalUnreadable, match=f'{why}: expected a journal that can be read.*'
                       'use the program that wrote it, or set another state_dir'):
        Disk(tmp_path)
    assert (tmp_path / FILE_NAME).read_bytes() == before


def test_a_journal_that_another_allocator_has_is_left_to_it(disk):
    disk.add('t1')
    second = Disk(disk.folder)
    second.add('t2')
    assert 'database is locked; nothing is kept' in second.persistence.error
    assert disk.again() == {'t1'}


ZURICH, BERN = Origin(47.397742, 8.545594, 488.0), Origin(46.948, 7.4474, 540.0)


def test_finding_23_an_emptied_journal_is_logged_and_set_aside(disk):
    disk.add('t1')
    disk.persistence.close()
    (disk.folder / FILE_NAME).write_bytes(b'')
    later = Disk(disk.folder)
    assert later.errors == [later.persistence.error]
    assert 'size = 0 bytes: expected at least 16' in later.persistence.error
    assert f'set aside as {FILE_NAME}.damaged-1' in later.persistence.error
    later.add('t2')
    assert later.again() == {'t2'}


def test_finding_23_what_can_be_read_of_a_cut_journal_is_kept(disk):
    disk.add(*(f't{k}' for k in range(50)))
    disk.persistence.close()
    held = (disk.folder / FILE_NAME).read_bytes()
    (disk.folder / FILE_NAME).write_bytes(held[:-3 * 4096])
    later = Disk(disk.folder)
    some = len(later.persistence.saved.tasks)
    assert 0 < some < 50
    assert 'malformed; set aside as' in later.persistence.error
    later.add('t99')
    assert len(later.again()) == some + 1


def test_what_can_be_read_of_a_damaged_journal_is_kept_where_no_new_one_can_be_created(
        disk, monkeypatch):
    disk.add(*(f't{k}' for k in range(50)))
    disk.persistence.close()
    held = (disk.folder / FILE_NAME).read_bytes()
    (disk.folder / FILE_NAME).write_bytes(held[:-3 * 4096])
    create = journal._create

    def full(path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(journal, '_create', full)
    later = Disk(disk.folder)
    kept = {record.task.id for record in later.persistence.saved.tasks}
    assert 0 < len(kept) < 50
    assert 'No space left on device; tried again' in later.persistence.error
    monkeypatch.setattr(journal, '_create', create)
    later.add('t99')
    assert later.again() == kept | {'t99'}


def test_a_first_start_on_a_full_disk_loses_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, 'TemporaryDirectory', no_temporary_folder)
    (tmp_path / 'state').touch()  # no folder can be created there
    disk = Disk(tmp_path / 'state')
    disk.add('t1')
    assert len(disk.errors) == 1
    (tmp_path / 'state').unlink()
    disk.add('t2')
    assert (disk.persistence.error, disk.again()) == ('', {'t1', 't2'})


def no_temporary_folder(dir=None):
    raise FileNotFoundError('No usable temporary directory found')


def test_a_journal_is_read_where_no_temporary_folder_can_be_created(disk, unopenable,
                                                                    monkeypatch):
    disk.add('t1')
    disk.persistence.close()
    usual = tempfile.TemporaryDirectory
    monkeypatch.setattr(tempfile, 'TemporaryDirectory', no_temporary_folder)
    with pytest.raises(JournalUnreadable, match='No usable temporary directory found: expected'):
        Disk(disk.folder)
    monkeypatch.setattr(tempfile, 'TemporaryDirectory',
                        lambda dir=None: usual(dir=dir) if dir else no_temporary_folder())
    later = Disk(disk.folder)
    assert [record.task.id for record in later.persistence.saved.tasks] == ['t1']


def test_finding_23_locked_in_the_path_is_tried_again(tmp_path):
    (tmp_path / 'locked').touch()
    disk = Disk(tmp_path / 'locked' / 'state')
    disk.add('t1')
    assert 'tried again' in disk.persistence.error
    (tmp_path / 'locked').unlink()
    disk.add('t2')
    assert (disk.persistence.error, disk.again()) == ('', {'t1', 't2'})


def test_finding_23_a_journal_of_another_origin_is_refused(tmp_path):
    disk = Disk(tmp_path, ZURICH)
    disk.add('t1')
    disk.persistence.close()
    before = (tmp_path / FILE_NAME).read_bytes()
    with pytest.raises(OriginMismatch) as caught:
        Disk(tmp_path, BERN)
    for number in ('47.397742', '8.545594', '488.0', '46.948', '7.4474', '540.0'):
        assert number in str(caught.value)
    assert (tmp_path / FILE_NAME).read_bytes() == before
    same = Disk(tmp_path, Origin(47.397742, 8.545594 + 1e-9, 488.0))  # and the file is not in use
    assert (same.errors, len(same.persistence.saved.tasks)) == ([], 1)


def test_finding_23_a_journal_without_origin_gets_one_with_a_warning(disk):
    disk.add('t1')
    disk.persistence.close()
    later = Disk(disk.folder, ZURICH)
    assert 'names no origin: assumed origin latitude 47.397742' in later.errors[0]
    later.add('t2')
    later.persistence.close()
    with pytest.raises(OriginMismatch):
        Disk(disk.folder, BERN)


def test_finding_23_a_disk_that_comes_late_with_another_origin_is_left_alone(
        disk, unopenable, tmp_path):
    late = Disk(tmp_path / 'mount', BERN)
    late.add('mine')
    theirs = Disk(tmp_path / 'other', ZURICH)
    unopenable()
    theirs.add('mine')
    theirs.persistence.close()
    (tmp_path / 'mount').mkdir(exist_ok=True)
    shutil.copy(tmp_path / 'other' / FILE_NAME, tmp_path / 'mount' / FILE_NAME)
    late.add('more')
    assert '47.397742' in late.persistence.error
    assert late.persistence.error.endswith('nothing is kept until a restart')
