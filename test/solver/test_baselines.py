# SPDX-License-Identifier: Apache-2.0
"""Every solver against exact optima; every solver is repeatable."""
import math
from dataclasses import replace

import pytest
from optimum import best_fit
from plan_checks import check, make

from uav_task_alloc import SOLVERS, Task, ThreatZone, Uav, plan
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.objective import Weights

OPEN, HOME = {'route_end': 'hold', 'reach': math.inf}, {'route_end': 'home', 'reach': 900.0}
SEEDS = range(1, 7)
# iterations; mean gap [%] to the optimum at most: open routes, routes home beyond ranges
GAPS = {'chain_q': (3000, 0.5, 1.0), 'abc': (300, 2.5, 1.0), 'ga': (100, 5.0, 3.0),
        'q_learning': (300, 4.0, 16.0), 'auction': (1, 8.0, 30.0), 'cbba': (50, 5.0, 25.0),
        'nearest': (1, 30.0, 150.0), 'paper_chain_q': (400, 40.0, 90.0)}


@pytest.mark.parametrize('world', [OPEN, HOME], ids=['open', 'home'])
@pytest.mark.parametrize('solver', SOLVERS)
def test_the_gap_of_a_solver_to_the_optimum_is_small_and_never_negative(solver, world):
    gaps = []
    for seed in SEEDS:
        uavs, tasks = make(3, 8 + seed % 2, seed, world['reach'])
        result = plan(uavs, tasks, budget=60.0, max_iterations=GAPS[solver][0], solver=solver,
                    hard_range=False, route_end=world['route_end'])
        check(result, uavs, tasks, hard=False)
        assert not result.unassigned
        gaps.append(100.0 * (result.fit / best_fit(uavs, tasks, world is HOME) - 1.0))
    assert min(gaps) > -1e-6
    assert sum(gaps) / len(gaps) <= GAPS[solver][1 if world is OPEN else 2], gaps


def test_the_optimum_is_that_of_four_corners():
    uavs = [Uav('u', (0.0, 0.0, 0.0), 250.0)]
    tasks = [Task(name, place) for name, place in (
        ('c', (100.0, 100.0, 0.0)), ('a', (100.0, 0.0, 0.0)), ('d', (0.0, 100.0, 0.0)))]
    assert best_fit(uavs, tasks) == pytest.approx(3.0 + 50.0 + 100.0 / 3.0)
    assert best_fit(uavs, tasks, home=True) == pytest.approx(4.0 + 150.0 + 100.0 / 3.0)


@pytest.mark.parametrize('solver', SOLVERS)
def test_a_seed_and_a_number_of_iterations_repeat_the_plan(solver):
    uavs, tasks = make(4, 25, reach=2000.0)
    calls = [[], []]
    first, second = (plan(uavs, tasks, solver=solver, budget=60.0, max_iterations=15, seed=3,
                          on_iteration=lambda *each, to=to: to.append(each)) for to in calls)
    assert first.routes == second.routes
    assert first.fit == second.fit
    assert calls[0] == calls[1]
    assert calls[0][-1] == (first.iterations, pytest.approx(first.fit))


@pytest.mark.parametrize('solver', ['paper_chain_q', 'q_learning', 'abc', 'ga'])
def test_randomised_solvers_depend_on_the_seed(solver):
    uavs, tasks = make(4, 60)
    result = [plan(uavs, tasks, solver=solver, budget=60.0, max_iterations=90, seed=seed)
            for seed in (1, 2)]
    assert result[0].routes != result[1].routes


@pytest.mark.parametrize('solver', SOLVERS)
def test_a_plan_is_valid_with_all_features_of_a_problem(solver):
    uavs, tasks = make(4, 24, seed=5, reach=2500.0)
    uavs = [replace(uav, home=(500.0, 300.0, 0.0), capabilities=frozenset(able))
            for uav, able in zip(uavs, (['lidar'], ['lidar'], [], ['camera']), strict=True)]
    tasks = [replace(task, required_capabilities=frozenset({'lidar'} if i % 4 == 0 else ()),
                     allowed_uavs=frozenset({'u1', 'u3'}) if i % 5 == 0 else None)
             for i, task in enumerate(tasks)]
    zones = [ThreatZone.hemisphere('dome', (500.0, 600.0, 0.0), 120.0)]
    locked = {'u2': ['t3'], 'u0': ['t4', 't1']}
    for hard in (True, False):
        result = plan(uavs, tasks, zones, budget=60.0, max_iterations=10, solver=solver,
                    hard_range=hard, route_end='home', locked=locked)
        check(result, uavs, tasks, hard)
        assert [result.routes[u][:len(row)] for u, row in locked.items()] == [
            ('t3',), ('t4', 't1')]
        assert hard or set(result.unassigned.values()) <= {'inside zone dome'}


@pytest.mark.parametrize('solver', SOLVERS)
def test_a_solver_ends_with_its_budget(solver):
    uavs, tasks = make(10, 100)
    now = iter(i * 0.001 for i in range(10 ** 9))
    result = plan(uavs, tasks, solver=solver, budget=0.05, clock=lambda: next(now))
    check(result, uavs, tasks)
    assert not result.unassigned
    assert result.solve_time < 0.1


def test_problems_beyond_the_table_sizes_are_refused():
    uavs, tasks = make(1, 2001)
    for solver, most in (('paper_chain_q', 200), ('abc', 2000), ('auction', 2000)):
        with pytest.raises(InvalidValue, match=f'tasks = 2001: expected at most {most}'):
            plan(uavs, tasks, solver=solver)


@pytest.mark.parametrize('solver', SOLVERS)
@pytest.mark.parametrize('weights', [Weights(value=0.0), Weights(0.0, 0.0, 0.0)])
def test_a_fit_of_zero_is_handled(solver, weights):
    uavs = [Uav(f'u{i}', (0.0, 0.0, 0.0)) for i in range(2)]
    tasks = [Task(f't{i}', (0.0, 0.0, 0.0)) for i in range(4)]
    result = plan(uavs, tasks, solver=solver, budget=60.0, max_iterations=5, weights=weights)
    assert (result.fit, result.unassigned) == (0.0, {})
