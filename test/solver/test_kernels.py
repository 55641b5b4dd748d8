# SPDX-License-Identifier: Apache-2.0
"""The kernels: sums stay true, undo undoes, neighbours are the nearest."""
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from plan_checks import make, problem

from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.insertion import cheapest_first
from uav_task_alloc.solver.neighbours import nearest
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.rng import below, chance, uniform
from uav_task_alloc.solver.ruin import empty_log, recreate, ruin, undo

NOBODY = np.empty(0, np.int64)


def lengths(made, routes):
    """Route lengths summed anew from the points."""
    a, found = made.arrays, []
    for u in range(a.uavs):
        node, length = u, 0.0
        while node < a.ends:
            length += of.step(a, node, routes.next[node])
            node = routes.next[node]
        found.append(length)
    return found


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2 ** 32), tasks=st.integers(1, 40), returns=st.booleans())
def test_sums_stay_true_and_undo_undoes(seed, tasks, returns):
    made = problem(3, tasks, seed, returns=returns)
    routes, rng, log = of.empty_routes(made.arrays), chance(seed), empty_log(made.arrays)
    cheapest_first(made.arrays, routes, rng)
    for i in range(20):
        before = of.twin(routes)
        log.hit[:] = -1
        ruin(made.arrays, routes, log, 10.0, i, rng)
        recreate(made.arrays, routes, log, rng)
        assert routes.length == pytest.approx(lengths(made, routes), abs=1e-6)
        assert routes.sums[of.DISTANCE] == pytest.approx(sum(lengths(made, routes)), abs=1e-6)
        assert routes.tasks.sum() == (routes.on[made.arrays.uavs:made.arrays.ends] >= 0).sum()
        if i % 2:
            undo(made.arrays, routes, log)
            assert (routes.next == before.next).all()
            assert routes.length == pytest.approx(before.length, abs=1e-6)


@pytest.mark.parametrize('n', [1, 2, 7, 200])
def test_neighbours_are_the_nearest(n):
    xyz = np.random.default_rng(n).uniform(0.0, 100.0, (n, 3))
    k = min(10, n - 1)
    ways = np.linalg.norm(xyz[:, None] - xyz[None], axis=2) + np.diag(np.full(n, np.inf))
    found = np.full((n, k), -1)
    squares = nearest(xyz, found, NOBODY)
    for i in range(n):
        assert ways[i, found[i]] == pytest.approx(np.sort(ways[i])[:k])
        assert squares[i] == pytest.approx(np.sort(ways[i])[:k] ** 2)


def test_neighbours_of_coincident_points_are_found():
    found = np.full((3, 2), -1)
    nearest(np.zeros((3, 3)), found, NOBODY)
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
        anew = make_problem(uavs, tasks, {}, limits, Rules())
        assert known.arrays.near_length == pytest.approx(anew.arrays.near_length)
        assert {*map(frozenset, known.arrays.near.tolist())} == {
            *map(frozenset, anew.arrays.near.tolist())}
        assert known.arrays.starts.tolist() == anew.arrays.starts.tolist()


@pytest.mark.parametrize('hard', [True, False])
def test_starts_whose_range_does_not_get_there_are_no_neighbours_where_ranges_are_hard(hard):
    uavs, tasks = make(12, 30)
    uavs = [replace(uav, range=400.0 if i % 2 else 0.0) for i, uav in enumerate(uavs)]
    a = make_problem(uavs, tasks, {}, Limits(), Rules(hard=hard)).arrays
    for i in range(len(tasks)):
        ways = np.array([of.step(a, u, a.uavs + i) for u in range(a.uavs)])
        near = np.argsort(ways)
        near = [u for u in near if not hard or ways[u] <= a.reach[u]][:a.starts.shape[1]]
        got = a.start_length[i] < np.inf
        assert a.starts[i][got].tolist() == near
        assert a.start_length[i][got] == pytest.approx(ways[near])


def test_few_ways_are_sought_out_of_a_zone_that_none_leads_into():
    uavs, tasks = make(2, 200, 3, 1e9)
    around = ThreatZone.cylinder('around', tasks[7].position[:2], 5.0)
    made = make_problem(uavs, tasks, {}, Limits((around,)), Rules())
    routes = of.empty_routes(made.arrays)
    cheapest_first(made.arrays, routes, chance(1))
    slots = made.distances._table.slots(np.array([task.position for task in tasks]))
    known = ~np.isnan(made.distances._table.cells[slots[7]])
    assert known.sum() < 60  # from neighbours
    assert routes.on[made.arrays.uavs + 7] < 0


def test_chance_is_even_and_the_same_again():
    state = chance(5)
    drawn = [uniform(state) for _ in range(4000)]
    assert 0.48 < np.mean(drawn) < 0.52
    assert min(drawn) >= 0.0
    assert max(drawn) < 1.0
    again = chance(5)
    assert drawn[0] == uniform(again)
    assert {below(again, 3) for _ in range(100)} == {0, 1, 2}


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
    solve.warm_up('chain_q', bool(given))
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
