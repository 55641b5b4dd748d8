# SPDX-License-Identifier: Apache-2.0
"""Areas are covered by strips, around holes and zones, and what is wrong with one is named."""
import math
import random

import pytest
from fields import HEIGHT, Raster, field, random_field

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.work.pieces import pieces_of

SQUARE = [(0.0, 0.0), (300.0, 0.0), (300.0, 200.0), (0.0, 200.0)]


def test_a_rectangle_gets_strips_along_its_longer_side():
    pieces = pieces_of(field(SQUARE, 50.0))
    assert [piece.id for piece in pieces] == ['f#1', 'f#2', 'f#3', 'f#4']
    assert all(piece.path_length == pytest.approx(300.0) and piece.reversible for piece in pieces)
    assert [piece.position[1] for piece in pieces] == pytest.approx([25.0, 75.0, 125.0, 175.0])
    assert sum(piece.value for piece in pieces) == pytest.approx(1.0)
    assert {piece.position[2] for piece in pieces} == {HEIGHT}


def test_a_given_direction_is_kept():
    pieces = pieces_of(field(SQUARE, 50.0, direction=math.pi / 2))
    assert len(pieces) == 6
    assert all(piece.path[0][0] == pytest.approx(piece.path[1][0]) for piece in pieces)


def test_the_same_work_is_cut_the_same_far_from_the_origin():
    near = pieces_of(field(SQUARE, 30.0))
    far = pieces_of(field([(x + 1e6, y - 2e6) for x, y in SQUARE], 30.0))
    assert [piece.path_length for piece in far] == pytest.approx(
        [piece.path_length for piece in near])


@pytest.mark.parametrize('seed', range(12))
def test_what_can_be_reached_is_covered_and_no_way_enters_a_zone(seed):
    work, zones = random_field(random.Random(seed))
    clearance = 5.0 * (seed % 2)
    raster = Raster(work, zones, clearance)
    pieces = pieces_of(work, zones, clearance)
    for piece in pieces:
        raster.fly(piece.path, work.strip_width)
        assert path_is_clear(piece.path, zones, clearance)
    assert raster.share() >= 0.995
    assert pieces == pieces_of(work, zones, clearance)


def test_strips_are_as_wide_as_allowed_where_that_shortens_them():
    ends = [(0.0, 0.0), (400.0, 0.0), (200.0, 170.0)]  # 4.25 strips high
    pieces = pieces_of(field(ends, 40.0, direction=0.0))
    assert [piece.position[1] for piece in pieces] == pytest.approx(
        [20.0, 60.0, 100.0, 140.0, 165.0])
    even = sum(400.0 * (1.0 - k / 5) for k in range(5))
    assert sum(piece.path_length for piece in pieces) < 0.9 * even
    assert covered(ends, 40.0) >= 0.995


def test_strips_are_equal_where_that_is_not_longer():
    pieces = pieces_of(field([(0.0, 0.0), (400.0, 0.0), (400.0, 170.0), (0.0, 170.0)], 40.0))
    assert [piece.position[1] for piece in pieces] == pytest.approx(
        [17.0, 51.0, 85.0, 119.0, 153.0])


@pytest.mark.parametrize('slant', [50.0, 150.0, 400.0])
def test_pointed_ends_are_left_out_as_far_as_the_field_is_still_covered(slant):
    ends = [(0.0, 0.0), (400.0, 0.0), (400.0 + slant, 200.0), (slant, 200.0)]
    whole = 400.0 + slant / 5  # of a strip
    pieces = pieces_of(field(ends, 40.0, direction=0.0))
    lengths = [piece.path_length for piece in pieces]
    assert lengths == pytest.approx([lengths[0]] * 5)  # all ends alike
    assert lengths[0] < whole - 0.2 * slant / 5
    assert 0.996 <= covered(ends, 40.0) <= 0.9975


def test_a_field_that_zones_cover_mostly_is_covered_as_well():
    work, zones = random_field(random.Random(4711097))  # a quarter of its box is free
    clearance = 5.0
    raster = Raster(work, zones, clearance, 600)
    for piece in pieces_of(work, zones, clearance):
        raster.fly(piece.path, work.strip_width)
    assert raster.share() >= 0.996


def test_no_way_leads_into_a_notch_that_is_narrower_than_the_margins():
    work = field([(-100.0, -100.0), (100.0, -100.0), (100.0, 100.0), (-100.0, 100.0)], 4.0,
                 direction=math.pi / 2)
    notched = [(-60.0, -40.0), (60.0, -40.0), (60.0, 40.0), (5.0, 40.0), (4.0, 0.0), (3.0, 30.0),
               (0.0, 5.0), (-5.0, 40.0), (-60.0, 40.0)]
    zone = ThreatZone.polygon('z', notched, 0.0, 100.0, 2.0)
    assert all(path_is_clear(piece.path, [zone], 5.0) for piece in pieces_of(work, [zone], 5.0))


