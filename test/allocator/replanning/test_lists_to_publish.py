# SPDX-License-Identifier: Apache-2.0
"""The lists of a plan that may be published, and the plan that breaks no accepted deadline."""
from dataclasses import replace

import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.replanning.built_lists import BuiltLists, build_lists
from uav_task_alloc.allocator.replanning.held_deadlines import held_lists, relaxed_tasks
from uav_task_alloc.allocator.replanning.lists_to_publish import (
    holding_plan,
    lists_apart,
    lists_to_publish,
)
from uav_task_alloc.model import Plan, Task

KEEPS, BREAKS = Plan({'a': ('due', 'far')}), Plan({'a': ('far', 'due')})


@pytest.fixture
def driver():
    """UAV a flies `due`, whose deadline it keeps only if it does so first."""
    driver = AllocatorDriver(default_cruise_speed=10.0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(Task('due', (100.0, 0.0, 50.0), latest=driver.now + 60.0))
    driver.settle()
    driver.add(Task('far', (-2000.0, 0.0, 50.0)))
    assert driver.route('a') == ('due',)
    return driver


def test_lists_of_a_plan_that_keeps_the_deadline_are_published(driver):
    built = lists_to_publish(driver.world, KEEPS, driver.now)
    assert built.lists['a'].task_ids == ('due', 'far')
    assert built.left_out == {}


def test_a_list_that_breaks_the_deadline_is_held_back_and_what_it_adds_is_left_out(driver):
    built = lists_to_publish(driver.world, BREAKS, driver.now)
    assert built.lists['a'] is driver.world.list_of('a')
    assert built.left_out == {
        'far': 'left out: it would break the deadline of due that is accepted'}


def test_the_first_plan_that_holds_the_deadlines_is_chosen(driver):
    other = replace(KEEPS, iterations=7)
    assert holding_plan(driver.world, (BREAKS, other, KEEPS), driver.now) is other
    assert holding_plan(driver.world, (BREAKS,), driver.now) is BREAKS


def test_without_separation_lists_stay_as_they_are(driver):
    built = BuiltLists(dict(driver.world.lists_in_force()))
    assert lists_apart(driver.world, built, driver.now) is built


def test_lists_that_break_no_deadline_are_not_checked_for_what_must_change(driver, monkeypatch):
    checked = []
    monkeypatch.setattr(type(driver.world), 'must_change',
                        lambda _, uav_id: bool(checked.append(uav_id)))
    lists = build_lists(driver.world, KEEPS, driver.now).lists
    checked.clear()
    assert held_lists(driver.world, lists, driver.now) == (lists, {})
    assert checked == []
    lists = build_lists(driver.world, BREAKS, driver.now).lists
    checked.clear()
    held_lists(driver.world, lists, driver.now)
    assert checked


def test_the_times_of_lists_without_deadlines_are_not_computed_for_them(monkeypatch):
    driver = AllocatorDriver(default_cruise_speed=10.0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(Task('near', (100.0, 0.0, 50.0)), Task('far', (-2000.0, 0.0, 50.0)))
    driver.settle()
    asked = []
    monkeypatch.setattr(type(driver.world.lists), 'restamped',
                        lambda _, uav_id, *times: asked.append(uav_id))
    tasks = driver.world.tasks_to_plan()
    assert relaxed_tasks(driver.world, tasks, ['a'], driver.now) == tasks
    lists = dict(driver.world.lists_in_force())
    assert held_lists(driver.world, lists, driver.now) == (lists, {})
    assert asked == []
