# SPDX-License-Identifier: Apache-2.0
"""Places that are too far cost no time: the legs to them are not looked up."""
import numpy as np

from uav_task_alloc.model import Task, ThreatZone, Uav
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.timed.insertion import insert_task, place_anywhere
from uav_task_alloc.solver.timed.problem import empty_timed_routes, make_timed
from uav_task_alloc.solver.timed.visits import NO_VISIT

SPEED = 10.0
UAV = Uav('u', (0.0, 0.0, 0.0), cruise_speed=SPEED)


def problem_of(uavs, tasks, zones=()):
    return make_timed(make_problem(uavs, tasks, {}, Limits(zones), Rules(), near=False), {})


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
