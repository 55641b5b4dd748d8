# SPDX-License-Identifier: Apache-2.0
"""Lines and orbits as pieces, around zones; payloads and geometry of other kinds are refused."""
import math

import pytest

from uav_task_alloc.actions import Action
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.work.pieces import Work, pieces_of
from uav_task_alloc.work.values import Kind

LINE = (0.0, 0.0, 50.0), (300.0, 0.0, 60.0), (300.0, 400.0, 50.0)
ZONES = [ThreatZone.cylinder('c', (150.0, 10.0), 40.0, 0.0, 100.0, margin=5.0),
         ThreatZone.hemisphere('h', (300.0, 200.0, 0.0), 80.0),
         ThreatZone.polygon('p', [(280, 380), (320, 380), (320, 420), (280, 420)], 0.0, 20.0)]


def line(**more):
    return Work(Task('l', LINE[0], 4.0, service_time=8.0), Kind.LINE, LINE, **more)


def test_a_line_is_one_piece_that_is_flown_from_either_end():
    piece, = pieces_of(line())
    assert (piece.id, piece.path, piece.reversible) == ('l#1', LINE, True)
    assert (piece.value, piece.service_time) == (4.0, 8.0)


def test_a_divisible_line_is_cut_at_its_points():
    pieces = pieces_of(line(divisible=True))
    assert [piece.path for piece in pieces] == [LINE[:2], LINE[1:]]
    assert [piece.value for piece in pieces] == pytest.approx([1.714, 2.286], abs=1e-3)


@pytest.mark.parametrize('divisible', [False, True])
def test_of_a_line_through_zones_what_is_outside_is_flown(divisible):
    pieces = pieces_of(line(divisible=divisible), ZONES, 2.0)
    assert all(path_is_clear(piece.path, ZONES, 2.0) for piece in pieces)
    whole, = pieces_of(line())
    inside = 2 * math.sqrt(47.0**2 - 10.0**2) + 2 * math.sqrt(82.0**2 - 55.0**2)
    assert sum(piece.path_length for piece in pieces) == pytest.approx(
        whole.path_length - inside, rel=0.01)
    assert len(pieces) == (4 if divisible else 3)


def test_a_line_that_only_passes_over_a_zone_is_whole():
    assert len(pieces_of(line(), ZONES[2:], 2.0)) == 1


def test_an_orbit_is_a_closed_polygon_clockwise_with_the_camera_on_its_centre():
    task = Task('o', (10.0, 20.0, 30.0), actions=(Action('video'),))
    piece, = pieces_of(Work(task, Kind.ORBIT, radius=40.0, turns=2.0))
    assert piece.path[0] == pytest.approx((50.0, 20.0, 30.0))
    assert piece.path[-1] == pytest.approx(piece.path[0])
    assert piece.path[1][1] < 20.0
    assert piece.path_length == pytest.approx(4 * math.pi * 40.0, rel=0.01)
    assert [action.name for action in piece.actions] == ['roi', 'video']
    assert not piece.reversible


def test_an_orbit_is_cut_by_a_zone():
    work = Work(Task('o', (0.0, 0.0, 30.0)), Kind.ORBIT, radius=100.0, turns=-1.0,
                direction=math.pi)
    pieces = pieces_of(work, [ThreatZone.cylinder('c', (100.0, 0.0), 30.0, 0.0, 100.0)])
    assert len(pieces) == 2
    assert pieces[0].path[1][1] < 0.0


def test_a_point_is_the_task():
    task = Task('p', (0.0, 0.0, 30.0), payload=1.0)
    assert pieces_of(Work(task)) == (task,)


@pytest.mark.parametrize(('given', 'text'), [
    ({'kind': Kind.LINE}, 'at least 2 points'),
    ({'kind': Kind.LINE, 'path': [LINE[0], LINE[0]]}, r'task t: path\[1\] = .*0.01 m or more'),
    ({'kind': Kind.LINE, 'path': LINE, 'strip_width': 3.0}, 'expected none for LINE'),
    ({'kind': Kind.ORBIT}, r'radius = 0.0: expected a number in \[1, 5000\]'),
    ({'kind': Kind.ORBIT, 'radius': 300.0, 'turns': 50.0}, 'turns = 50.0: expected at most 20.8'),
    ({'kind': Kind.ORBIT, 'radius': 30.0, 'path': LINE}, 'expected none for ORBIT'),
    ({'path': LINE}, 'expected none for POINT'),
    ({'divisible': True}, 'expected false for POINT'),
    ({'kind': 1}, 'one of Kind.POINT'),
    ({'kind': Kind.LINE, 'path': [(0.0, 0.0), (1.0, 1.0)]}, 'three coordinates'),
    ({'kind': Kind.AREA, 'direction': 90.0}, 'direction = 90.0'),
])
def test_what_is_wrong_is_named(given, text):
    with pytest.raises(InvalidValue, match=text):
        Work(Task('t', (0.0, 0.0, 30.0)), **given)


def test_only_a_point_takes_a_payload():
    with pytest.raises(InvalidValue, match=r'payload = 1\.0: expected 0 for LINE'):
        Work(Task('t', LINE[0], payload=1.0), Kind.LINE, LINE)
