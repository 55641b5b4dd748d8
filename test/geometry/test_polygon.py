# SPDX-License-Identifier: Apache-2.0
"""Polygons: orientation, area, simplicity and containment, also far from the origin."""
import math
from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry import polygon
from uav_task_alloc.geometry.obstacles import in_polygon, pack
from uav_task_alloc.geometry.polygon import (
    contains_point,
    edges,
    is_simple,
    orientation,
    segments_cross,
    signed_area,
)
from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.geometry.zones import outline
from uav_task_alloc.model import ThreatZone

SQUARE = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
CONCAVE = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (5.0, 2.0), (0.0, 10.0)]
grid = st.integers(-3, 3).map(float)
corner_lists = st.lists(st.tuples(grid, grid), min_size=3, max_size=7)


def test_orientation_is_positive_to_the_left_and_zero_on_the_line():
    assert orientation((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)) == 1.0
    assert orientation((0.0, 0.0), (1.0, 0.0), (0.0, -1.0)) == -1.0
    assert orientation((0.0, 0.0), (1.0, 1.0), (7.0, 7.0)) == 0.0


def test_segments_that_only_touch_do_not_cross():
    assert segments_cross((0.0, 0.0), (2.0, 2.0), (0.0, 2.0), (2.0, 0.0))
    assert not segments_cross((0.0, 0.0), (2.0, 2.0), (1.0, 1.0), (2.0, 0.0))
    assert not segments_cross((0.0, 0.0), (2.0, 0.0), (1.0, 0.0), (3.0, 0.0))


def test_the_area_is_negative_clockwise():
    assert signed_area(SQUARE) == 100.0
    assert signed_area(SQUARE[::-1]) == -100.0
    assert signed_area(CONCAVE) == 60.0


@pytest.mark.parametrize('away', [1e3, 1e7, 9e7])
@pytest.mark.parametrize('order', [1, -1])
def test_a_small_polygon_far_from_the_origin_keeps_its_area_and_orientation(away, order):
    """Products of absolute coordinates lost it: zones were refused, or got no outline."""
    corners = [(away + x / 32, y / 32 - away) for x, y in SQUARE][::order]
    assert signed_area(corners) == order * 100.0 / 1024
    rim = outline(ThreatZone.polygon('z', corners), 1.0)
    assert signed_area(rim) > 0.0
    assert len(rim) == 8


def have_a_common_point(a, b, c, d):
    """Of two segments with integer ends, by solving a + s (b - a) = c + t (d - c) exactly."""
    (ux, uy), (vx, vy), (wx, wy) = (
        [Fraction(q) - Fraction(p) for p, q in zip(*two, strict=True)]
        for two in ((a, b), (c, d), (a, c)))
    determinant = ux * vy - uy * vx
    if determinant:
        return (0 <= (wx * vy - wy * vx) / determinant <= 1
                and 0 <= (wx * uy - wy * ux) / determinant <= 1)
    return any(segment_distance(p, q, r) < 1e-9
               for p, q, r in ((a, c, d), (b, c, d), (c, a, b), (d, a, b)))


def brute_force_is_simple(corners):
    """All pairs of edges: neighbours may share their corner only, others keep apart."""
    ring, last = list(edges(corners)), len(corners) - 1
    for (i, (a, b)), (j, (c, d)) in combinations(enumerate(ring), 2):
        if a == b or c == d:
            return False
        if j - i in (1, last):
            one, shared, two = (a, b, d) if b == c else (b, a, c)
            u, v = np.subtract(one, shared), np.subtract(two, shared)
            if u[0] * v[1] == u[1] * v[0] and u @ v > 0.0:
                return False
        elif have_a_common_point(a, b, c, d):
            return False
    return True


@settings(max_examples=500)
@given(corner_lists)
def test_a_polygon_is_simple_where_no_edges_meet_by_brute_force(corners):
    assert is_simple(corners) == brute_force_is_simple(corners)
    assert is_simple(corners[::-1]) == is_simple(corners)


@pytest.fixture(scope='module')
def compiled():
    """Compiles the kernel before hypothesis limits the time of an example."""
    packed = pack((ThreatZone.polygon('z', CONCAVE),))
    in_polygon(packed.rows[0], 1.0, 5.0)


@pytest.mark.usefixtures('compiled')
@given(corner_lists.filter(lambda corners: is_simple(corners)), grid, grid)
def test_kernels_and_python_agree_on_what_is_inside(corners, x, y):
    assume(signed_area(corners) > 0.0)
    packed = pack((ThreatZone.polygon('z', corners),))
    assert contains_point(corners, (x + 0.25, y + 0.125)) == in_polygon(
        packed.rows[0], x + 0.25, y + 0.125)


def test_a_notch_is_outside():
    assert contains_point(CONCAVE, (1.0, 5.0))
    assert not contains_point(CONCAVE, (5.0, 5.0))
    assert not contains_point(CONCAVE, (11.0, 5.0))


def test_finding_31_edges_far_apart_are_not_compared(monkeypatch):
    compared, count = [], 3000
    meet = polygon.edges_meet
    monkeypatch.setattr(polygon, 'edges_meet', lambda *given, **more: (
        compared.append(given), meet(*given, **more))[1])
    angles = [2.0 * math.pi * k / count for k in range(count)]
    ThreatZone.polygon('round', [(math.cos(angle), math.sin(angle)) for angle in angles])
    assert len(compared) <= 10 * count


@pytest.mark.parametrize('corners', [
    [(0, 0), (10, 0), (10, 10), (5, -1)], [(0, 0), (10, 0), (10, 10), (5, 0)],
    [(0, 0), (10, 0), (4, 0), (4, 9)], [(5, 5), (0, 0), (9, 0), (5, 5), (5, 9)]])
def test_finding_31_polygons_that_touch_themselves_are_refused(corners):
    for k in range(len(corners)):
        for turned in (corners[k:] + corners[:k], (corners[k:] + corners[:k])[::-1]):
            with pytest.raises(InvalidValue, match='edges that do not cross or touch'):
                ThreatZone.polygon('z', turned)
