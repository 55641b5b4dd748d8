# SPDX-License-Identifier: Apache-2.0
"""Fences of random zone pictures, judged by shapely: `python benchmarks/fences.py --pictures 500`.

Each picture has random zones and tasks, planned by the package; for each UAV a fence is chosen
for the budget of ArduCopter or PX4, and read back from its items. The last line is one JSON
object; the exit code is 1 where an exclusion does not cover its zone, a fence is larger than its
budget, or a task or planned leg is in an exclusion.
"""
from __future__ import annotations

import argparse
import json
import math
import random
import sys
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise

from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from uav_task_alloc import Task, ThreatZone, Uav, plan
from uav_task_alloc.geometry.frames import Origin, to_enu_batch
from uav_task_alloc.geometry.polygon import is_simple
from uav_task_alloc.mavlink.fence.choice import Fence, FlightSpace, choose_fence
from uav_task_alloc.mavlink.fence.shapes import CIRCLES, fence_items
from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.model import Shape

BUDGETS = {'ardupilot': 70, 'px4': 64}  # points
CLEARANCE = 10.0  # [m] of the plan
SIDE = 2000.0  # [m]
TOUCH = 0.005  # [m]


def random_zone(rng: random.Random, name: str) -> ThreatZone | None:
    """A circle, dome or polygon, some of them with heights; None where it is not simple."""
    x, y = (rng.uniform(100.0, SIDE - 100.0) for _ in range(2))
    size, margin = rng.uniform(20.0, 180.0), rng.choice([0.0, 5.0, 30.0])
    z_min, z_max = rng.choice([(-math.inf, math.inf)] * 4 + [(-math.inf, 30.0), (-10.0, 200.0),
                                                           (90.0, math.inf), (40.0, 80.0)])
    kind = rng.random()
    if kind < 0.25:
        return ThreatZone.hemisphere(name, (x, y, 0.0), size, margin)
    if kind < 0.5:
        return ThreatZone.cylinder(name, (x, y), size, z_min, z_max, margin)
    count = rng.randint(3, 30)
    corners = [(x + r * math.cos(a), y + r * math.sin(a)) for a, r in (
        (2 * math.pi * (k + 0.8 * rng.random()) / count, size * rng.uniform(0.3, 1.0))
        for k in range(count))]
    return ThreatZone.polygon(name, corners, z_min, z_max, margin) if is_simple(corners) else None


def random_picture(seed: int) -> tuple[random.Random, list[ThreatZone]]:
    """Zones of one picture, few or many."""
    rng = random.Random(seed)
    zones = [random_zone(rng, f'z{k}') for k in range(rng.choice([3, 8, 15, 30]))]
    return rng, [zone for zone in zones if zone is not None]


def covers(zone: ThreatZone) -> BaseGeometry:
    """The plan view of a zone with its margin, slightly inside of its round parts."""
    base = Polygon(zone.vertices) if zone.shape is Shape.POLYGON else Point(
        zone.center[:2]).buffer(zone.radius, quad_segs=32)
    return base.buffer(zone.margin, quad_segs=16) if zone.margin else base


def read_back(items: Sequence[Item], origin: Origin) -> list[BaseGeometry]:
    """The exclusions of a fence store in ENU [m]."""
    shapes, at = [], 0
    places = to_enu_batch(origin, [
        (item.x * 1e-7, item.y * 1e-7, origin.altitude_amsl) for item in items]).tolist()
    while at < len(items):
        if items[at].command in CIRCLES:
            # more sides than `covers`, around the circle: shapely's own are inside of it
            radius = items[at].params[0] / math.cos(math.pi / 256)
            shapes.append(Point(places[at][:2]).buffer(radius, quad_segs=64))
            at += 1
        else:
            count = round(items[at].params[0])
            shapes.append(Polygon([place[:2] for place in places[at:at + count]]))
            at += count
    return shapes


def judge(zones: Sequence[ThreatZone], fence: Fence, space: FlightSpace, budget: int,
          origin: Origin) -> list[str]:
    """The faults of one fence."""
    items, faults = fence_items(fence.shapes, origin), []
    by_id = {zone.id: zone for zone in zones}
    if len(items) > budget:
        faults.append(f'{len(items)} points of {budget}')
    shapes = read_back(items, origin)
    legs = [LineString([a[:2], b[:2]]) if a[:2] != b[:2] else Point(a[:2])
            for path in space.paths for a, b in pairwise(path)]
    for shape, geometry in zip(fence.shapes, shapes, strict=True):
        zone = by_id[shape.zone]
        if not geometry.is_valid or not geometry.covers(covers(zone).buffer(-TOUCH)):
            faults.append(f'{zone.id} is not covered')
        inner = (geometry if shape.corners else
                 Point(geometry.centroid).buffer(shape.radius, quad_segs=64)).buffer(-TOUCH)
        faults += [f'a leg is in {zone.id}' for leg in legs if inner.intersects(leg)]
    lost = set(by_id) - {s.zone for s in fence.shapes} - set(fence.free_side) - set(
        fence.waiting) - set(fence.no_space)
    return faults + [f'{name} is not named' for name in sorted(lost)]


def fly_picture(seed: int, counts: Counter[str]) -> list[str]:
    """Plan one picture, choose and judge the fences of its UAVs."""
    rng, zones = random_picture(seed)
    origin = Origin(rng.uniform(-65.0, 65.0), rng.uniform(-180.0, 180.0), 100.0)
    height = rng.choice([20.0, 50.0, 120.0])
    uavs = [Uav(f'u{n}', position=(50.0 * n, 0.0, height), home=(50.0 * n, 0.0, 0.0))
            for n in range(2)]
    tasks = [Task(f't{n}', position=(rng.uniform(0.0, SIDE), rng.uniform(0.0, SIDE), height))
             for n in range(10)]
    result = plan(uavs, tasks, zones, budget=0.02, seed=seed, clearance=CLEARANCE,
                  route_end='home', max_iterations=50)
    places, faults = {task.id: task.position for task in tasks}, []
    for uav, (kind, budget) in zip(uavs, BUDGETS.items(), strict=True):
        route = result.route(uav.id)
        path = [uav.position]
        for n, leg in enumerate(route.legs):
            path += leg.via
            path.append(places[route.tasks[n]] if n < len(route.tasks) else uav.base)
        space = FlightSpace((tuple(path),), height, height + 10.0)
        fence = choose_fence(zones, None, space, budget, origin)
        faults += [f'picture {seed}, {uav.id} ({kind}): {fault}'
                   for fault in judge(zones, fence, space, budget, origin)]
        counts += Counter(zones=len(zones), carried=len(fence.shapes),
                          free_side=len(fence.free_side), waiting=len(fence.waiting),
                          no_space=len(fence.no_space), fences=1)
    return faults


def main() -> int:
    """Judge the pictures; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--pictures', type=int, default=500)
    parser.add_argument('--seed', type=int, default=1)
    args = parser.parse_args()
    counts: Counter[str] = Counter()
    faults = []
    for seed in range(args.seed, args.seed + args.pictures):
        faults += fly_picture(seed, counts)
    for fault in faults[:50]:
        print(fault)
    print(json.dumps({'pictures': args.pictures, 'seed': args.seed, 'faults': len(faults),
                      **counts}))
    return 1 if faults else 0


if __name__ == '__main__':
    sys.exit(main())
