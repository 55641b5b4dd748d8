# SPDX-License-Identifier: Apache-2.0
import json
import random

import pytest

from uav_task_alloc.live.snapshot_store import ENTRIES, SnapshotStore


def put(board, wall, parts, events=()):
    board.put(wall, {}, parts, events)


def at(board, wall):
    return json.loads(board.at(wall))['parts']


def test_a_page_gets_everything_then_only_what_is_new():
    board = SnapshotStore()
    put(board, 1.0, {'a': 1, 'b': 2}, ['x'])
    version, text = board.news(0)
    first = json.loads(text)
    assert (first['all'], first['parts'], first['events']) == (True, {'a': 1, 'b': 2}, ['x'])
    put(board, 2.0, {'b': 3}, ['y', 'z'])
    _, text = board.news(version)
    second = json.loads(text)
    assert (second['all'], second['parts'], second['events']) == (False, {'b': 3}, ['y', 'z'])
    assert (second['clock']['wall'], second['clock']['begin']) == (2.0, 1.0)


def test_a_page_that_knows_a_board_of_before_a_restart_gets_everything():
    board = SnapshotStore()
    put(board, 1.0, {'a': 1})
    assert json.loads(board.news(99)[1])['all'] is True


def test_every_moment_of_the_past_is_as_it_was():
    board = SnapshotStore()
    put(board, 1.0, {'a': 1, 'b': 1})
    put(board, 2.0, {'a': 2})
    put(board, 3.0, {'b': 3})
    assert [at(board, wall) for wall in (0.0, 1.0, 2.5, 9.0)] == [
        {}, {'a': 1, 'b': 1}, {'a': 2, 'b': 1}, {'a': 2, 'b': 3}]


def test_beyond_the_limit_the_oldest_goes_but_not_what_is_in_force():
    seed = 5
    noise = random.Random(seed)
    board = SnapshotStore(limit=5000)
    put(board, 0.0, {'zones': 'still there'})
    for wall in range(1, 100):
        put(board, float(wall), {'uavs': [wall, noise.randbytes(200).hex()]})
    assert sum(len(data) for *_, data in board.past) == board.size <= 5000
    assert 0.0 < board.clock['begin'] < 99.0
    assert at(board, 99.0)['uavs'][0] == 99
    assert at(board, board.clock['begin'])['zones'] == 'still there'


def test_the_logs_are_bounded():
    board = SnapshotStore()
    put(board, 1.0, {}, range(3 * ENTRIES))
    assert json.loads(board.news(0)[1])['events'] == list(range(2 * ENTRIES, 3 * ENTRIES))


def test_what_json_does_not_know_is_not_sent():
    with pytest.raises(ValueError, match='JSON'):
        put(SnapshotStore(), 1.0, {'a': float('nan')})
