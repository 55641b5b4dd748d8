# SPDX-License-Identifier: Apache-2.0
"""Small random worlds, and checks that hold for every plan of every solver."""
import math

import numpy as np
import pytest

from uav_task_alloc import Task, Uav
from uav_task_alloc.objective import Weights, excess, fit
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.routes import NODE, empty_routes, insert, update_sums


def make(uavs, tasks, seed=1, reach=math.inf):
    """UAVs and tasks at random in a square kilometre."""
    rng = np.random.default_rng(seed)
    place = lambda z: (*rng.uniform(0.0, 1000.0, 2), z)  # noqa: E731
    return ([Uav(f'u{i}', place(0.0), reach) for i in range(uavs)],
            [Task(f't{i}', place(30.0), value=1.0 + i % 3) for i in range(tasks)])


def random_problem(uavs, tasks, seed=1, reach=1e9, **rules):
    """The same world as a problem."""
    return make_problem(*make(uavs, tasks, seed, reach), {}, Limits(), Rules(**rules))


def some_routes(problem, rng, leave=0):
    """Routes of random tasks on random UAVs; `leave` tasks stay unassigned."""
    a, routes = problem.arrays, empty_routes(problem.arrays)
    for t in rng.permutation(np.arange(a.uavs, a.ends))[leave:]:
        insert(a, routes, NODE(t), routes.prev[a.ends + rng.integers(a.uavs)])
    update_sums(a, routes)
    return routes


def check(result, uavs, tasks, hard=True):
    """Every task is served once or has a reason; the sums match the legs."""
    flown = [task_id for row in result.routes.values() for task_id in row]
    assert sorted([*flown, *result.unassigned]) == sorted(task.id for task in tasks)
    assert set(result.routes) == {uav.id for uav in uavs}
    assert all(result.unassigned.values())
    value = {task.id: task.value for task in tasks}
    assert result.value == pytest.approx(sum(value[task_id] for task_id in flown))
    lengths = [result.route(uav.id).distance for uav in uavs]
    assert result.distance == pytest.approx(sum(lengths))
    assert result.penalty == pytest.approx(excess(uavs, lengths), abs=1e-5)
    assert result.fit == fit(result.distance, result.value, result.penalty, Weights())
    for uav in uavs:
        row = result.routes[uav.id]
        assert len(result.legs[uav.id]) == len(row) + (result.returns and bool(row))
        if hard:
            assert result.route(uav.id).distance <= uav.range + 1e-6
    for task in tasks:
        for uav in uavs:
            if task.id in result.routes[uav.id]:
                assert task.required_capabilities <= uav.capabilities
                assert task.allowed_uavs is None or uav.id in task.allowed_uavs
