# SPDX-License-Identifier: Apache-2.0
"""Directions of tasks with a path in accepted plans."""
from dataclasses import replace

from allocation import AllocatorDriver, as_plan

from uav_task_alloc.allocator.replan_records import ReplanAnswer
from uav_task_alloc.allocator.replanning.plan_acceptance import accepted_plan, exchange_groups


def test_a_line_that_is_flown_the_other_way_is_a_change():
    rows = {'a': ('1', '2'), 'b': ('3',)}
    assert exchange_groups(rows, rows, {'2'}) == [frozenset('a')]


def test_a_combined_plan_keeps_the_directions_of_its_parts():
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 0.0, 2000.0, 50.0)
    driver.add(('t1', -100, 0), ('t2', 95, 0), ('t3', 100, 2000))
    problem = driver.begin()
    place = {task.id: task for task in problem.tasks}
    base = replace(as_plan(problem.uavs, place, (), {'a': ('t1', 't2'), 'b': ('t3',)}),
                   reversed=frozenset({'t1', 't3'}))
    fresh = replace(as_plan(problem.uavs, place, (), {'a': ('t2', 't1'), 'b': ('t3',)}),
                    reversed=frozenset({'t2'}))
    chosen = accepted_plan(ReplanAnswer(problem, base, fresh), 0.001)
    assert chosen.routes == {'a': ('t2', 't1'), 'b': ('t3',)}
    assert chosen.reversed == {'t2', 't3'}
