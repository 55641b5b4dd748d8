# SPDX-License-Identifier: Apache-2.0
"""The lists of a plan that may be published, and the plan that breaks no accepted deadline."""
from dataclasses import replace

import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.replan_records import ReplanAnswer
from uav_task_alloc.allocator.replanning.built_lists import BuiltLists, build_lists
from uav_task_alloc.allocator.replanning.from_now import from_now
from uav_task_alloc.allocator.replanning.held_deadlines import held_lists, relaxed_tasks
from uav_task_alloc.allocator.replanning.lists_to_publish import (
    holding_plan,
    lists_apart,
    lists_to_publish,
)
from uav_task_alloc.allocator.replanning.plan_acceptance import accepted_plan
from uav_task_alloc.allocator.replanning.planning import replan_problem
from uav_task_alloc.model import Plan, Task
from uav_task_alloc.solver.solve import plan

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


def together_at_base(**params):
    """UAVs a and b of one base; a has both tasks, which two would be done with a little sooner."""
    driver = AllocatorDriver(objective='finish', **params)
    for uav_id, x in (('a', 0.0), ('b', 3.0)):
        driver.uav(uav_id, x, 0.0, 0.0, home=(x, 0.0, 0.0), standby=True, cruise_speed=10.0)
    driver.plan = lambda uavs, tasks, *zones, **how: routes_of(uavs, tasks, {
        'a': ('near', 'far'), 'b': ()})
    driver.add(Task('near', (300.0, 0.0, 50.0)), Task('far', (310.0, 20.0, 50.0)))
    driver.settle()
    assert driver.route('a') == ('near', 'far')
    return driver


def routes_of(uavs, tasks, routes):
    return plan(uavs, tasks, warm=Plan(routes), locked=routes, max_iterations=0,
                 objective='finish', route_end='hold')


def answer_of_two(driver, background):
    """The answer of a search that found the plan for two UAVs to be better."""
    problem = from_now(replan_problem(driver.world, Plan({}), 'test', background,
                                      stamp=driver.now))
    repaired, best = (routes_of(problem.uavs, problem.tasks, routes) for routes in (
        {'a': ('near', 'far'), 'b': ()}, {'a': ('near',), 'b': ('far',)}))
    answer = ReplanAnswer(problem, repaired, best)
    assert accepted_plan(answer, driver.world.params.replan_margin) == best
    return answer


@pytest.mark.parametrize(('apart', 'background', 'routes'), [
    (False, True, [('near',), ('far',)]), (True, False, [('near',), ('far',)]),
    (True, True, [('near', 'far'), ()])])
def test_without_an_event_a_plan_has_to_be_better_with_the_waits_that_keep_its_uavs_apart(
        apart, background, routes):
    rule = {'separation__horizontal': 10.0, 'separation__time': 2.0} if apart else {}
    driver = together_at_base(**rule)
    driver.core.adopt(answer_of_two(driver, background), driver.now, driver.now)
    driver.take()
    assert [driver.world.list_of(uav_id).task_ids for uav_id in 'ab'] == routes
    waits = [stop.wait for uav_id in 'ab' for stop in driver.world.list_of(uav_id).stops]
    assert (max(waits) > 3.0) == (apart and not background)
