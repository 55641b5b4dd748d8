# SPDX-License-Identifier: Apache-2.0
"""What holds for every plan, whoever made it."""
import math

import numpy as np
import pytest

from uav_task_alloc import Task, Uav
from uav_task_alloc.objective import Weights, excess, fit
from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.problem import Limits, Rules, make_problem


def make(uavs, tasks, seed=1, reach=math.inf):
    """UAVs and tasks at random in a square kilometre."""
    rng = np.random.default_rng(seed)
    place = lambda z: (*rng.uniform(0.0, 1000.0, 2), z)  # noqa: E731
    return ([Uav(f'u{i}', place(0.0), reach) for i in range(uavs)],
            [Task(f't{i}', place(30.0), value=1.0 + i % 3) for i in range(tasks)])


def problem(uavs, tasks, seed=1, reach=1e9, **rules):
    """The same as the kernels take it."""
    return make_problem(*make(uavs, tasks, seed, reach), {}, Limits(), Rules(**rules))


def some_routes(made, rng, leave=0):
    """Tasks at random on UAVs at random, all but a few."""
    a, routes = made.arrays, of.empty_routes(made.arrays)
    for t in rng.permutation(np.arange(a.uavs, a.ends))[leave:]:
        of.insert(a, routes, of.NODE(t), routes.prev[a.ends + rng.integers(a.uavs)])
    of.total(a, routes)
    return routes


def check(made, uavs, tasks, hard=True):
    """Every task is flown once or explained; figures are what the legs say."""
    flown = [task_id for row in made.routes.values() for task_id in row]
    assert sorted([*flown, *made.unassigned]) == sorted(task.id for task in tasks)
    assert set(made.routes) == {uav.id for uav in uavs}
    assert all(made.unassigned.values())
    value = {task.id: task.value for task in tasks}
    assert made.value == pytest.approx(sum(value[task_id] for task_id in flown))
    lengths = [made.route(uav.id).distance for uav in uavs]
    assert made.distance == pytest.approx(sum(lengths))
    assert made.penalty == pytest.approx(excess(uavs, lengths), abs=1e-5)
    assert made.fit == fit(made.distance, made.value, made.penalty, Weights())
    for uav in uavs:
        row = made.routes[uav.id]
        assert len(made.legs[uav.id]) == len(row) + (made.returns and bool(row))
        if hard:
            assert made.route(uav.id).distance <= uav.range + 1e-6
    for task in tasks:
        for uav in uavs:
            if task.id in made.routes[uav.id]:
                assert task.required_capabilities <= uav.capabilities
                assert task.allowed_uavs is None or uav.id in task.allowed_uavs
