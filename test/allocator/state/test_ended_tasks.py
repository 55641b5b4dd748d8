# SPDX-License-Identifier: Apache-2.0
"""Ended tasks alone: which are forgotten, and when nothing is searched for."""
from types import SimpleNamespace

import pytest

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.state.ended_tasks import EndedTasks
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.task_state_machine import TaskTransition
from uav_task_alloc.allocator.state.tasks import TaskRegistry
from uav_task_alloc.allocator.state.works import Works
from uav_task_alloc.model import Leg, Task


def task(k):
    return Task(f't{k}', (100.0 * k, 0.0, 50.0))


@pytest.fixture
def state():
    """Tasks t0 to t5, which have ended in this order but for t5; t0 is still in a list."""
    tasks = TaskRegistry()
    lists = PublishedLists([UavList('a', 1, (ListStop(task(0), Leg((), 1.0), 1.0),))])
    for k in range(6):
        tasks.add(task(k), float(k))
    for k in range(5):
        tasks.step(f't{k}', TaskTransition.COMPLETE, 10.0 + k, 'a')
    works = Works(tasks, (), lambda work, flown: (), lambda piece, stamp: '')
    return SimpleNamespace(tasks=tasks, lists=lists, ended=EndedTasks(tasks, works, lists))


def test_the_oldest_are_forgotten_but_none_that_is_open_or_in_a_list(state):
    state.ended.forget_oldest(2)
    assert sorted(state.tasks.records) == ['t0', 't3', 't4', 't5']


def test_nothing_is_forgotten_of_as_many_as_are_kept(state):
    state.ended.forget_oldest(5)
    assert len(state.tasks.records) == 6


def test_lists_are_searched_again_only_where_more_have_ended_or_fewer_are_kept(
        state, monkeypatch):
    searches, owners = [], state.lists.owners
    monkeypatch.setattr(state.lists, 'owners', lambda: searches.append(1) or owners())
    for keep in (2, 2, 1, 1):
        state.ended.forget_oldest(keep)
    assert len(searches) == 2
    state.tasks.step('t5', TaskTransition.COMPLETE, 20.0, 'a')
    state.ended.forget_oldest(1)
    assert len(searches) == 3
    assert sorted(state.tasks.records) == ['t0', 't5']
