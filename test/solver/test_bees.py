# SPDX-License-Identifier: Apache-2.0
"""The bees: repeatable, bidding for flights, learning by id."""
from itertools import pairwise

import numpy as np
import pytest
from plan_checks import check, make

from uav_task_alloc import plan
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.bidding import Bidding
from uav_task_alloc.solver.colony import PHASES, Colony, ColonyParams
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.rng import chance
from uav_task_alloc.solver.scouts import Scouts
from uav_task_alloc.solver.tables import FIRST, fresh_tables, keep
from uav_task_alloc.solver.warm import repaired


def problem_of(uavs, tasks):
    return make_problem(uavs, tasks, {}, Limits(), Rules())


PROBLEM = problem_of(*make(2, 9))


def test_a_seed_and_a_number_of_iterations_give_the_same_plan():
    uavs, tasks = make(5, 200)
    first, second, other = (plan(uavs, tasks, budget=60.0, max_iterations=3000, seed=seed)
                            for seed in (4, 4, 5))
    assert first.routes == second.routes
    assert first.distance == second.distance
    assert other.routes != first.routes


def test_two_threads_give_a_right_plan():
    uavs, tasks = make(5, 60, reach=1500.0)
    made = plan(uavs, tasks, budget=60.0, max_iterations=3000, threads=2)
    check(made, uavs, tasks)


def test_the_search_improves_on_the_construction():
    uavs, tasks = make(5, 60)
    built = plan(uavs, tasks, budget=60.0, max_iterations=0)
    assert plan(uavs, tasks, budget=60.0, max_iterations=5000).distance < 0.97 * built.distance


def test_bees_cool_twice_and_then_stay_cold(monkeypatch):
    colony = Colony(PROBLEM, repaired(PROBLEM, {}), 1, ColonyParams(scouts=0.0))
    home, seen = [], []
    monkeypatch.setattr(colony, '_go_home', home.append)
    for begin, end in pairwise(PHASES):
        colony.fly(max(begin, 1e-6), 0.5 * (begin + end), 10)
        seen += [colony.temperature(share) / PROBLEM.scale
                 for share in (begin, 0.5 * (begin + end), end)]
        colony.fly(0.5 * (begin + end), end, 10)
    assert seen == pytest.approx([3.0, 0.3 ** 0.5, 0.1, 1.0, 0.1 ** 0.5, 0.1, 0.1, 0.1, 0.1])
    assert len(home) == 2  # once where each phase but the first begins


def test_at_home_bees_go_on_from_the_best():
    start = repaired(PROBLEM, {})
    colony = Colony(PROBLEM, start, 1, ColonyParams())
    of.clear(colony.arrays, colony.routes)  # as if they had flown off
    colony.arrays.price[:] *= 2.0
    colony._go_home(1e6)
    assert (colony.routes.next == start.next).all()
    assert colony.routes.sums == pytest.approx(start.sums)


def test_scouts_that_learn_beat_scouts_that_do_not():
    made = problem_of(*make(4, 40))
    lengths = {}
    for learning in (True, False):
        swarm, best = Scouts(made, made.arrays, chance(3), None, learning), of.empty_routes(
            made.arrays)
        for _ in range(60):
            swarm.fly(best)
        assert (best.on >= 0).all()
        lengths[learning] = best.sums[of.DISTANCE]
    assert lengths[True] < 0.95 * lengths[False]


def test_tables_are_found_again_by_id():
    uavs, tasks = make(3, 20)
    before = problem_of(uavs, tasks)
    tables = fresh_tables(before)
    tables.task[5, :] = np.arange(before.arrays.near.shape[1]) + 1.0
    tables.start[2, 5] = 9.0
    after = problem_of(uavs[::-1], tasks[:2:-1])
    again, row = fresh_tables(after, keep(before, tables)), after.index['t5']
    assert again.start[0, row] == 9.0
    for k, node in enumerate(after.arrays.near[row]):
        old = before.index[after.tasks[node - 3].id] + 3
        place, = np.flatnonzero(before.arrays.near[5] == old)
        assert again.task[row, k] == place + 1.0
    assert (again.task[after.index['t7']] == FIRST).all()


def test_who_brings_more_flies_more_and_nobody_is_grounded():
    bids = Bidding({'a': 0.2, 'b': 0.2, 'c': 0.1})
    assert bids.shares() == {'a': 0.2, 'b': 0.2, 'c': 0.1}
    flights = dict.fromkeys('abc', 0)
    for _ in range(500):
        kind = bids.next({'a': 1.0, 'b': 1.0, 'c': 1.0})
        flights[kind] += 1
        bids.pay(kind, 1.0, {'a': 1.0, 'b': 5.0, 'c': 0.0}[kind])
    assert flights['b'] > flights['a'] > flights['c'] > 20


def test_the_paper_solver_refuses_what_its_tables_cannot_hold():
    uavs, tasks = make(2, 201)
    with pytest.raises(InvalidValue, match='tasks = 201: expected at most 200'):
        plan(uavs, tasks, solver='paper_chain_q')
