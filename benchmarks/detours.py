# SPDX-License-Identifier: Apache-2.0
"""The figures of detours: against the dense reference, and the time they take.

    python benchmarks/detours.py quality [PAIRS] [RING]    # against Dijkstra, 15 min
    python benchmarks/detours.py speed                     # 1000 tasks, 50 zones
"""
from __future__ import annotations

import math
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / 'test' / 'geometry')]

from dense import Dense  # noqa: E402
from scenes import CLEARANCE, random_point, random_zones, violations  # noqa: E402

from uav_task_alloc.geometry.detour import find_detour  # noqa: E402
from uav_task_alloc.geometry.distances import Distances  # noqa: E402


def compare(count: int, apart: bool, pairs: int, ring: int, seed: int) -> None:
    """Print how paths among `count` zones compare with the reference, blocked pairs only."""
    rng = np.random.default_rng(seed)
    side = 1500.0 if count < 20 else 4000.0
    longer, corners, missed, entered, closed, done = [], [], 0, 0, 0, 0
    while done < pairs:
        zones = random_zones(rng, count, apart, side, shapes='hcpe')
        high = float(rng.choice([math.inf, 120.0]))
        dense = Dense(zones, CLEARANCE, low=0.0, high=high, ring=ring)
        for _ in range(min(20, pairs - done)):
            a, b = random_point(rng, zones, side), random_point(rng, zones, side)
            detour = find_detour(a, b, zones, clearance=CLEARANCE, altitude_min=0.0,
                                altitude_max=high)
            if detour.length <= math.dist(a, b) * (1 + 1e-9):
                continue
            done += 1
            reference = dense.length(a, b)
            if math.isinf(detour.length):
                missed += math.isfinite(reference)
                closed += math.isinf(reference)
                continue
            entered += violations([a, *detour.points, b], zones)
            corners.append(len(detour.points))
            if math.isfinite(reference):  # else a finer search than the reference's found it
                longer.append(100 * (detour.length / reference - 1))
    print(f'K = {count:2d} {"disjoint   " if apart else "overlapping"} n = {done:4d}: longer by '
          f'median {np.median(longer):+.2f} %, p99 {np.percentile(longer, 99):+.2f} %, '
          f'worst {max(longer):+.2f} %; missed {missed}, both closed {closed}; samples inside '
          f'{entered}; waypoints median {np.median(corners):.0f}, most {max(corners)}', flush=True)


def quality(pairs: int = 2100, ring: int = 36) -> None:
    """All scenes of the issue: 1, 5, 20, 50 zones, apart and overlapping, shapes mixed."""
    for seed, (count, apart) in enumerate([(1, True), (5, True), (5, False), (20, True),
                                           (20, False), (50, True), (50, False)]):
        compare(count, apart, math.ceil(pairs / 7), ring, seed)


def speed(shapes: str = 'hcp', apart: bool = True, seed: int = 1) -> None:
    """1000 tasks, 50 zones on 10 x 10 km: CPU time, one thread, compiled; best of nine."""
    rng = np.random.default_rng(seed)
    zones = random_zones(rng, 51, apart, 10_000.0, 400.0, shapes)
    points = np.array([random_point(rng, zones, 10_000.0) for _ in range(1001)])
    near = np.argsort(((points[:, None] - points[None, :1000]) ** 2).sum(2), axis=1)
    goals, origins = near[:1000, 1:25].ravel(), np.repeat(np.arange(1000), 24)
    figures: dict[str, list[float]] = {}

    def timed(name: str, start: float) -> None:
        figures.setdefault(name, []).append(1e3 * (time.thread_time() - start))

    for _ in range(9):  # other load only adds time, so the best counts
        distances = Distances(points[:1000], zones[:50], clearance=CLEARANCE)
        start = time.thread_time()
        distances.ensure(origins, goals)
        timed('candidate pairs', start)
        start = time.thread_time()
        more = distances.updated(points=points)
        more.ensure(np.full(24, 1000), near[1000, :24])
        timed('one new task', start)
        start = time.thread_time()
        more = distances.updated(zones=zones)
        more.ensure(origins, goals)
        timed('one new zone', start)
        start = time.thread_time()
        more = distances.updated(zones=zones[1:50])
        more.ensure(origins, goals)
        timed('one zone less', start)
    straight = np.linalg.norm(points[origins] - points[goals], axis=1)
    bent = np.mean([distances.length(i, j) > s * (1 + 1e-9)
                    for i, j, s in zip(origins, goals, straight, strict=True)])
    print(f'{shapes:3s} {"disjoint   " if apart else "overlapping"}: {100 * bent:.0f} % bent, '
          + ', '.join(f'{name} {min(times):.2f} ms' for name, times in figures.items()))


if __name__ == '__main__':
    if sys.argv[1:2] == ['quality']:
        quality(*map(int, sys.argv[2:]))
    elif sys.argv[1:2] == ['speed']:
        for shapes, apart in (('h', True), ('hcp', True), ('h', False), ('hcp', False)):
            speed(shapes, apart)
