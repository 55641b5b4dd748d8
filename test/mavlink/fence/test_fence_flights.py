# SPDX-License-Identifier: Apache-2.0
"""Flights with fences that act, over a bad link, while zones come, move and go."""
import random
from dataclasses import replace

import pytest
from fence_bench import FenceBench
from test_failsafe_returns import HEIGHT, scene

from uav_task_alloc import Uav, plan
from uav_task_alloc.mavlink.mission.files import list_for_route
from uav_task_alloc.model import Route

ACTING = {'ardupilot': (('FENCE_ENABLE', 1.0), ('FENCE_ACTION', 1.0)),
          'px4': (('GF_ACTION', 3.0),)}


def planned(bench, tasks, zones, revision, seed):
    """A new list around the zones from where the vehicle is."""
    x, y, z = bench.vehicle.flight.body.position
    left = [task for task in tasks if task.id not in bench.completed()]
    uav = Uav('uav_1', (x, y, max(z, HEIGHT)), home=(0.0, 0.0, 0.0))
    result = plan([uav], left, zones, budget=0.05, seed=seed, clearance=10.0, max_iterations=30)
    route = Route('uav_1', result.routes['uav_1'], result.legs['uav_1'])
    bench.assign(replace(list_for_route(route, {task.id: task for task in left}),
                         revision=revision))
    return set(result.unassigned)


@pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
@pytest.mark.parametrize('seed', range(3))
def test_a_fence_that_acts_never_ends_a_flight_whose_zones_change(kind, seed):
    rng = random.Random(seed)
    zones, tasks = scene(rng)
    bench = FenceBench(kind, zones=zones[:4], fences='require', seed=seed, loss=0.1,
                       delay=(0.0, 0.2), config={'parameters': ACTING[kind],
                                                 'position': (0.0, 0.0, 0.0)}).discover()
    unassigned = planned(bench, tasks, zones[:4], 1, seed)
    for revision in range(2, 5):
        bench.run(limit=rng.uniform(20.0, 40.0))
        shown = rng.sample(zones, rng.randint(1, len(zones)))
        bench.set_zones(*shown)
        unassigned = planned(bench, tasks, shown, revision, seed)
    wanted = {task.id for task in tasks} - unassigned
    assert bench.run(lambda: wanted <= set(bench.completed()), 900.0), (
        bench.completed(), bench.fence.text, bench.executor().sender.waits_for)
    assert not [e for e in bench.truth[1] if e.name == 'failsafe']
    assert not bench.both_busy
    assert bench.run(lambda: bench.fence.verified, 200.0)
