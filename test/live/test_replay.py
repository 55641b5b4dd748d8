# SPDX-License-Identifier: Apache-2.0
import json

import pytest
from small_run import BEGIN, FIRST, LATER

from uav_task_alloc.live.__main__ import play
from uav_task_alloc.record.run_state import RECORD_FILE


@pytest.fixture
def folder(tmp_path):
    (tmp_path / RECORD_FILE).write_text(''.join(json.dumps(line) + '\n' for line in FIRST + LATER))
    return tmp_path


def test_a_record_is_shown_at_its_end_and_at_a_moment(folder):
    snapshots = play(folder)
    now = json.loads(snapshots.updates_since(0)[1])
    then = json.loads(snapshots.at(BEGIN + 19))['parts']
    assert now['parts']['statuses']['t5'] == ['UNASSIGNED', '', 'inside zone z1']
    assert [plan['revision'] for plan in now['plans']] == [1, 2]
    assert now['clock'] == {'start': BEGIN, 'speedup': 1.0, 'live': False, 'wall': BEGIN + 20,
                            'begin': BEGIN}
    assert then['statuses']['t1'] == ['ACTIVE', 'u1', '']


def test_a_record_is_shown_until_a_moment(folder):
    assert json.loads(play(folder, until=10.0).updates_since(0)[1])['clock']['wall'] == BEGIN


def test_a_folder_without_record_is_an_error(tmp_path):
    with pytest.raises(OSError, match=RECORD_FILE):
        play(tmp_path)
