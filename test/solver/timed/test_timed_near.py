# SPDX-License-Identifier: Apache-2.0
"""Neighbours where windows count are the nearest that may be adjacent; far places cost no time."""
import math

import numpy as np
import pytest

from uav_task_alloc.model import Task, ThreatZone, Uav
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.timed.insertion import insert_task, place_anywhere
from uav_task_alloc.solver.timed.problem import (
    WINDOW_NEIGHBOURS,
    empty_timed_routes,
    make_timed,
)
from uav_task_alloc.solver.timed.visits import NO_VISIT

SPEED = 10.0
UAV = Uav('u', (0.0, 0.0, 0.0), cruise_speed=SPEED)


def problem_of(uavs, tasks, zones=()):
    return make_timed(make_problem(uavs, tasks, {}, Limits(zones), Rules(), near=False), {})


def some_tasks(count, seed, paths, step):
    """Tasks with windows, at multiples of `step` [m], so that many are as far as others."""
    rng = np.random.default_rng(seed)

    def point():
        return tuple((step * np.round(rng.uniform(0.0, 2000.0, 3) / step)).tolist())
    tasks = []
    for k in range(count):
        here, there = point(), point()
        latest = rng.choice([math.inf, rng.uniform(1.0, 300.0)])
        path = (here, there) if paths and k % 3 == 0 and here != there else ()
        tasks.append(Task(f't{k}', here, latest=latest, path=path, service_time=5.0))
    return tasks


def nearest(tasks, i):
    """Indices and distances of the neighbours, found by comparing all."""
    def ends(task):
        return np.array([task.position, task.end])

    def may_follow(first, then, seconds):
        return first.service_time + along(first) + seconds <= then.latest

    def along(task):
        return math.dist(task.position[:2], task.end[:2]) / SPEED if task.path else 0.0
    found = []
    for j, other in enumerate(tasks):
        apart = ends(tasks[i])[:, None] - ends(other)[None]
        metres = np.sqrt((apart ** 2).sum(axis=2)).min()
        seconds = np.sqrt((apart[..., :2] ** 2).sum(axis=2)).min() / SPEED
        one, two = tasks[i], other
        # a task without an earliest time may begin at any
        if j != i and (one.earliest == -math.inf or may_follow(one, two, seconds)
                       or may_follow(two, one, seconds)):
            found.append((metres, j))
    return sorted(found)[:WINDOW_NEIGHBOURS]


@pytest.mark.parametrize('paths', [False, True])
@pytest.mark.parametrize(('count', 'step'), [(2, 1.0), (90, 1e-6), (300, 250.0), (300, 1e-6)])
def test_neighbours_are_the_nearest_and_of_those_as_near_the_first(count, step, paths):
    tasks = some_tasks(count, 3, paths, step)
    a = problem_of([UAV], tasks).arrays
    for i in range(0, count, 7):
        expected = nearest(tasks, i)
        assert a.near_count[i] == len(expected)
        kept = slice(0, len(expected))
        assert (a.near[i, kept] - a.uavs).tolist() == [j for _, j in expected]
        assert a.near_length[i, kept] == pytest.approx([metres for metres, _ in expected])


def test_legs_past_zones_to_places_that_are_too_far_are_not_looked_up():
    rng = np.random.default_rng(6)
    uavs = UAV, Uav('there', (9000.0, 0.0, 0.0), cruise_speed=SPEED)
    tasks = [Task(f't{k}', (x + 9000.0 * (k % 2), y, 0.0), latest=1e5)
             for k, (x, y) in enumerate(rng.uniform(0.0, 500.0, (80, 2)))]
    problem = problem_of(uavs, tasks, (ThreatZone.cylinder('z', (4000.0, 250.0), 100.0),))
    a = problem.arrays
    routes = empty_timed_routes(a)
    for node in range(a.uavs + 1, a.ends):
        u = (node - a.uavs) % 2
        insert_task(a, routes, node, int(routes.link[a.ends + u, 1]), NO_VISIT)
    place, _, cost = place_anywhere(a, routes, a.uavs)
    assert place == 0 or (place - a.uavs) % 2 == 0
    assert cost < 500.0
    far = np.arange(a.uavs + 3, a.ends, 2)
    known = problem.base.distances.known_lengths(np.full(far.size, a.uavs), far)
    assert np.isnan(known).all()
