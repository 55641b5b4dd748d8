# SPDX-License-Identifier: Apache-2.0
"""Plans of random small problems with everything mixed: valid, optimal, with true reasons."""
from dataclasses import replace

import pytest

from uav_task_alloc.study.small_problems import compare_small, plan_faults, small_problem


@pytest.mark.parametrize('first', range(1, 61, 12))
def test_plans_are_valid_and_as_good_as_the_optimum(first):
    for seed in range(first, first + 12):
        result = compare_small(small_problem(seed, most_tasks=4), rounds=400)
        assert result is None or (result.faults, result.warm_faults) == ((), ()), seed
        assert result is None or result.gap < 1e-6, seed


def test_a_first_trip_without_tasks_gets_one_again():
    problem = small_problem(130529)  # a UAV in the air with little range left, more from home
    result = compare_small(problem, rounds=1000)
    assert result.faults == ()
    assert result.gap < 1e-6


def test_a_load_that_delays_the_tasks_before_it_is_taken_on_a_second_trip():
    problem = small_problem(191339)  # a UAV without a wait; the load is there from 49.8 s on
    result = compare_small(problem, rounds=1000)
    assert result.faults == ()
    assert result.gap < 1e-6


def test_a_departure_that_a_soft_endurance_delays_counts_in_the_search():
    problem = small_problem(271385)  # beyond its endurance in any order, at a price of 0
    result = compare_small(problem, rounds=1000)
    assert result.faults == ()
    assert result.gap < 1e-6


def test_a_later_departure_that_makes_a_locked_task_late_counts_in_the_search():
    problem = small_problem(330839)  # a task after it needs the endurance
    result = compare_small(problem, rounds=1000)
    assert result.faults == ()
    assert result.gap < 1e-6


def test_a_wrong_plan_is_noticed():
    problem = small_problem(3)
    result = problem.solve(100)
    assert list(plan_faults(problem, result)) == []
    assert list(plan_faults(problem, replace(result, cost=result.cost + 1.0)))
    assert list(plan_faults(problem, replace(result, routes={}, unassigned={})))


def test_an_untrue_reason_is_noticed():
    problem = small_problem(2)
    result = problem.solve(100)
    name = next(each for row in result.routes.values() for each in row)
    untrue = replace(result, routes={uav: tuple(each for each in row if each != name)
                                     for uav, row in result.routes.items()},
                     unassigned={**result.unassigned, name: 'payload 9 kg'})
    assert any('cannot' not in fault and 'payload 9 kg' in fault
               for fault in plan_faults(problem, untrue))
