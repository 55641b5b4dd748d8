# SPDX-License-Identifier: Apache-2.0
"""Problems in which tasks may have to be left out: which, and the search for the best ones."""
import math
from dataclasses import replace

import numpy as np
import pytest
from plan_checks import check

from uav_task_alloc import Task, Uav, plan
from uav_task_alloc.solver.chain_q import (
    COLD_SELECTION,
    COLD_START,
    MANY_ROUNDS,
    ROUNDS_A_SECOND,
    SHORT_START,
    WARM_START,
    _params,
)
from uav_task_alloc.solver.colony import Colony
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import NODE, clear, copy, copy_into, empty_routes, remove
from uav_task_alloc.solver.ruin import list_unassigned_and_overrange
from uav_task_alloc.solver.selection import leave_many, out_of_reach
from uav_task_alloc.solver.warm import repair

HOME = Rules(returns=True)


def fleet_and_tasks(tasks=60, uavs=2, reach=math.inf, seed=0):
    rng = np.random.default_rng(seed)
    points, values = rng.uniform(0.0, 1000.0, (tasks, 2)), rng.integers(1, 101, tasks)
    return ([Uav(f'u{i}', (500.0, 500.0, 0.0), reach) for i in range(uavs)],
            [Task(f't{i}', (x, y, 0.0), value=float(value))
             for i, ((x, y), value) in enumerate(zip(points, values, strict=True))])


def leaves_many(uavs, tasks, served=(), rules=HOME):
    problem = make_problem(uavs, tasks, {}, Limits(), rules)
    routes = empty_routes(problem.arrays)
    for i in served:
        routes.uav_of[len(uavs) + i] = 0
    return leave_many(problem, routes)


def test_more_than_a_twentieth_of_the_tasks_left_out_by_first_routes_are_many():
    uavs, tasks = fleet_and_tasks(reach=2000.0)
    assert leaves_many(uavs, tasks)
    assert leaves_many(uavs, tasks, range(56))
    assert not leaves_many(uavs, tasks, range(57))
    assert not leaves_many(uavs, tasks, rules=Rules(returns=True, hard=False))
    assert not leaves_many(*fleet_and_tasks())  # no range limits them
    assert not leaves_many(uavs, [])
    assert not leaves_many([], tasks)


def test_tasks_out_of_reach_do_not_count():
    uavs = [Uav('u', (0.0, 0.0, 0.0), 25.0), Uav('v', (100.0, 0.0, 0.0), 10.0)]
    tasks = [Task(name, (x, 0.0, 0.0)) for name, x in (
        ('near', 10.0), ('far', 50.0), ('other', 104.0), ('edge', 12.5), ('over', 12.6))]
    problem = make_problem(uavs, tasks, {}, Limits(), HOME)
    assert out_of_reach(problem).tolist() == [False, True, False, False, True]
    assert not leaves_many(uavs, tasks, (0, 2, 3))
    assert leaves_many(uavs, tasks, (0, 2))
    barred = [*tasks, Task('barred', (10.0, 0.0, 0.0), allowed_uavs=frozenset({'v'}))]
    problem = make_problem(uavs, barred, {}, Limits(), HOME)
    assert out_of_reach(problem).tolist() == [False, True, False, False, True, True]


def test_tasks_are_selected_where_first_routes_leave_many_out_and_there_is_time():
    def chosen(reach, warm=False, **limits):
        problem = make_problem(*fleet_and_tasks(reach=reach), {}, Limits(), HOME)
        recorder = Recorder(lambda: 0.0, 0.0, problem=problem, warm=warm, **limits)
        recorder.offer(repair(problem, {}))
        return _params(recorder)

    assert chosen(2000.0, budget=1.0) is COLD_SELECTION
    assert chosen(2000.0, budget=1.0, warm=True) is WARM_START
    assert chosen(9000.0, budget=1.0) is COLD_START
    few = MANY_ROUNDS * 60
    assert chosen(2000.0, budget=0.9 * few / ROUNDS_A_SECOND) is SHORT_START
    assert chosen(2000.0, budget=60.0, max_iterations=int(few) - 1) is SHORT_START
    assert chosen(2000.0, budget=60.0, max_iterations=int(few)) is COLD_SELECTION


