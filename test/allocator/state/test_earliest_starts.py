# SPDX-License-Identifier: Apache-2.0
"""Which UAV could start a task first: as if each was tried, but few are."""
import random

import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.list_records import ListStop
from uav_task_alloc.allocator.state import earliest_starts
from uav_task_alloc.allocator.state.earliest_starts import EarliestStarts
from uav_task_alloc.allocator.state.stop_times import timed_stops
from uav_task_alloc.model import Leg, Task

UAVS = 40


def fleet(seed):
    """UAVs on the ground and in the air, of different speeds, in a wind; some are switched off."""
    rng, made = random.Random(seed), AllocatorDriver()
    for k in range(UAVS):
        speed = rng.uniform(8.0, 20.0)
        made.uav(f'u{k:02}', rng.uniform(0.0, 5e3), rng.uniform(0.0, 5e3), rng.uniform(0.0, 90.0),
                 standby=rng.random() < 0.5, available=rng.random() < 0.8, cruise_speed=speed,
                 velocity=(speed, 0.0, 0.0), climb_speed=2.5, descent_speed=1.5)
        made.world.flights.wind.add(f'u{k:02}', speed, (speed + 3.0, 2.0), made.now)
    return made


def tasks(seed):
    rng = random.Random(seed)
    for k in range(20):
        place = rng.uniform(0.0, 5e3), rng.uniform(0.0, 5e3), rng.uniform(20.0, 90.0)
        earliest = 1000.0 + rng.uniform(-100.0, 600.0)
        yield Task(f't{k}', place, earliest=earliest, service_time=5.0, allowed_uavs=(
            None if k % 3 else frozenset(f'u{n:02}' for n in rng.sample(range(UAVS), 5))))


@pytest.mark.parametrize('seed', range(5))
def test_the_first_start_is_that_of_the_uav_that_would_be_first_if_each_was_tried(
        seed, monkeypatch):
    made, calls = fleet(seed), []
    world, stamp = made.world, made.now
    starts = EarliestStarts(world.tasks, world.fleet, world.flights, stamp)
    monkeypatch.setattr(earliest_starts, 'timed_stops', lambda *args: calls.append(args) or (
        timed_stops(*args)))
    tried = 0
    for task in tasks(seed):
        for usable in (True, False):
            able = [uav_id for uav_id in task.allowed_uavs or world.fleet.records
                    if world.fleet.usable(uav_id) == usable]
            each = [(stamp + timed_stops((ListStop(task, Leg((), 0.0), 0.0),), world.flights.of(
                uav_id, stamp))[0].start, uav_id) for uav_id in able]
            assert starts.first(task, (), usable) == min(each, default=(float('inf'), ''))
            tried += len(able)
    assert len(calls) < 0.5 * tried
