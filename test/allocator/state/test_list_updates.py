# SPDX-License-Identifier: Apache-2.0
"""Lists that are published without a new plan: less ended tasks, and again where asked for."""
from dataclasses import replace
from types import SimpleNamespace

import pytest

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.records import TaskRecord, TaskState
from uav_task_alloc.allocator.state.fleet import Fleet
from uav_task_alloc.allocator.state.flights import Flights
from uav_task_alloc.allocator.state.list_updates import ListUpdates
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.task_state_machine import TaskTransition
from uav_task_alloc.allocator.state.tasks import TaskRegistry
from uav_task_alloc.model import Leg, Task
from uav_task_alloc.params import AllocatorParams


def stop(number):
    return ListStop(Task(f't{number}', (100.0 * number, 0.0, 50.0)), Leg((), 100.0),
                    eta=10.0 * number)


@pytest.fixture
def state():
    """UAV a, which has not reported, with the list t1 t2 t3; `end(task_id)` completes a task."""
    stops = tuple(map(stop, (1, 2, 3)))
    tasks = TaskRegistry(TaskRecord(each.task, each.task, TaskState.ASSIGNED, 'a')
                         for each in stops)
    lists = PublishedLists([UavList('a', 4, stops, returns=True, distance=600.0)])
    flights = Flights(Fleet(), lists, AllocatorParams)
    return SimpleNamespace(
        lists=lists, updates=ListUpdates(tasks, lists, flights),
        end=lambda task_id: tasks.step(task_id, TaskTransition.COMPLETE, 0.0, 'a'))


def test_a_list_without_ended_tasks_is_not_shortened(state):
    assert state.updates.shortened(0.0) == {}


def test_ended_tasks_at_the_front_are_left_out(state):
    state.end('t1')
    state.end('t2')
    short = state.updates.shortened(0.0)['a']
    assert (short.task_ids, short.distance) == (('t3',), 400.0)


def test_a_list_in_which_a_later_task_has_ended_waits_for_a_plan(state):
    state.end('t1')
    state.end('t3')
    assert state.updates.shortened(0.0) == {}
    assert state.updates.to_resend(0.0) == {}


def test_lists_of_the_previous_run_are_resent_with_arrivals_from_now(state):
    resent = state.updates.to_resend(5.0)['a']
    assert resent.stamp == 5.0
    assert [each.eta for each in resent.stops] == [5.0, 15.0, 25.0]
    state.lists.publish(resent, 5.0, resend=True)
    assert state.updates.to_resend(5.0) == {}


def places(each):
    """The points flown in a list."""
    return [point for stop in each.stops for point in stop.line] + list(each.end_via)


@pytest.mark.parametrize(('ended', 'xs', 'distance'), [
    ('', [100, 200, 300], 600), ('1', [200, 300], 500), ('2', [100, 200, 300], 600),
    ('3', [100, 200, 300], 600), ('13', [200, 300], 500), ('23', [100, 200, 300], 600),
    ('123', [], 0)])
def test_after_a_restart_each_list_is_sent_without_its_ended_tasks_along_the_same_way(
        state, ended, xs, distance):
    for number in ended:
        state.end(f't{number}')
    sent = state.updates.of_previous_run(5.0)['a']
    assert sent.task_ids == tuple(f't{k}' for k in '123' if k not in ended)
    assert [x for x, _, _ in places(sent)] == xs
    assert (sent.distance, sent.stamp, sent.returns) == (distance, 5.0, True)


def test_a_list_that_ends_at_its_last_task_ends_there_after_a_restart(state):
    state.lists.lists['a'] = replace(state.lists.lists['a'], returns=False, distance=300.0)
    state.end('t3')
    sent = state.updates.of_previous_run(5.0)['a']
    assert (places(sent)[-1][0], sent.distance) == (200.0, 200.0)