@pytest.mark.parametrize('seed', [5813127, 5813191])
def test_no_way_leads_into_a_notch_of_a_random_zone(seed):
    work, zones = random_field(random.Random(seed))
    assert all(path_is_clear(piece.path, zones, 5.0) for piece in pieces_of(work, zones, 5.0))


def covered(outer, width):
    """Share of a field that its strips along x cover."""
    work = field(outer, width, direction=0.0)
    raster = Raster(work, (), 0.0, 600)
    for piece in pieces_of(work):
        raster.fly(piece.path, width)
    return raster.share()


def test_a_strip_that_meets_a_hole_is_cut_in_two():
    hole = [(100.0, 50.0), (200.0, 50.0), (200.0, 150.0), (100.0, 150.0)]
    pieces = pieces_of(field(SQUARE, 50.0, [hole], direction=0.0))
    assert [round(piece.path_length) for piece in pieces] == [300, 100, 100, 100, 100, 300]


def test_a_zone_changes_no_strip_elsewhere():
    work = field([(0.0, 0.0), (300.0, 40.0), (280.0, 230.0), (10.0, 200.0)], 20.0, direction=1.5)
    zone = ThreatZone.cylinder('z', (250.0, 120.0), 25.0, 0.0, 100.0)
    before, after = ({piece.path for piece in pieces_of(work, zones)
                      if all(x < 220.0 for x, _, _ in piece.path)} for zones in ([], [zone]))
    assert before == after != set()


def test_an_area_inside_a_zone_is_cut_as_if_there_were_none():
    zone = ThreatZone.cylinder('z', (150.0, 100.0), 1000.0, 0.0, 100.0)
    assert pieces_of(field(SQUARE, 50.0), [zone]) == pieces_of(field(SQUARE, 50.0))


def test_a_zone_above_or_below_the_flight_is_no_hole():
    zones = [ThreatZone.cylinder('low', (150.0, 100.0), 50.0, 0.0, HEIGHT - 10.0),
             ThreatZone.cylinder('high', (150.0, 100.0), 50.0, HEIGHT + 10.0, 500.0)]
    assert pieces_of(field(SQUARE, 50.0), zones) == pieces_of(field(SQUARE, 50.0))
    assert pieces_of(field(SQUARE, 50.0), zones, 11.0) != pieces_of(field(SQUARE, 50.0))


def test_a_field_narrower_than_a_strip_is_one_strip():
    pieces = pieces_of(field([(0.0, 0.0), (100.0, 0.0), (100.0, 5.0), (0.0, 5.0)], 50.0))
    assert len(pieces) == 1
    assert pieces[0].path_length == pytest.approx(100.0)


def test_a_round_field_of_many_corners_is_cut():
    corners = [(1000.0 * math.cos(k / 50.0 * math.pi), 1000.0 * math.sin(k / 50.0 * math.pi))
               for k in range(100)]
    assert len(pieces_of(field(corners, 5.0))) == 400


@pytest.mark.parametrize(('corners', 'width', 'holes', 'text'), [
    ([(0, 0), (10, 10), (10, 0), (0, 10)], 5.0, (), 'edges that do not cross or touch'),
    (SQUARE[:2], 5.0, (), 'at least 3 corners'),
    (SQUARE, 0.0, (), r'task f: strip_width = 0.0: expected a number in \(0, inf\]'),
    (SQUARE, 0.1, (), r'task f: strip_width = 0.1: expected at least 0.2 m: more than 1000'),
    (SQUARE, 5.0, [[(290, 190), (310, 190), (300, 150)]], 'corners inside of path'),
    (SQUARE, 5.0, [[(500, 0), (510, 0), (510, 10)]], r'task f: holes\[0\] = .*inside of path'),
    (SQUARE, 5.0, [[(10, 10), (20, 20)]], 'at least 3 corners'),
    (SQUARE, math.nan, (), 'strip_width'),
])
def test_what_is_wrong_is_named(corners, width, holes, text):
    with pytest.raises(InvalidValue, match=text):
        pieces_of(field(corners, width, holes))


def test_corners_are_at_one_height():
    work = field(SQUARE, 50.0)
    with pytest.raises(InvalidValue, match='at one height'):
        type(work)(work.task, work.kind, [*work.path[:3], (0.0, 200.0, 90.0)], (), 50.0)
