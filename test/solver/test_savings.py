# SPDX-License-Identifier: Apache-2.0
"""First routes of UAVs that share a base: tasks joined where that saves most."""
import math
from itertools import pairwise

import numpy as np
import pytest
from plan_checks import check

from uav_task_alloc import Task, ThreatZone, Uav, plan
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import DISTANCE, EXCESS, VALUE
from uav_task_alloc.solver.savings import joined_routes, offer_first
from uav_task_alloc.solver.warm import repair
from uav_task_alloc.study.instances import make_instance

BASE = 0.0, 0.0, 0.0
CAMERA = frozenset({'camera'})


def fleet(count, reach=math.inf, base=BASE, name='u'):
    return [Uav(f'{name}{i}', base, reach) for i in range(count)]


def at(**points):
    return [Task(name, (*point, 0.0)) for name, point in points.items()]


def routes_of(uavs, tasks, zones=(), **rules):
    """Task ids of each route that is not empty, and the sums."""
    problem = make_problem(uavs, tasks, {}, Limits(zones), Rules(**rules))
    routes = joined_routes(problem)
    if routes is None:
        return None
    found, ends = [], problem.arrays.ends
    for u in range(len(uavs)):
        node, row = int(routes.next[u]), []
        while node < ends:
            row.append(tasks[node - len(uavs)].id)
            node = int(routes.next[node])
        found += [row] if row else []
    return found, routes.sums


@pytest.mark.parametrize('returns', [False, True])
def test_tasks_behind_each_other_are_one_route(returns):
    tasks = at(far=(300.0, 0.0), north=(0.0, 200.0), near=(100.0, 0.0), top=(0.0, 210.0))
    rows, sums = routes_of(fleet(4, 650.0), tasks, returns=returns)
    assert sorted(sorted(row) for row in rows) == [['far', 'near'], ['north', 'top']]
    assert sums[DISTANCE] == (1020.0 if returns else 510.0)


@pytest.mark.parametrize('uavs', [
    [], fleet(1), [Uav('u', BASE), Uav('v', (1.0, 0.0, 0.0))],
    [Uav('u', BASE, 500.0), Uav('v', BASE, 600.0)]])
def test_where_no_two_uavs_are_alike_there_are_none(uavs):
    assert routes_of(uavs, at(a=(100.0, 0.0), b=(110.0, 0.0))) is None


def test_without_neighbours_there_are_none():
    assert routes_of(fleet(2), at(a=(100.0, 0.0))) is None
    assert routes_of(fleet(2), []) is None


def test_of_more_routes_than_uavs_the_most_valuable_are_flown():
    tasks = [Task(f't{value}{i}', (100.0 * math.cos(turn), 100.0 * math.sin(turn), float(i)),
                  value=float(value))
             for value, turn in ((1, 0.0), (5, 2.0), (3, 4.0)) for i in range(2)]
    rows, sums = routes_of(fleet(2, 110.0), tasks)
    assert {row[0][:2] for row in rows} == {'t5', 't3'}
    assert sums[VALUE] == 16.0


def test_each_base_has_the_tasks_that_it_is_nearest_to():
    uavs = fleet(2) + fleet(2, base=(1000.0, 0.0, 0.0), name='v')
    tasks = at(a=(50.0, 0.0), b=(60.0, 0.0), c=(940.0, 0.0), d=(930.0, 0.0))
    rows, _ = routes_of(uavs, tasks)
    assert sorted(rows) == [['a', 'b'], ['c', 'd']]


def by_hand(points, reach, returns):
    """Lengths of routes joined over all pairs, as Clarke and Wright describe it."""
    out = np.hypot(*points.T)
    back = out if returns else 0.0 * out
    rows = {i: [i] for i in range(len(points))}
    of = list(range(len(points)))

    def flown(row):
        return out[row[0]] + back[row[-1]] + sum(math.dist(points[i], points[j])
                                                 for i, j in pairwise(row))

    pairs = [(back[i] + out[j] - math.dist(points[i], points[j]), i, j)
             for i in rows for j in rows if i != j]
    for saved, i, j in sorted(pairs, key=lambda pair: -pair[0]):
        first, then = rows[of[i]], rows[of[j]]
        if saved > 0.0 and first is not then and first[-1] == i and then[0] == j and (
                flown(first + then) <= reach + 1e-7):
            del rows[of[j]]
            first += then
            for each in then:
                of[each] = of[i]
    return sorted(flown(row) for row in rows.values())


@pytest.mark.parametrize('returns', [False, True])
@pytest.mark.parametrize('seed', range(8))
def test_the_routes_are_those_of_clarke_and_wright(seed, returns):
    points = np.random.default_rng(seed).uniform(-500.0, 500.0, (12, 2))
    reach = 3000.0 if returns else 1500.0
    expected = by_hand(points, reach, returns)
    tasks = [Task(f't{i}', (x, y, 0.0)) for i, (x, y) in enumerate(points)]
    rows, sums = routes_of(fleet(12, reach), tasks, returns=returns)
    assert len(rows) == len(expected) > 1
    assert sums[DISTANCE] == pytest.approx(sum(expected))


@pytest.mark.parametrize('seed', range(6))
def test_routes_keep_to_ranges_capabilities_and_zones(seed):
    rng = np.random.default_rng(seed)
    uavs = fleet(3, 900.0) + [Uav('w0', (400.0, 0.0, 0.0), 700.0, capabilities=CAMERA),
                              Uav('w1', (400.0, 0.0, 0.0), 700.0, capabilities=CAMERA)]
    tasks = [Task(f't{i}', (*rng.uniform(-600.0, 600.0, 2), 0.0),
                  required_capabilities=CAMERA if i % 4 == 0 else frozenset())
             for i in range(40)]
    zones = tuple(ThreatZone.cylinder(f'z{i}', tuple(rng.uniform(-500.0, 500.0, 2)), 60.0)
                  for i in range(3))
    for some in ((), zones):
        rows, sums = routes_of(uavs, tasks, some, returns=True)
        assert sums[EXCESS] == 0.0
        flown = [name for row in rows for name in row]
        assert len(set(flown)) == len(flown) == sums[VALUE] > 0
    check(plan(uavs, tasks, max_iterations=0, route_end='home'), uavs, tasks)
    filming = [row for row in rows if any(int(name[1:]) % 4 == 0 for name in row)]
    assert len(filming) <= 2  # what needs a camera is in the routes of the two that have one


def test_the_better_of_auction_and_joined_routes_is_offered():
    for one_base in (True, False):
        instance = make_instance(50, 500, 3, one_base)
        problem = make_problem(instance.uavs, instance.tasks, {}, Limits(), Rules())
        recorder = Recorder(lambda: 0.0, 0.0, 1.0, problem=problem)
        offer_first(recorder)
        auction = repair(problem, {}).sums
        assert (recorder.best.sums[DISTANCE] < 0.9 * auction[DISTANCE]) == one_base
        assert recorder.best.sums[VALUE] >= auction[VALUE] > 490.0


def test_no_routes_are_joined_after_the_end_of_the_budget():
    instance = make_instance(50, 500, 3, True)
    problem = make_problem(instance.uavs, instance.tasks, {}, Limits(), Rules())
    times = iter((0.0, 2.0, 2.0))  # the first plan is there after 2 s of 1 s
    recorder = Recorder(lambda: next(times, 2.0), 0.0, 1.0, problem=problem)
    offer_first(recorder)
    assert recorder.best.sums[DISTANCE] == repair(problem, {}).sums[DISTANCE]
