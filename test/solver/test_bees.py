# SPDX-License-Identifier: Apache-2.0
"""The bee colony: repeatable, rank bidding, learning by id."""
from itertools import pairwise

import numpy as np
import pytest
from plan_checks import check, make

from uav_task_alloc import plan
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.solver.bidding import Bidding
from uav_task_alloc.solver.colony import COOLINGS, RECOMBINED_COST, Colony, ColonyParams
from uav_task_alloc.solver.pool import collect
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.routes import (
    DISTANCE,
    NODE,
    UNASSIGNED_COST,
    clear,
    copy,
    empty_routes,
    remove,
)
from uav_task_alloc.solver.scouts import Scouts
from uav_task_alloc.solver.tables import INITIAL_Q, fresh_tables, to_learnt
from uav_task_alloc.solver.warm import repair


def problem_of(uavs, tasks):
    return make_problem(uavs, tasks, {}, Limits(), Rules())


@pytest.fixture(scope='module')
def problem():
    return problem_of(*make(2, 9))


def test_a_seed_and_a_number_of_iterations_give_the_same_plan():
    uavs, tasks = make(5, 200)
    first, second, other = (plan(uavs, tasks, budget=60.0, max_iterations=3000, seed=seed)
                            for seed in (4, 4, 5))
    assert first.routes == second.routes
    assert first.distance == second.distance
    assert other.routes != first.routes


def test_two_threads_give_a_valid_plan():
    uavs, tasks = make(5, 60, reach=1500.0)
    result = plan(uavs, tasks, budget=60.0, max_iterations=3000, threads=2)
    check(result, uavs, tasks)


def test_the_search_improves_on_the_construction():
    uavs, tasks = make(5, 60)
    built = plan(uavs, tasks, budget=60.0, max_iterations=0)
    assert plan(uavs, tasks, budget=60.0, max_iterations=5000).distance < 0.97 * built.distance


def test_temperatures_fall_twice_and_then_stay_constant(monkeypatch, problem):
    colony = Colony(problem, repair(problem, {}), 1, ColonyParams(scouts=0.0))
    calls, seen = [], []
    monkeypatch.setattr(colony, '_intensify', calls.append)
    for begin, end in pairwise([*(each.begin for each in COOLINGS), 1.0]):
        colony.fly(max(begin, 1e-6), 0.5 * (begin + end), 10)
        seen += [colony.temperature(share) / problem.scale
                 for share in (begin, 0.5 * (begin + end), end)]
        colony.fly(0.5 * (begin + end), end, 10)
    assert seen == pytest.approx([3.0, 0.3 ** 0.5, 0.1, 1.0, 0.1 ** 0.5, 0.1, 0.1, 0.1, 0.1])
    assert len(calls) == 2  # at the start of each phase but the first


def test_intensification_continues_from_the_best(problem):
    start = repair(problem, {})
    colony = Colony(problem, start, 1, ColonyParams())
    clear(colony.arrays, colony.routes)
    colony.arrays.unassigned_cost[:] *= 2.0
    colony._intensify(1e6)
    assert (colony.routes.next == start.next).all()
    assert colony.routes.sums == pytest.approx(start.sums)


@pytest.mark.parametrize('share', [0.5, 0.2])  # of what the way to a task costs, of its first cost
def test_a_combination_that_serves_more_tasks_is_found_at_a_low_cost_of_those_left_out(share):
    problem = problem_of(*make(2, 9))
    a, full = problem.arrays, repair(problem, {})
    less = copy(full)
    remove(a, less, NODE(a.uavs + 3))
    way = float(full.sums[DISTANCE] - less.sums[DISTANCE])
    a.unassigned_cost[:] = share * way
    colony = Colony(problem, less, 1, ColonyParams())
    collect(a, full, colony._pool)
    colony._intensify(1e6)
    served = share * RECOMBINED_COST > 1.0
    for routes in (colony.best, colony.routes):
        assert routes.tasks.sum() == 8 + served
        assert routes.sums[UNASSIGNED_COST] == pytest.approx((1 - served) * share * way)


def test_scouts_that_learn_beat_scouts_that_do_not():
    problem = problem_of(*make(4, 40))
    lengths = {}
    for learning in (True, False):
        swarm, best = Scouts(problem, problem.arrays, rng_state(3), None, learning), empty_routes(
            problem.arrays)
        for _ in range(60):
            swarm.fly(best)
        assert (best.uav_of >= 0).all()
        lengths[learning] = best.sums[DISTANCE]
    assert lengths[True] < 0.95 * lengths[False]


def test_tables_are_reused_by_id():
    uavs, tasks = make(3, 20)
    before = problem_of(uavs, tasks)
    tables = fresh_tables(before)
    tables.task[5, :] = np.arange(before.arrays.near.shape[1]) + 1.0
    tables.start[2, 5] = 9.0
    after = problem_of(uavs[::-1], tasks[:2:-1])
    reused, row = fresh_tables(after, to_learnt(before, tables)), after.index['t5']
    assert reused.start[0, row] == 9.0
    for k, node in enumerate(after.arrays.near[row]):
        old = before.index[after.tasks[node - 3].id] + 3
        place, = np.flatnonzero(before.arrays.near[5] == old)
        assert reused.task[row, k] == place + 1.0
    assert (reused.task[after.index['t7']] == INITIAL_Q).all()


def test_kinds_with_more_gain_get_more_flights_and_none_gets_none():
    bids = Bidding({'a': 0.2, 'b': 0.2, 'c': 0.1})
    assert bids.shares() == {'a': 0.2, 'b': 0.2, 'c': 0.1}
    flights = dict.fromkeys('abc', 0)
    for _ in range(500):
        kind = bids.next({'a': 1.0, 'b': 1.0, 'c': 1.0})
        flights[kind] += 1
        bids.pay(kind, 1.0, {'a': 1.0, 'b': 5.0, 'c': 0.0}[kind])
    assert flights['b'] > flights['a'] > flights['c'] > 20


def test_the_paper_solver_refuses_more_tasks_than_its_tables_hold():
    uavs, tasks = make(2, 201)
    with pytest.raises(InvalidValue, match='tasks = 201: expected at most 200'):
        plan(uavs, tasks, solver='paper_chain_q')
