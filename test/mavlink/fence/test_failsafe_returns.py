# SPDX-License-Identifier: Apache-2.0
"""A failsafe at a random moment enters no zone with a planner on board, else it is reported."""
import random

import pytest
from fence_bench import FenceBench

from uav_task_alloc import Task, ThreatZone, Uav, plan
from uav_task_alloc.geometry.polygon import contains_point
from uav_task_alloc.mavlink.gcs.vehicle_diagnostics import diagnostics_of
from uav_task_alloc.mavlink.mission.files import list_for_route
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Route
from uav_task_alloc.sim.config import FlightMode

AROUND = (('FENCE_ENABLE', 1.0), ('OA_TYPE', 2.0))
HEIGHT = 50.0  # [m]


def scene(rng):
    """Zones between home and the tasks."""
    zones = []
    for k in range(8):
        x, y, r = rng.uniform(100, 700), rng.uniform(-300, 500), rng.uniform(30, 80)
        if (x**2 + y**2)**0.5 < 2 * r + 40.0:
            continue
        zones.append(ThreatZone.cylinder(f'c{k}', (x, y), r, margin=5.0) if k % 2 else
                     ThreatZone.polygon(f'p{k}', [(x - r, y - r), (x + r, y - r), (x, y - r / 3),
                                                  (x + r, y + r), (x - r, y + r)], margin=5.0))
    tasks = [Task(f't{k}', (rng.uniform(100, 800), rng.uniform(-300, 600), HEIGHT))
             for k in range(6)]
    return zones, tasks


def entered(zones, place):
    return [zone.id for zone in zones if (
        contains_point(zone.vertices, place[:2]) if zone.vertices else
        (place[0] - zone.center[0])**2 + (place[1] - zone.center[1])**2 < zone.radius**2)]


def flown_return(kind, parameters, seed):
    """The zones that a failsafe at a random moment enters, and those that were reported before."""
    rng = random.Random(seed)
    zones, tasks = scene(rng)
    bench = FenceBench(kind, zones=zones, seed=seed, config={
        'parameters': parameters, 'position': (0.0, 0.0, 0.0)}).settle()
    uav = Uav('uav_1', (0.0, 0.0, HEIGHT), home=(0.0, 0.0, 0.0))
    result = plan([uav], tasks, zones, budget=30.0, seed=seed, clearance=10.0, max_iterations=30)
    route = Route('uav_1', result.routes['uav_1'], result.legs['uav_1'])
    bench.assign(list_for_route(route, {task.id: task for task in tasks}))
    assert bench.run(lambda: bench.started())
    bench.run(limit=rng.uniform(5.0, 60.0))
    bench.run(lambda: bench.fence.verified)
    reported = bench.fence.way_home
    flight = bench.vehicle.flight
    bench.vehicle.failsafe('battery', flight.custom_modes[FlightMode.RETURN])
    crossed = set()

    def home():
        crossed.update(entered(zones, flight.body.position))
        return flight.landed
    assert bench.run(home)
    return crossed, reported


@pytest.mark.parametrize('seed', range(6))
def test_arducopter_with_a_planner_returns_around_the_zones(seed):
    crossed, reported = flown_return('ardupilot', AROUND, seed)
    assert not crossed
    assert not reported


@pytest.mark.parametrize('seed', range(6))
def test_px4_returns_straight_and_what_it_crosses_is_reported_before(seed):
    crossed, reported = flown_return('px4', (('GF_ACTION', 1.0),), seed)
    assert crossed <= set(reported.replace(',', ' ').split())


def test_without_fences_all_zones_across_the_way_home_are_a_warning_too():
    bench = FenceBench('px4', fences='off', zones=(), config={'position': (0.0, 0.0, 0.0)})
    far = Task('far', (400.0, 0.0, HEIGHT), service_time=200.0)
    bench.discover().assign(TaskList(1, (MissionStop(far),)))
    assert bench.run(lambda: bench.executor().telemetry.position[0] > 395.0)
    session, = bench.ground_station.sessions.values()
    assert diagnostics_of(session, bench.now).level == 0
    bench.set_zones(ThreatZone.cylinder('near', (120.0, 0.0), 30.0),
                    ThreatZone.cylinder('beside', (200.0, 200.0), 30.0),
                    ThreatZone.cylinder('low', (200.0, 0.0), 30.0, -10.0, 40.0),
                    ThreatZone.cylinder('mid', (280.0, 10.0), 30.0))
    found = diagnostics_of(session, bench.now)
    assert (found.level, found.facts.failsafe_way) == (1, 'zones near, mid')
    assert found.summary == "a failsafe's straight way home crosses zones near, mid"
