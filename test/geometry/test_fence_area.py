# SPDX-License-Identifier: Apache-2.0
"""The area that a fleet stays in: its corners, and what covers the outside of it."""
import math
from itertools import pairwise

import pytest
from hypothesis import assume, given, strategies as st

from uav_task_alloc import Task, Uav, plan
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.fence_area import area_corners, outside_rings, zones_outside
from uav_task_alloc.geometry.frames import Origin, to_geodetic
from uav_task_alloc.geometry.polygon import contains_point, edges, is_simple, signed_area
from uav_task_alloc.geometry.polyline import segment_distance

ORIGIN = Origin(47.4, 8.5, 500.0)
grid = st.integers(-3, 3).map(float)
places = st.floats(-6.0, 6.0)


def entries(*corners):
    return ['{:.9f},{:.9f}'.format(*to_geodetic(ORIGIN, (x, y, 0.0))[:2]) for x, y in corners]


@given(st.lists(st.tuples(grid, grid), min_size=3, max_size=8), places, places)
def test_each_point_is_inside_the_area_or_covered(corners, x, y):
    assume(is_simple(corners) and signed_area(corners) != 0.0)
    ring = tuple(corners) if signed_area(corners) > 0.0 else tuple(corners[::-1])
    west, east = outside_rings(ring, 10.0)
    assert is_simple(west)
    assert is_simple(east)
    assume(all(segment_distance((x, y), a, b) > 1e-6
               for each in (ring, west, east) for a, b in edges(each)))
    covered = contains_point(west, (x, y)) or contains_point(east, (x, y))
    assert covered != contains_point(ring, (x, y))


@given(st.lists(st.tuples(grid, grid), min_size=3, max_size=8), places, places, places, places)
def test_no_leg_leaves_the_area_between_the_two(corners, ax, ay, bx, by):
    """Each point of a leg from outside to outside is covered by one that covers the next, too."""
    assume(is_simple(corners) and signed_area(corners) != 0.0)
    ring = tuple(corners) if signed_area(corners) > 0.0 else tuple(corners[::-1])
    rings = outside_rings(ring, 10.0)
    leg = [(ax + (bx - ax) * k / 200, ay + (by - ay) * k / 200) for k in range(201)]
    for a, b in pairwise(leg):
        if all(not contains_point(ring, p) and min(
                segment_distance(p, *edge) for edge in edges(ring)) > 0.2 for p in (a, b)):
            assert any(contains_point(each, a) and contains_point(each, b) for each in rings)


def test_a_plan_in_python_stays_inside():
    square = [(0.0, 0.0), (0.0, 500.0), (500.0, 500.0), (500.0, 0.0)]
    found = plan([Uav('u', (100.0, 100.0, 50.0))], [
        Task('in', (400.0, 400.0, 50.0)), Task('out', (600.0, 400.0, 50.0))],
        zones_outside(square), budget=0.01)
    assert found.routes == {'u': ('in',)}
    assert zones_outside([]) == ()


@pytest.mark.parametrize('order', [1, -1])
def test_corners_are_counter_clockwise_metres(order):
    square = [(0.0, 0.0), (800.0, 0.0), (800.0, 600.0), (0.0, 600.0)][::order]
    found = area_corners(entries(*square), ORIGIN)
    assert signed_area(found) == pytest.approx(480_000.0, rel=1e-6)
    assert max(min(math.dist(a, b) for b in square) for a in found) < 0.05


def test_no_entries_are_no_area():
    assert area_corners([], ORIGIN) == ()


@pytest.mark.parametrize(('wrong', 'expected'), [
    (['47.4;8.5'] * 3, '`LATITUDE,LONGITUDE` in degrees'),
    (['91.0,8.5'] * 3, '`LATITUDE,LONGITUDE` in degrees'),
    (entries((0, 0), (9, 9)), 'at least 3 corners'),
    (entries((0, 0), (9, 9), (9, 0), (0, 9)), 'edges that do not cross'),
    (entries(*((math.cos(k), math.sin(k)) for k in range(21))), 'at most 20 corners')])
def test_what_is_no_area_is_refused(wrong, expected):
    with pytest.raises(InvalidValue, match=expected):
        area_corners(wrong, ORIGIN)
