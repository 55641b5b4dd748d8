# SPDX-License-Identifier: Apache-2.0
"""Plans in random fence areas, judged by shapely: `python benchmarks/fence_areas.py --areas 500`.

Areas are stars or combs of 3 to 20 corners, many of them concave. The last line is one JSON
object; the exit code is 1 where a leg comes nearer to the border than the clearance, a task
outside has a UAV, or one that all UAVs can reach inside, in an area without zones, has none.
"""
from __future__ import annotations

import argparse
import json
import math
import random
import sys
from collections import Counter
from itertools import pairwise

from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from uav_task_alloc import Task, ThreatZone, Uav, plan
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.fence_area import AreaCorners, check_fence_area, zones_outside
from uav_task_alloc.model import Plan

HEIGHT = 50.0  # [m]
NEARER = 0.25  # [m] that a leg may be nearer than the clearance
FARTHER = 0.5  # [m] beyond the clearance: there a task can be flown


def star(rng: random.Random) -> list[tuple[float, float]]:
    """Corners in all directions from a middle."""
    turns = sorted(rng.uniform(0.0, 2.0 * math.pi) for _ in range(rng.randint(3, 20)))
    return [(rng.uniform(200.0, 1500.0) * math.cos(turn),
             rng.uniform(200.0, 1500.0) * math.sin(turn)) for turn in turns]


def comb(rng: random.Random) -> list[tuple[float, float]]:
    """Arms beside one another, turned."""
    top, turn = rng.uniform(600.0, 1500.0), rng.choice([0.0, 0.3, 1.5])
    corners = []
    for x in range(0, 350 * rng.randint(1, 4), 350):
        corners += [(x, top), (x + 200, top), (x + 200, 200.0), (x + 350, 200.0)]
    x = corners[-1][0]
    corners += [(x, top), (x + 200, top), (x + 200, 0.0), (0.0, 0.0)]
    return [(x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn))
            for x, y in corners]


def random_area(rng: random.Random) -> AreaCorners:
    """An area; () where it is not simple."""
    try:
        return check_fence_area(rng.choice([star, comb])(rng))
    except InvalidValue:
        return ()


def place_in(rng: random.Random, shape: BaseGeometry) -> tuple[float, float]:
    """A random place."""
    west, south, east, north = shape.bounds
    while True:
        place = rng.uniform(west, east), rng.uniform(south, north)
        if shape.contains(Point(place)):
            return place


def judge(area: Polygon, clearance: float, uavs: list[Uav], tasks: dict[str, Task],
          result: Plan) -> list[str]:
    """The faults of one plan."""
    allowed = area.buffer(NEARER - clearance) if clearance else area.buffer(NEARER)
    faults = [f'{name} is outside' for uav in uavs for name in result.routes[uav.id]
              if not area.contains(Point(tasks[name].position[:2]))]
    for uav in uavs:
        route = result.route(uav.id)
        ends = [*(tasks[name].position for name in route.tasks), uav.base]
        points = [uav.position]
        for leg, end in zip(route.legs, ends, strict=False):
            points += [*leg.via, end]
        faults += [f'a leg of {uav.id} leaves the area' for a, b in pairwise(points)
                   if a[:2] != b[:2] and not allowed.covers(LineString([a[:2], b[:2]]))]
    return faults


def plan_in(seed: int, counts: Counter[str]) -> list[str]:
    """Plan in one random area, and judge it."""
    rng = random.Random(seed)
    corners, clearance = random_area(rng), rng.choice([0.0, 5.0, 10.0])
    area = Polygon(corners) if corners else Polygon()
    parts = area.buffer(-clearance - FARTHER)
    part = max(getattr(parts, 'geoms', [parts]), key=lambda each: each.area)
    if part.area < 100.0:
        return []
    uavs = [Uav(f'u{k}', (*place_in(rng, part), HEIGHT)) for k in range(rng.randint(1, 3))]
    inside = [Task(f'in{k}', (*place_in(rng, part), HEIGHT)) for k in range(rng.randint(1, 12))]
    around = area.buffer(300.0).difference(area)
    outside = [Task(f'out{k}', (*place_in(rng, around), HEIGHT)) for k in range(3)]
    zones = [ThreatZone.cylinder('z', place_in(rng, area), rng.uniform(5.0, 60.0))
             ] * (rng.random() < 0.4)
    result = plan(uavs, [*inside, *outside], [*zones, *zones_outside(corners)], budget=0.02,
                  clearance=clearance, seed=seed, route_end=rng.choice(['hold', 'home']))
    counts += Counter(areas=1, tasks=len(inside), outside=len(outside), with_zone=len(zones))
    tasks = {task.id: task for task in (*inside, *outside)}
    left = [] if zones else [f'{task.id} has no UAV: {result.unassigned[task.id]}'
                             for task in inside if task.id in result.unassigned]
    return [f'area {seed}: {fault}' for fault in [
        *judge(area, clearance, uavs, tasks, result), *left]]


def main() -> int:
    """Judge the plans; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--areas', type=int, default=500, help='drawn; those not simple are left')
    parser.add_argument('--seed', type=int, default=1)
    args = parser.parse_args()
    counts: Counter[str] = Counter()
    faults = []
    for seed in range(args.seed, args.seed + args.areas):
        faults += plan_in(seed, counts)
    for fault in faults[:50]:
        print(fault)
    print(json.dumps({'drawn': args.areas, 'seed': args.seed, 'faults': len(faults), **counts}))
    return 1 if faults else 0


if __name__ == '__main__':
    sys.exit(main())
