# SPDX-License-Identifier: Apache-2.0
"""The record of a node: a full disk ends it, and not the node."""
import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.record.record_file import RECORD_FILE, read_lines
from uav_task_alloc.record.run_record import RunRecord


def record_in(folder):
    """A record, its warnings and its errors."""
    warnings, errors = [], []
    return RunRecord(folder and str(folder), warnings.append, errors.append), warnings, errors


def test_lines_are_in_the_file_after_a_flush(tmp_path):
    record, warnings, errors = record_in(tmp_path / 'out')
    record.write({'wall': 1.0})
    record.flush()
    assert list(read_lines(tmp_path / 'out' / RECORD_FILE)) == [{'wall': 1.0}]
    record.close()
    record.write({'wall': 2.0})
    assert list(read_lines(tmp_path / 'out' / RECORD_FILE)) == [{'wall': 1.0}]
    assert (warnings, errors) == ([], [])


def test_without_a_folder_nothing_is_recorded():
    record, warnings, errors = record_in('')
    record.write({'wall': 1.0})
    record.flush()
    record.close()
    assert (warnings, errors) == ([], [])


def test_a_full_disk_is_logged_once(tmp_path):
    (tmp_path / RECORD_FILE).symlink_to('/dev/full')
    record, _, errors = record_in(tmp_path)
    for wall in (1.0, 2.0):
        record.write({'wall': wall})
        record.flush()
    record.close()
    assert errors == ['out_dir: [Errno 28] No space left on device: the record ends, '
                      'the node goes on']


def test_a_record_that_is_there_already_is_moved_and_named(tmp_path):
    for _ in range(2):
        record, warnings, _ = record_in(tmp_path)
        record.write({'wall': 1.0})
        record.close()
    assert warnings == [f'out_dir: its record was moved to {tmp_path}/earlier_1']


def test_a_folder_that_cannot_be_created_is_refused(tmp_path):
    (tmp_path / 'file').touch()
    with pytest.raises(InvalidValue, match=r'^out_dir = .*expected a folder that can be written '
                                           r'to \(\[Errno'):
        record_in(tmp_path / 'file')
