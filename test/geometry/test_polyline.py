# SPDX-License-Identifier: Apache-2.0
"""Length of polylines, and which of their points lie ahead of a vehicle."""
import math
import subprocess
import sys
from fractions import Fraction
from itertools import groupby, pairwise

import pytest
from hypothesis import assume, given, settings, strategies as st

from uav_task_alloc.geometry.polyline import (
    points_passed,
    polyline_length,
    segment_distance,
    segment_fraction,
)

# a coarse grid: ties, doubled-back polylines, repeated points and points on vertices are frequent
grid = st.integers(-3, 3).map(float)
places = st.tuples(grid, grid, st.sampled_from([0.0, 1.0]))
polylines = st.lists(places, min_size=1, max_size=6)
UP = (0.0, 0.0, 9.0)
U_TURN = [(100.0, -10.0, 0.0), (100.0, 10.0, 0.0), (0.0, 10.0, 0.0)]


def nearest_spot(position, line):
    """(squared distance, segment, fraction of it) of the first nearest spot, exactly."""
    p = [Fraction(x) for x in position]
    best = None
    for k, (a, b) in enumerate(pairwise([[Fraction(x) for x in point] for point in line])):
        along = [q - r for r, q in zip(a, b, strict=True)]
        square = sum(d * d for d in along)
        share = sum((x - r) * d for x, r, d in zip(p, a, along, strict=True)) / square if (
            square) else Fraction(0)
        share = min(Fraction(1), max(Fraction(0), share))
        gap = sum((x - r - share * d) ** 2 for x, r, d in zip(p, a, along, strict=True))
        if best is None or gap < best[0]:
            best = gap, k, share
    return best


def without_repeats(points):
    return [point for point, _ in groupby(points)]


def brute_force_passed(position, points, start=None):
    """Vertices strictly before the first nearest spot, in exact arithmetic."""
    line = points if start is None else [start, *points]
    if len(line) < 2:
        return 0
    _, k, share = nearest_spot(position, line)
    return max(0, k + (share > 0) - (start is not None))


@settings(max_examples=1000)
@given(places, polylines, st.none() | places)
def test_points_passed_are_those_before_the_first_nearest_spot(position, points, start):
    assert points_passed(position, points, start) == brute_force_passed(position, points, start)


@settings(max_examples=300)
@given(st.lists(st.tuples(*[st.floats(-1000, 1000)] * 3), min_size=2, max_size=6),
       st.floats(0.0, 1.0), st.data())
def test_points_passed_of_a_vehicle_on_the_polyline_are_those_it_has_flown_over(
        line, share, data):
    k = data.draw(st.integers(0, len(line) - 2))
    position = tuple(a + share * (b - a) for a, b in zip(line[k], line[k + 1], strict=True))
    others = [segment_distance(position, a, b)
              for j, (a, b) in enumerate(pairwise(line)) if j != k]
    assume(min(others, default=1.0) > 1e-3)  # it is on one segment only
    assert points_passed(position, line[1:], line[0]) == k


@given(places, polylines, st.none() | places)
def test_the_last_point_is_never_passed(position, points, start):
    assert 0 <= points_passed(position, points, start) < len(points)


@given(places, polylines)
def test_repeated_points_do_not_change_what_is_ahead(position, points):
    twice = [point for point in points for _ in range(2)]
    ahead = points[points_passed(position, points):]
    assert without_repeats(twice[points_passed(position, twice):]) == without_repeats(ahead)


@pytest.mark.parametrize(('position', 'passed'), [
    ((0.0, 0.0, 0.0), 0), ((10.0, 10.0, 0.0), 0), ((15.0, 5.0, 0.0), 1), ((20.0, 0.0, 0.0), 1),
    ((29.0, 0.0, 0.0), 2), ((40.0, 0.0, 0.0), 2)])
