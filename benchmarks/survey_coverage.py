# SPDX-License-Identifier: Apache-2.0
"""Strips over random fields against an independent raster, and their way against a public planner.

Usage: python benchmarks/survey_coverage.py [--fields N] [--seed S] [--solver SECONDS]

Half of the fields have no holes and zones. Each is cut by `pieces_of`; the raster knows polygons,
holes and zones by its own formulas, and what rectangles around the ways have covered. With
`pip install --no-deps drone-flightplan shapely pyproj geojson` the total way of one UAV over each
field without holes is compared with that of drone-flightplan for the same distance of strips (its
photos a quarter of it apart): from the begin of the first strip to the end of the last, turns
without radius. Ours are in their order, each from its nearer end, or with `--solver` in the order
that `plan` finds in so many seconds, from the best of four ends of the outer strips; then also
with the ways from a corner of the field and back to it, for both. The last line is one JSON
object: `fields`, `least_share`, `below` (of 99.5 %), `entered` (ways inside zones), `pieces`
(median), `seconds` (longest to cut), `compared`, `ratio_median`, `ratio_worst`, `shorter` (share),
and `their_share` (covered by the public planner, median), `ratio_by_area` (of ways by what they
have covered, median), `ratio_from_corner` (median, with the ways from and to a corner).
"""
import argparse
import json
import random
import statistics
import sys
import time
import types
from itertools import pairwise
from math import dist
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'work'))
from fields import Raster, random_field

from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.work.pieces import pieces_of
from uav_task_alloc.work.strips import snake_length

LEAST = 0.995  # of what can be reached


def public_planner():
    """The grid and path of drone-flightplan; None where it is not installed."""
    gdal = types.ModuleType('osgeo')  # imported for terrain, which is not used here
    gdal.gdal = gdal.ogr = gdal.osr = None
    sys.modules.setdefault('osgeo', gdal)
    try:
        from drone_flightplan import waypoints
        from shapely.geometry import Polygon
    except ImportError:
        return None

    def way(work):
        field = Polygon([point[:2] for point in work.path])
        angle = waypoints.calculate_optimal_rotation_angle(field)
        photos = work.strip_width / 4
        grid = waypoints.generate_grid_in_aoi(field, photos, work.strip_width, angle)
        path = waypoints.create_path(grid, photos, angle, polygon=field)
        return [(each['coordinates'].x, each['coordinates'].y) for each in path]
    return way


def own_length(pieces, budget):
    """Way [m] from the begin of the first strip to the end of the last."""
    snake = snake_length([list(piece.path) for piece in pieces])
    if not budget:
        return snake
    from uav_task_alloc import Uav, plan
    starts = {end for piece in (pieces[0], pieces[-1]) for end in (piece.path[0], piece.path[-1])}
    found = [plan([Uav('u', start)], pieces, budget=budget / len(starts), seed=1)
             for start in sorted(starts)]
    return min(snake, *(each.distance - each.legs['u'][0].length for each in found))


def ratio_from_corner(work, pieces, other, budget):
    """Ratio of the ways from the first corner over all strips and back to it."""
    from uav_task_alloc import Uav, plan
    corner = work.path[0]
    own = plan([Uav('u', corner)], pieces, budget=budget, seed=1, route_end='home').distance
    return own / sum(dist(a, b) for a, b in pairwise([corner[:2], *other, corner[:2]]))


def measure(seed, plain, planner, budget):
    """One field: share, ways in zones, pieces, seconds, ratio, their share, from a corner."""
    rng = random.Random(seed)
    work, zones = random_field(rng, *((0, 0) if plain else (3, 4)))
    clearance = rng.choice((0.0, 5.0))
    begin = time.process_time()
    pieces = pieces_of(work, zones, clearance)
    seconds = time.process_time() - begin
    raster = Raster(work, zones, clearance, 600)
    for piece in pieces:
        raster.fly(piece.path, work.strip_width)
    entered = sum(not path_is_clear(piece.path, zones, clearance) for piece in pieces)
    if not plain or planner is None:
        return raster.share(), entered, len(pieces), seconds, None, None, None
    other, theirs = planner(work), Raster(work, (), 0.0, 600)
    theirs.fly(other, work.strip_width)
    way, public = own_length(pieces, budget), sum(dist(a, b) for a, b in pairwise(other))
    corner = ratio_from_corner(work, pieces, other, budget) if budget else None
    return raster.share(), entered, len(pieces), seconds, way / public, theirs.share(), corner


def main():
    """Run the fields and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--fields', type=int, default=200)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--solver', type=float, default=0.0, metavar='SECONDS')
    args = parser.parse_args()
    planner, rows = public_planner(), []
    for k in range(args.fields):
        row = measure(1000 * args.seed + k, k % 2 == 0, planner, args.solver)
        rows.append(row)
        if row[0] < LEAST or row[1]:
            print(f'field {1000 * args.seed + k}: {100 * row[0]:.2f} %, {row[1]} ways in zones')
    ratios = [row[4] for row in rows if row[4] is not None]
    print(json.dumps({
        'fields': len(rows), 'seed': args.seed, 'least_share': round(min(r[0] for r in rows), 5),
        'below': sum(row[0] < LEAST for row in rows), 'entered': sum(row[1] for row in rows),
        'pieces': statistics.median(row[2] for row in rows),
        'seconds': round(max(row[3] for row in rows), 2), 'compared': len(ratios), **({
            'ratio_median': round(statistics.median(ratios), 3),
            'ratio_worst': round(max(ratios), 3),
            'their_share': round(statistics.median(r[5] for r in rows if r[5] is not None), 5),
            'ratio_by_area': round(statistics.median(
                r[4] * r[5] / r[0] for r in rows if r[4] is not None), 3),
            'shorter': round(sum(ratio <= 1.0 for ratio in ratios) / len(ratios), 3),
            **({'ratio_from_corner': round(statistics.median(
                row[6] for row in rows if row[6] is not None), 3)} if args.solver else {}),
        } if ratios else {})}))


if __name__ == '__main__':
    main()
