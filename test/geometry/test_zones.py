# SPDX-License-Identifier: Apache-2.0
"""Inside, distance and clear segments, for every shape."""
import math

import pytest

from uav_task_alloc.geometry.zones import (
    cut_by,
    distance,
    inside,
    is_clear,
    path_is_clear,
    zones_around,
)
from uav_task_alloc.model import ThreatZone

DOME = ThreatZone.hemisphere('dome', (0.0, 0.0, 10.0), 50.0, margin=5.0)
TOWER = ThreatZone.cylinder('tower', (0.0, 0.0), 20.0, 30.0, 60.0)
BLOCK = ThreatZone.polygon('block', [(0, 0), (10, 0), (10, 10), (0, 10)], 0.0, 20.0)
CONCAVE = ThreatZone.polygon('concave', [(0, 0), (40, 0), (40, 40), (20, 10), (0, 40)])


@pytest.mark.parametrize(('point', 'zone', 'clearance', 'expected'), [
    ((0, 0, 20), DOME, 0, True),
    ((0, 0, 64.9), DOME, 0, True),
    ((0, 0, 65.1), DOME, 0, False),
    ((0, 0, 65.1), DOME, 1, True),
    ((0, 0, 4), DOME, 0, False),  # beneath the base, less the margin
    ((0, 0, 45), TOWER, 0, True),
    ((0, 0, 60), TOWER, 0, False),
    ((19.9, 0, 30.1), TOWER, 0, True),
    ((20, 0, 45), TOWER, 0, False),
    ((5, 5, 5), BLOCK, 0, True),
    ((5, 5, 20.5), BLOCK, 0, False),
    ((10.5, 5, 5), BLOCK, 0, False),
    ((10.5, 5, 5), BLOCK, 1, True),
    ((20, 30, 5), CONCAVE, 0, False),
    ((20, 5, 5), CONCAVE, 0, True),
])
def test_a_point_is_inside_the_zone_enlarged_by_margin_and_clearance(
        point, zone, clearance, expected):
    assert inside(point, zone, clearance) is expected


@pytest.mark.parametrize(('point', 'zone', 'expected'), [
    ((0, 0, 110), DOME, 50.0),
    ((0, 0, 30), DOME, 0.0),
    ((0, 0, 0), DOME, 10.0),
    ((80, 0, -30), DOME, 50.0),
    ((23, 0, 64), TOWER, 5.0),
    ((0, 0, 20), TOWER, 10.0),
    ((13, 14, 5), BLOCK, 5.0),
    ((5, 5, 25), BLOCK, 5.0),
    ((20, 30, 0), CONCAVE, 20 * 20 / math.hypot(20, 30)),
])
def test_the_distance_is_to_the_zone_without_margin(point, zone, expected):
    assert distance(point, zone) == pytest.approx(expected)


def test_a_segment_beneath_the_base_of_a_dome_is_clear():
    assert is_clear((-100, 0, 0), (100, 0, 0), [DOME])
    assert not is_clear((-100, 0, 10), (100, 0, 10), [DOME])


def test_a_segment_through_a_notch_is_clear_though_its_hull_is_not():
    assert is_clear((20, 60, 5), (20, 15, 5), [CONCAVE])
    assert not is_clear((20, 60, 5), (20, 5, 5), [CONCAVE])


def test_a_segment_that_slopes_over_the_top_is_clear():
    assert is_clear((-50, 0, 20), (60, 0, 20), [BLOCK])
    assert not is_clear((-50, 0, 19), (60, 0, 20), [BLOCK])
    assert cut_by((-50, 0, 19), (60, 5, 19), [DOME, BLOCK]) is DOME


def test_a_path_is_clear_when_each_of_its_segments_is():
    corner = [(-50.0, 5.0, 5.0), (5.0, 60.0, 5.0), (60.0, 5.0, 5.0)]
    assert path_is_clear(corner, [BLOCK])
    assert not path_is_clear([corner[0], corner[2]], [BLOCK])


def test_all_zones_around_a_point_are_named():
    assert zones_around((0, 0, 45), [DOME, TOWER, BLOCK]) == (DOME, TOWER)
    assert zones_around((500, 0, 45), [DOME, TOWER, BLOCK]) == ()
