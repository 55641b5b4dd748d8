# SPDX-License-Identifier: Apache-2.0
"""Areas whose heights are above the ground are covered up to the zones, as level ones are."""
import math
from dataclasses import replace

import numpy as np
import pytest
from fields import Raster, field

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.terrain import Terrain
from uav_task_alloc.work.pieces import pieces_of
from uav_task_alloc.work.recut import FlownWays
from uav_task_alloc.work.values import Vertical

STEP, NODES = 0.0005, 60  # [deg] some 50 m; of each side
SLOPE = 3.0  # [m] to the east from node to node
AREA = replace(field([(0.0, 0.0), (400.0, 0.0), (400.0, 240.0), (0.0, 240.0)], 40.0,
                     direction=0.0), vertical=Vertical.TERRAIN)


def slope(rough=0.0):
    """A hillside around the origin that rises to the east, with random heights [m] on it."""
    origin = Origin(47.0, 8.0, 500.0)
    heights = np.tile(500.0 + SLOPE * np.arange(NODES), (NODES, 1))
    heights += rough * np.random.default_rng(1).random((NODES, NODES))
    return Terrain(heights, lambda longitude, latitude: (
        (longitude - 8.0) / STEP + NODES / 2, (47.0 - latitude) / STEP + NODES / 2), origin)


@pytest.mark.parametrize('zone', [
    ThreatZone.cylinder('z', (200.0, 110.0), 60.0),
    ThreatZone.polygon('z', [(50.0, 90.0), (350.0, 90.0), (350.0, 119.0), (50.0, 119.0)]),
])
def test_strips_turn_along_a_zone_that_bars_all_of_them(zone):
    raster = Raster(AREA, [zone], 5.0)
    for piece in pieces_of(AREA, [zone], 5.0, slope()):
        assert path_is_clear(piece.path, [zone], 5.0)
        raster.fly(piece.path, AREA.strip_width)
    assert raster.share() >= 0.995


def test_what_is_left_of_a_strip_has_the_heights_of_the_whole():
    ground, zone = slope(rough=30.0), ThreatZone.cylinder('z', (200.0, 110.0), 60.0)
    whole = FlownWays(piece.path for piece in pieces_of(AREA, (), 0.0, ground))
    parts = [part for piece in pieces_of(AREA, [zone], 0.0, ground)
             for part in whole.unflown_parts(piece.path)]
    # along the zone only
    assert parts
    assert all(math.dist(point[:2], (200.0, 110.0)) < 60.0 + AREA.strip_width
               for part in parts for point in part)


def test_a_zone_below_a_part_of_the_ways_ends_them_where_they_enter_it():
    ways = [piece.path for piece in pieces_of(AREA, (), 0.0, slope())]
    middle = sum(z for _, _, z in ways[0]) / len(ways[0])
    low = ThreatZone.polygon('z', [(-50.0, -50.0), (450.0, -50.0), (450.0, 300.0),
                                   (-50.0, 300.0)], z_max=middle)
    left = [piece.path for piece in pieces_of(AREA, [low], 0.0, slope())]
    assert len(left) == len(ways)
    assert all(path_is_clear(way, [low], 0.0) for way in left)
    assert all(100.0 < abs(way[-1][0] - way[0][0]) < 300.0 for way in left)


def test_an_area_above_ground_inside_a_zone_is_cut_as_if_there_were_none():
    around = ThreatZone.cylinder('z', (200.0, 100.0), 900.0)
    assert pieces_of(AREA, [around], 0.0, slope()) == pieces_of(AREA, (), 0.0, slope())