def test_where_tasks_are_out_of_reach_few_others_left_out_are_few():
    """Their price must not rise as that of few tasks does: 97 of 100 are out of reach."""
    uavs = [Uav('u', (0.0, 0.0, 0.0), 45.0)]
    tasks = [Task(f't{i}', (20.0 + i, 0.0, 0.0)) for i in range(100)]
    problem = make_problem(uavs, tasks, {}, Limits(), HOME)
    colony = Colony(problem, repair(problem, {}), 1, COLD_SELECTION)
    assert (colony.arrays.unassigned_cost > 0.0).sum() == 3
    clear(colony.arrays, colony.routes)
    before = colony.arrays.unassigned_cost.copy()
    list_unassigned_and_overrange(colony.arrays, colony.routes, colony._log)
    assert colony._log.counts[2] == 3
    assert (colony.arrays.unassigned_cost == before).all()


def test_temperatures_follow_the_cost_of_leaving_a_task_out():
    uavs, tasks = fleet_and_tasks(reach=2000.0)
    near = make_problem(uavs, tasks, {}, Limits(), HOME)
    far = make_problem([replace(uav, position=(9000.0, 0.0, 0.0), range=1e5) for uav in uavs],
                       tasks, {}, Limits(), HOME)
    temperatures = [Colony(problem, repair(problem, {}), 1, COLD_SELECTION).temperature(0.0)
                    for problem in (near, far)]
    first = COLD_SELECTION.coolings[0].first
    assert temperatures[0] == pytest.approx(first * near.scale, rel=0.2)
    assert temperatures[1] > 5.0 * temperatures[0]


@pytest.mark.parametrize('returns', [True, False])
def test_routes_that_return_to_a_base_far_away_are_searched_at_higher_temperatures(returns):
    uavs, tasks = fleet_and_tasks()
    far = [replace(uav, position=(9000.0, 0.0, 0.0)) for uav in uavs]
    problem = make_problem(far, tasks, {}, Limits(), Rules(returns=returns))
    distance = np.mean([math.dist(task.position, far[0].position) for task in tasks])
    cold, short = (Colony(problem, repair(problem, {}), 1, params)
                   for params in (COLD_START, SHORT_START))
    assert short.temperature(0.0) == pytest.approx(3.0 * problem.scale)
    assert cold.temperature(0.0) == pytest.approx(distance if returns else 3.0 * problem.scale)
    for colony in (cold, short):
        colony._cooling = 2
        assert colony.temperature(1.0) == pytest.approx(0.1 * problem.scale)


def test_once_all_are_served_the_search_is_one_for_short_routes():
    uavs, tasks = fleet_and_tasks(30, reach=5000.0)
    problem = make_problem(uavs, tasks, {}, Limits(), HOME)
    full = repair(problem, {})
    assert (full.uav_of[2:32] >= 0).all()
    less = copy(full)
    for node in (2, 3, 4):
        remove(problem.arrays, less, NODE(node))
    colony = Colony(problem, less, 1, replace(COLD_SELECTION, scouts=0.0))
    colony.fly(0.0, 0.1, 1)
    hot = colony.temperature(0.0)
    copy_into(full, colony.best)
    colony.fly(0.1, 0.2, 1)
    assert colony._coolings[0].begin == 0.1  # not 0: new coolings, for the rest of the budget
    colony.routes.next[:] = 0
    colony._all_served(0.5)
    assert (colony.routes.next == full.next).all()
    assert colony.temperature(0.5) < 0.1 * hot
    assert [each.begin for each in colony._coolings] == pytest.approx([0.5, 0.725, 0.96])
    assert colony.temperature(1.0) == pytest.approx(0.1 * problem.scale, rel=0.2)


def test_the_best_tasks_are_chosen_where_some_must_be_left_out():
    value = 0.0
    for seed in range(2):
        uavs, tasks = fleet_and_tasks(100, reach=2000.0, seed=seed)
        chosen = plan(uavs, tasks, budget=60.0, max_iterations=20_000, route_end='home')
        check(chosen, uavs, tasks)
        value += chosen.value
    assert value > 6000.0  # the search for tasks that can all be served finds 5712
