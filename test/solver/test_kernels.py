# SPDX-License-Identifier: Apache-2.0
"""The kernels: sums stay consistent, undo restores the routes, neighbours are the nearest."""
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st
from plan_checks import make, random_problem

from uav_task_alloc.model import Task, ThreatZone, Uav
from uav_task_alloc.solver.insertion import best_place, insert_cheapest_first
from uav_task_alloc.solver.neighbours import find_nearest
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.rng import below, rng_state, uniform
from uav_task_alloc.solver.routes import (
    DISTANCE,
    copy,
    empty_routes,
    insert,
    leg_length,
    total_cost,
    update_sums,
)
from uav_task_alloc.solver.ruin import empty_log, recreate, ruin, undo

NO_NEW = np.empty(0, np.int64)


def lengths(problem, routes):
    """Route lengths recomputed from the legs."""
    a, sums = problem.arrays, []
    for u in range(a.uavs):
        node, length = u, 0.0
        while node < a.ends:
            length += leg_length(a, node, routes.next[node])
            node = routes.next[node]
        sums.append(length)
    return sums


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2 ** 32), tasks=st.integers(1, 40), returns=st.booleans())
@example(seed=785, tasks=30, returns=True)
def test_sums_stay_consistent_and_undo_restores_the_routes(seed, tasks, returns):
    problem = random_problem(3, tasks, seed, returns=returns)
    routes, rng, log = empty_routes(problem.arrays), rng_state(seed), empty_log(problem.arrays)
    insert_cheapest_first(problem.arrays, routes, rng)
    for i in range(20):
        before = copy(routes)
        log.last_ruined[:] = -1
        ruin(problem.arrays, routes, log, 10.0, i, rng)
        recreate(problem.arrays, routes, log, math.inf, rng)
        assert routes.length == pytest.approx(lengths(problem, routes), abs=1e-6)
        assert routes.sums[DISTANCE] == pytest.approx(sum(lengths(problem, routes)), abs=1e-6)
        nodes = slice(problem.arrays.uavs, problem.arrays.ends)
        assert routes.tasks.sum() == (routes.uav_of[nodes] >= 0).sum()
        if i % 2:
            undo(problem.arrays, routes, log)
            assert (routes.uav_of == before.uav_of).all()
            flown = before.uav_of >= 0  # what is in no route has no next node
            assert (routes.next == before.next)[flown].all()
            assert routes.length == pytest.approx(before.length, abs=1e-6)


@pytest.mark.parametrize(('reach', 'hard'), [(1e9, True), (4000.0, True), (2500.0, False)])
def test_a_round_that_is_given_up_would_not_have_cost_less_than_the_limit(reach, hard):
    problem = random_problem(4, 60, 5, reach, returns=True, hard=hard)
    a, rng = problem.arrays, rng_state(5)
    routes, log = empty_routes(a), empty_log(a)
    insert_cheapest_first(a, routes, rng)
    update_sums(a, routes)
    given_up = 0
    for _ in range(300):
        before, chance, ends = total_cost(a, routes), rng.copy(), []
        for limit in (before, math.inf):
            rng[:] = chance
            log.last_ruined[:] = -1
            ruin(a, routes, log, 10.0, 1, rng)
            recreate(a, routes, log, limit, rng)
            served = int((routes.uav_of[a.uavs:a.ends] >= 0).sum())
            ends.append((served, total_cost(a, routes)))
            if limit < math.inf or ends[-1][1] >= before:
                undo(a, routes, log)
                update_sums(a, routes)
        given_up += ends[0] != pytest.approx(ends[1])
        assert ends[0] == pytest.approx(ends[1]) or ends[1][1] >= before - 1e-6
    assert given_up > 30


@pytest.mark.parametrize('n', [1, 2, 7, 200])
def test_neighbours_are_the_nearest(n):
    xyz = np.random.default_rng(n).uniform(0.0, 100.0, (n, 3))
    k = min(10, n - 1)
    lengths = np.linalg.norm(xyz[:, None] - xyz[None], axis=2) + np.diag(np.full(n, np.inf))
    found = np.full((n, k), -1)
    squares = find_nearest(xyz, found, NO_NEW)
    for i in range(n):
        assert lengths[i, found[i]] == pytest.approx(np.sort(lengths[i])[:k])
        assert squares[i] == pytest.approx(np.sort(lengths[i])[:k] ** 2)


def test_neighbours_of_coincident_points_are_found():
    found = np.full((3, 2), -1)
    find_nearest(np.zeros((3, 3)), found, NO_NEW)
    assert {tuple(sorted(row)) for row in found.tolist()} == {(0, 1), (0, 2), (1, 2)}


