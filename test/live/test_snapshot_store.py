# SPDX-License-Identifier: Apache-2.0
"""Snapshots: everything, changes, the past within its limit."""
import json
import random

import pytest

from uav_task_alloc.live.snapshot_store import MAX_LOG_ENTRIES, SnapshotStore


def put(snapshots, wall, parts, events=()):
    snapshots.put(wall, {}, parts, events)


def at(snapshots, wall):
    return json.loads(snapshots.at(wall))['parts']


def test_a_page_gets_everything_then_only_changes():
    snapshots = SnapshotStore()
    put(snapshots, 1.0, {'a': 1, 'b': 2}, ['x'])
    version, text = snapshots.updates_since(0)
    first = json.loads(text)
    assert (first['all'], first['parts'], first['events']) == (True, {'a': 1, 'b': 2}, ['x'])
    put(snapshots, 2.0, {'b': 3}, ['y', 'z'])
    _, text = snapshots.updates_since(version)
    second = json.loads(text)
    assert (second['all'], second['parts'], second['events']) == (False, {'b': 3}, ['y', 'z'])
    assert (second['clock']['wall'], second['clock']['begin']) == (2.0, 1.0)


def test_a_page_of_before_a_restart_gets_everything():
    snapshots = SnapshotStore()
    put(snapshots, 1.0, {'a': 1})
    assert json.loads(snapshots.updates_since(99)[1])['all'] is True


def test_every_moment_of_the_past_is_as_it_was():
    snapshots = SnapshotStore()
    put(snapshots, 1.0, {'a': 1, 'b': 1})
    put(snapshots, 2.0, {'a': 2})
    put(snapshots, 3.0, {'b': 3})
    assert [at(snapshots, wall) for wall in (0.0, 1.0, 2.5, 9.0)] == [
        {}, {'a': 1, 'b': 1}, {'a': 2, 'b': 1}, {'a': 2, 'b': 3}]


def test_beyond_the_limit_the_oldest_values_are_dropped_but_not_those_in_force():
    seed = 5
    noise = random.Random(seed)
    snapshots = SnapshotStore(limit=5000)
    put(snapshots, 0.0, {'zones': 'still there'})
    for wall in range(1, 100):
        put(snapshots, float(wall), {'uavs': [wall, noise.randbytes(200).hex()]})
    assert sum(len(data) for *_, data in snapshots.past) == snapshots.size <= 5000
    assert 0.0 < snapshots.clock['begin'] < 99.0
    assert at(snapshots, 99.0)['uavs'][0] == 99
    assert at(snapshots, snapshots.clock['begin'])['zones'] == 'still there'


def test_the_logs_are_bounded():
    snapshots = SnapshotStore()
    put(snapshots, 1.0, {}, range(3 * MAX_LOG_ENTRIES))
    events = json.loads(snapshots.updates_since(0)[1])['events']
    assert events == list(range(2 * MAX_LOG_ENTRIES, 3 * MAX_LOG_ENTRIES))


def test_a_value_that_is_not_json_is_refused():
    with pytest.raises(ValueError, match='JSON'):
        put(SnapshotStore(), 1.0, {'a': float('nan')})
