# SPDX-License-Identifier: Apache-2.0
"""Random legs over a GeoTIFF, judged by samples of 1 m that do not use the code that raises them.

The last line is one JSON object.
"""
from __future__ import annotations

import argparse
import json
import math
import random
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import rasterio

from uav_task_alloc.geometry.frames import Origin, to_geodetic_batch
from uav_task_alloc.terrain import read_terrain

_DEFAULT = Path(__file__).parent / 'data' / 'jacksboro.tif'
_BORDER = 0.03  # share of the tile at each side where no leg begins or ends


class Samples:
    """Heights above the raster, by degrees: its transform and bilinear weights only."""

    def __init__(self, path: Path, origin: Origin) -> None:
        with rasterio.open(path) as raster:
            assert raster.crs.to_epsg() == 4326
            self._heights, self._grid = raster.read(1).astype(float), ~raster.transform
        self._origin = origin

    def above(self, points: list) -> np.ndarray:
        """Heights [m] above the ground at points of a line [m] ENU, one each metre."""
        rows = [np.linspace(a, b, max(2, math.ceil(math.dist(a, b)) + 1))
                for a, b in pairwise(points)]
        places = to_geodetic_batch(self._origin, np.concatenate(rows))
        x, y = self._grid * (places[:, 1], places[:, 0])
        x, y = x - 0.5, y - 0.5
        i, j = np.floor(x).astype(int), np.floor(y).astype(int)
        u, v, h = x - i, y - j, self._heights
        return places[:, 2] - (h[j, i] * (1 - u) * (1 - v) + h[j, i + 1] * u * (1 - v)
                               + h[j + 1, i] * (1 - u) * v + h[j + 1, i + 1] * u * v)


def random_legs(path: Path, count: int, seed: int) -> tuple[Origin, list]:
    """An origin in the middle of the tile, and ends of legs [m] ENU at 30 to 150 m above it."""
    with rasterio.open(path) as raster:
        west, south, east, north = raster.bounds
    origin = Origin((south + north) / 2, (west + east) / 2, 0.0)
    terrain, rng = read_terrain(path, origin), random.Random(seed)
    high = (north - south) * (0.5 - _BORDER) * 110_900.0
    wide = (east - west) * (0.5 - _BORDER) * 111_300.0 * math.cos(math.radians(origin.latitude))
    legs = []
    for _ in range(count):
        ends = [(rng.uniform(-wide, wide), rng.uniform(-high, high), 0.0) for _ in 'ab']
        legs.append(terrain.raised(ends, [rng.uniform(31.0, 150.0) for _ in 'ab']))
    return origin, legs


def main() -> None:
    """Judge the legs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--raster', type=Path, default=_DEFAULT, help='(default: %(default)s)')
    parser.add_argument('--legs', type=int, default=1000, help='(default: %(default)s)')
    parser.add_argument('--seed', type=int, default=1, help='(default: %(default)s)')
    parser.add_argument('--clearance', type=float, default=30.0, help='[m] (default: %(default)s)')
    args = parser.parse_args()
    origin, legs = random_legs(args.raster, args.legs, args.seed)
    terrain, samples = read_terrain(args.raster, origin), Samples(args.raster, origin)
    below = total = straight = points = 0
    least, seconds = math.inf, 0.0
    for a, b in legs:
        began = time.process_time()
        via = terrain.lifted(a, b, args.clearance)
        seconds += time.process_time() - began
        heights = samples.above([a, *via, b])
        below, total = below + int((heights < args.clearance).sum()), total + len(heights)
        straight += int((samples.above([a, b]) < args.clearance).any())
        least, points = min(least, float(heights.min())), points + len(via)
    print(json.dumps({
        'legs': len(legs), 'seed': args.seed, 'clearance': args.clearance, 'samples': total,
        'below': below, 'least': round(least, 3), 'straight_legs_below': straight,
        'points_per_leg': round(points / len(legs), 1),
        'cpu_ms_per_leg': round(1000.0 * seconds / len(legs), 2)}))


if __name__ == '__main__':
    main()
