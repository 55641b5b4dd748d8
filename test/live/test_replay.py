# SPDX-License-Identifier: Apache-2.0
import json

import pytest
from small_run import BEGIN, FIRST, LATER

from uav_task_alloc.live.__main__ import play
from uav_task_alloc.record.run_state import FILE


@pytest.fixture
def folder(tmp_path):
    (tmp_path / FILE).write_text(''.join(json.dumps(line) + '\n' for line in FIRST + LATER))
    return tmp_path


def test_a_record_is_shown_as_it_ended_and_as_it_was(folder):
    board = play(folder)
    now, then = json.loads(board.news(0)[1]), json.loads(board.at(BEGIN + 19))['parts']
    assert now['parts']['statuses']['t5'] == ['UNASSIGNED', '', 'inside zone z1']
    assert [plan['revision'] for plan in now['plans']] == [1, 2]
    assert now['clock'] == {'start': BEGIN, 'speedup': 1.0, 'live': False, 'wall': BEGIN + 20,
                            'begin': BEGIN}
    assert then['statuses']['t1'] == ['ACTIVE', 'u1', '']


def test_a_record_is_shown_until_a_moment(folder):
    assert json.loads(play(folder, until=10.0).news(0)[1])['clock']['wall'] == BEGIN


def test_a_folder_without_record_is_told(tmp_path):
    with pytest.raises(OSError, match=FILE):
        play(tmp_path)