def test_points_passed_along_a_detour(position, passed):
    assert points_passed(position, [(10.0, 10.0, 0.0), (20.0, 0.0, 0.0), (30.0, 0.0, 0.0)]) == (
        passed)


@pytest.mark.parametrize(('position', 'passed'), [
    ((0.0, -10.0, 0.0), 0), ((60.0, -9.0, 0.0), 0), ((100.0, 1.0, 0.0), 1), ((60.0, 9.0, 0.0), 2)])
def test_a_u_turn_around_a_wall_is_not_cut_short_where_its_start_is_known(position, passed):
    assert points_passed(position, U_TURN, start=(0.0, -10.0, 0.0)) == passed


def test_a_point_whose_next_leg_leads_back_is_not_passed_before_it_is_reached():
    """The angle at a point alone says nothing: the third leg leads past the vehicle."""
    points = [(0.0, 100.0, 0.0), (300.0, 100.0, 0.0), (300.0, -100.0, 0.0)]
    assert points_passed((10.0, 95.0, 0.0), points) == 1


def test_on_a_doubled_back_polyline_the_first_time_counts():
    out, back = (90.0, 0.3, 0.0), (0.0, 0.0, 0.0)
    middle = (9.0, 0.03, 0.0)
    assert points_passed(middle, [back, out, back]) == 1
    assert points_passed(middle, [out, back], start=back) == 0


def test_nothing_is_passed_without_points_or_without_a_position():
    assert points_passed(UP, []) == 0
    assert points_passed(UP, [UP]) == 0
    assert points_passed((math.nan, 0.0, 0.0), U_TURN) == 0


def test_the_length_is_the_sum_of_its_segments():
    assert polyline_length([]) == polyline_length([UP]) == 0.0
    assert polyline_length([(0.0, 0.0), (3.0, 4.0), (3.0, 4.0), (3.0, 5.0)]) == 6.0


@pytest.mark.parametrize(('point', 'fraction', 'distance'), [
    ((5.0, 2.0), 0.5, 2.0), ((-3.0, 4.0), -0.3, 5.0), ((13.0, 4.0), 1.3, 5.0)])
def test_a_point_projected_on_a_segment(point, fraction, distance):
    assert segment_fraction(point, (0.0, 0.0), (10.0, 0.0)) == pytest.approx(fraction)
    assert segment_distance(point, (0.0, 0.0), (10.0, 0.0)) == pytest.approx(distance)


def test_a_segment_without_length_is_a_point():
    assert segment_fraction((3.0, 4.0), (0.0, 0.0), (0.0, 0.0)) == 0.0
    assert segment_distance((3.0, 4.0), (0.0, 0.0), (0.0, 0.0)) == 5.0


def test_polylines_are_imported_without_the_compiler():
    code = 'import sys, uav_task_alloc.geometry.polyline; print("numba" in sys.modules)'
    assert subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          check=True).stdout == 'False\n'


@pytest.mark.parametrize(('position', 'velocity', 'passed'), [
    ((50.0, 60.0, 0.0), (-4.0, -8.0, 0.0), 0),  # it turns back to the first point
    ((50.0, 60.0, 0.0), (10.0, 1.0, 0.0), 1),  # to neither: as without a velocity
    ((50.0, 60.0, 0.0), (2.0, -1.5, 0.0), 1),  # to the last
    ((50.0, 60.0, 0.0), (0.0, 0.5, 0.0), 0),  # it stands
    ((50.0, 8.0, 0.0), (-10.0, 0.0, 0.0), 1),  # it follows the polyline
    ((50.0, 8.0, 0.0), (0.0, 0.0, 0.0), 1)])
def test_a_vehicle_off_the_polyline_has_not_passed_a_point_to_which_it_flies(
        position, velocity, passed):
    points = (20.0, 0.0, 0.0), (130.0, 0.0, 0.0)
    assert points_passed(position, points) == 1
    assert points_passed(position, points, velocity=velocity) == passed
