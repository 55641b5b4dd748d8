# SPDX-License-Identifier: Apache-2.0
"""Journals that cannot be used in their place: what is readable is read, and nothing changed."""
import pytest

from uav_task_alloc.errors import JournalCorrupt, JournalError
from uav_task_alloc.journal import FILE_NAME, Journal, JournalRow
from uav_task_alloc.journal_recovery import read_copy, recover_rows, set_aside

ROW = JournalRow('a', '1', 1)
ROWS = [JournalRow('a', f'{k:03}', 'x' * 50) for k in range(300)]


def filled(tmp_path, rows):
    """The file of a journal with these rows, and its bytes."""
    journal = Journal(str(tmp_path))
    journal.put(rows)
    journal.close()
    file = tmp_path / FILE_NAME
    return file, bytearray(file.read_bytes())


def test_a_journal_that_another_process_has_open_is_read_from_a_copy(tmp_path):
    journal = Journal(str(tmp_path))
    journal.put([ROW])  # in the log of SQLite only
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert read_copy(str(tmp_path)) == [ROW]
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize('folder', ['', 'missing', 'file/state'])
def test_where_there_is_no_journal_there_are_no_rows(tmp_path, folder):
    (tmp_path / 'file').touch()
    assert read_copy(str(tmp_path / folder)) == []


def test_a_copy_that_fits_on_no_disk_is_read_in_memory(tmp_path, monkeypatch):
    journal = Journal(str(tmp_path))
    journal.put([ROW])
    journal.close()
    monkeypatch.setattr('tempfile.tempdir', str(tmp_path / 'missing'))
    assert read_copy(str(tmp_path)) == [ROW]
    monkeypatch.setattr('uav_task_alloc.journal_recovery._MEMORY', str(tmp_path / 'missing'))
    with pytest.raises(JournalError, match='cannot be copied: '):
        read_copy(str(tmp_path))


def test_a_damaged_copy_is_an_error(tmp_path):
    (tmp_path / FILE_NAME).write_bytes(b'something else entirely ' * 100)
    with pytest.raises(JournalCorrupt, match='cannot be opened'):
        read_copy(str(tmp_path))


def test_a_journal_is_set_aside_with_its_log_under_a_name_of_its_own(tmp_path):
    names = []
    for _ in range(2):
        journal = Journal(str(tmp_path))
        journal.put([ROW])
        names.append(set_aside(str(tmp_path)).name)
    assert names == [f'{FILE_NAME}.damaged-1', f'{FILE_NAME}.damaged-2']
    assert (tmp_path / f'{FILE_NAME}.damaged-1-wal').exists()
    assert not (tmp_path / FILE_NAME).exists()


def test_a_journal_that_is_gone_is_set_aside_without_an_error(tmp_path):
    assert set_aside(str(tmp_path)).name == f'{FILE_NAME}.damaged-1'


@pytest.mark.parametrize('pages', [2, 4, 6])
def test_finding_23_the_rows_before_a_truncation_are_recovered(tmp_path, pages):
    file, whole = filled(tmp_path, ROWS)
    file.write_bytes(whole[:4096 * pages])
    with pytest.raises(JournalCorrupt, match='malformed'):
        Journal(str(tmp_path))
    held = file.read_bytes()
    aside = set_aside(str(tmp_path))
    recovered = recover_rows(aside)
    assert aside.read_bytes() == held
    assert {row.body for row in recovered} <= {'x' * 50}
    assert len(recovered) >= 30 * (pages - 2)


def test_finding_23_the_rows_on_both_sides_of_a_corrupt_page_are_recovered(tmp_path):
    file, held = filled(tmp_path, ROWS)
    held[4 * 4096:5 * 4096] = bytes(range(256)) * 16
    file.write_bytes(held)
    recovered = {row.id for row in recover_rows(set_aside(str(tmp_path)))}
    assert {'000', '299'} <= recovered
    assert 200 <= len(recovered) < 300


def test_the_rows_between_corrupt_pages_are_recovered(tmp_path):
    file, held = filled(tmp_path, [JournalRow('task', f't{k}', 'x' * 700) for k in range(2000)])
    leaves = [page for page in range(2, len(held) // 4096) if held[page * 4096] == 10]
    for page in leaves[2:-2:40]:
        held[page * 4096:(page + 1) * 4096] = bytes(4096)
    file.write_bytes(held)
    recovered = recover_rows(set_aside(str(tmp_path)))
    assert {row.body for row in recovered} == {'x' * 700}
    assert 1800 <= len({row.id for row in recovered}) == len(recovered) < 2000


def test_a_damage_that_sqlite_quotes_in_its_error_is_a_damage(tmp_path):
    journal = Journal(tmp_path)
    journal.put([JournalRow('a', '1', 1)])
    journal.close()
    path = tmp_path / FILE_NAME
    held = path.read_bytes()
    at = held.index(b'CREATE TABLE world')
    path.write_bytes(held[:at + 9] + b'\xac' + held[at + 10:])
    with pytest.raises(JournalCorrupt, match=FILE_NAME):
        Journal(tmp_path)
    assert recover_rows(path) == []