@pytest.mark.parametrize('zones', [(), (ThreatZone.cylinder('z', (500.0, 500.0), 200.0),)])
def test_neighbours_are_the_same_with_and_without_those_of_an_earlier_problem(zones):
    rng, limits = np.random.default_rng(3), Limits(zones)
    uavs, tasks = make(3, 60)
    known = None
    for event in range(12):
        tasks = [task for task in tasks if rng.uniform() > 0.05]  # ended
        tasks += [Task(f'e{event}-{i}', (*rng.uniform(0.0, 1000.0, 2), 0.0)) for i in range(4)]
        tasks[7] = replace(tasks[7], position=(*rng.uniform(0.0, 1000.0, 2), 0.0))
        rng.shuffle(tasks)
        known = make_problem(uavs, tasks, {}, limits, Rules(), known)
        fresh = make_problem(uavs, tasks, {}, limits, Rules())
        assert known.arrays.near_length == pytest.approx(fresh.arrays.near_length)
        assert {*map(frozenset, known.arrays.near.tolist())} == {
            *map(frozenset, fresh.arrays.near.tolist())}
        assert known.arrays.starts.tolist() == fresh.arrays.starts.tolist()


@pytest.mark.parametrize('hard', [True, False])
def test_starts_out_of_range_are_no_neighbours_where_ranges_are_hard(hard):
    uavs, tasks = make(12, 30)
    uavs = [replace(uav, range=400.0 if i % 2 else 0.0) for i, uav in enumerate(uavs)]
    a = make_problem(uavs, tasks, {}, Limits(), Rules(hard=hard)).arrays
    for i in range(len(tasks)):
        legs = np.array([leg_length(a, u, a.uavs + i) for u in range(a.uavs)])
        near = np.argsort(legs)
        near = [u for u in near if not hard or legs[u] <= a.range_left[u]][:a.starts.shape[1]]
        got = a.start_length[i] < np.inf
        assert a.starts[i][got].tolist() == near
        assert a.start_length[i][got] == pytest.approx(legs[near])


def test_few_searches_start_from_a_task_that_a_zone_contains():
    uavs, tasks = make(2, 200, 3, 1e9)
    around = ThreatZone.cylinder('around', tasks[7].position[:2], 5.0)
    problem = make_problem(uavs, tasks, {}, Limits((around,)), Rules())
    routes = empty_routes(problem.arrays)
    insert_cheapest_first(problem.arrays, routes, rng_state(1))
    slots = problem.distances._table.slots(np.array([task.position for task in tasks]))
    known = ~np.isnan(problem.distances._table.cells[slots[7]])
    assert known.sum() < 60  # from neighbours
    assert routes.uav_of[problem.arrays.uavs + 7] < 0


def test_legs_past_zones_to_places_that_are_too_far_are_not_looked_up():
    rng = np.random.default_rng(6)
    uavs = Uav('here', (0.0, 0.0, 0.0)), Uav('there', (9000.0, 0.0, 0.0))
    tasks = [Task(f't{k}', (x, *rng.uniform(0.0, 500.0, 2))) for k in range(80)
             for x in rng.uniform(0.0, 500.0, 1) + 9000.0 * (k % 2)]
    zone = ThreatZone.cylinder('z', (4000.0, 250.0), 100.0)
    problem = make_problem(uavs, tasks, {}, Limits((zone,)), Rules())
    a, routes = problem.arrays, empty_routes(problem.arrays)
    for node in range(a.uavs + 1, a.ends):
        insert(a, routes, node, routes.prev[a.ends + (node - a.uavs) % 2])
    place, cost = best_place(a, routes, a.uavs)
    assert routes.uav_of[place] == 0
    assert cost < 500.0
    far = np.arange(a.uavs + 3, a.ends, 2)
    assert np.isnan(problem.distances.known_lengths(np.full(far.size, a.uavs), far)).all()


def test_random_numbers_are_uniform_and_repeatable():
    state = rng_state(5)
    drawn = [uniform(state) for _ in range(4000)]
    assert 0.48 < np.mean(drawn) < 0.52
    assert min(drawn) >= 0.0
    assert max(drawn) < 1.0
    same = rng_state(5)
    assert drawn[0] == uniform(same)
    assert {below(same, 3) for _ in range(100)} == {0, 1, 2}


LOADED = """
import sys
from numba.core.dispatcher import Dispatcher
from uav_task_alloc import Task, ThreatZone, Uav
from uav_task_alloc.solver import solve

def loaded():
    return {(name, each): len(kernel.signatures) for name, module in sys.modules.items()
            if name.startswith('uav_task_alloc.') for each, kernel in vars(module).items()
            if isinstance(kernel, Dispatcher)}

zones = [ThreatZone.hemisphere('dome', (30.0, 5.0, 0.0), 9.0),
         ThreatZone.polygon('prism', [(60.0, -9.0), (70.0, -9.0), (65.0, 30.0)], z_max=90.0)]
for given in ([], zones):
    solve.load_kernels('chain_q', bool(given))
    before = loaded()
    solve.plan([Uav('u', (0.0, 0.0, 0.0), 900.0), Uav('v', (50.0, 0.0, 0.0), 900.0)],
               [Task(f't{i}', (10.0 * i, 9.0 * (i % 2), 4.0)) for i in range(12)], given,
               budget=0.05, route_end='home')
    print([name for name, count in loaded().items() if count > before.get(name, 0)])
"""


def test_no_kernel_is_left_to_be_loaded_within_a_budget():
    done = subprocess.run([sys.executable, '-c', LOADED], capture_output=True, text=True,
                          check=True)
    assert done.stdout.splitlines() == ['[]', '[]'], done.stdout
