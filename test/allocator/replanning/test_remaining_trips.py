# SPDX-License-Identifier: Apache-2.0
"""Later trips less what is planned already: each task is in one trip of one UAV."""
from types import SimpleNamespace

import pytest

from uav_task_alloc.allocator.replanning.trips import remaining_trips


@pytest.fixture
def world():
    """UAVs a and b are known; b may not fly t4, and t9 has ended."""
    return SimpleNamespace(
        uav_record=lambda uav_id: uav_id if uav_id in 'ab' else None,
        can_fly=lambda uav_id, task_id: task_id != 't9' and (uav_id, task_id) != ('b', 't4'))


def test_tasks_in_lists_are_left_out_and_empty_trips_with_them(world):
    later = {'a': (('t1', 't2'), ('t3',), ('t4', 't5'))}
    assert remaining_trips(world, later, ('t2', 't3')) == {'a': (('t1',), ('t4', 't5'))}


def test_a_task_of_two_uavs_stays_with_the_first(world):
    later = {'b': (('t1',),), 'a': (('t1', 't2'),)}
    assert remaining_trips(world, later, ()) == {'b': (('t1',),), 'a': (('t2',),)}


def test_only_known_uavs_keep_trips_and_only_with_tasks_that_they_may_fly(world):
    later = {'unknown': (('t1',),), 'b': (('t4', 't9'),), 'a': (('t1', 't4'),)}
    assert remaining_trips(world, later, ()) == {'a': (('t1', 't4'),)}
