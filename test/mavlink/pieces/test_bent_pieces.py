# SPDX-License-Identifier: Apache-2.0
"""Ways that bend around a zone, replaced lists while a vehicle is on them: no zone is entered."""
import math
from itertools import pairwise

import pytest
from flight_bench import FlightBench
from piece_bench import HEIGHT, TRIGGER, Track, piece

from uav_task_alloc.geometry.polyline import nearest_on_segment, segment_fraction
from uav_task_alloc.mavlink.mission.diff import DiffKind, MissionDiff
from uav_task_alloc.mavlink.mission.flown_meanwhile import resumed_at
from uav_task_alloc.mavlink.mission.item import Item
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.mavlink.mission.way_approach import approach
from uav_task_alloc.model import ThreatZone

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
CENTER = (100.0, 150.0)
ZONE = ThreatZone.cylinder('tower', CENTER, 45.0, margin=5.0)
SAFE = 50.0  # [m] from the centre
AROUND = 62.0  # [m] from it, at which plans lead around it


def ring(begin, end, step=20, radius=AROUND):
    """Points around the zone from one compass angle to another [deg]."""
    count = max(1, round(abs(end - begin) / step))
    return [(CENTER[0] + radius * math.sin(a), CENTER[1] + radius * math.cos(a))
            for a in (math.radians(begin + (end - begin) * k / count) for k in range(count + 1))]


# south-east of the zone it begins, north of it it goes on to the west
BENT = piece('B', (160, 60), *ring(110, 20, 30), (90, 215), (-40, 215), actions=[TRIGGER])
ORBIT = piece('B', *ring(110, -250, 30))
VIA = tuple((x, y, HEIGHT) for x, y in ring(250, 150))  # to BENT from the west, south around
VIA_ORBIT = tuple((x, y, HEIGHT) for x, y in ring(250, 120))
WEST = piece('W', (-60, 120), (-60, 40), actions=[TRIGGER])
LATER = piece('L', (-80, 230), (-80, 300))
OTHER = piece('M', (-120, 230), (-120, 300))


def list_of(revision, *tasks, via):
    return TaskList(revision, tuple(
        MissionStop(t, via if t.id == 'B' else ()) for t in tasks))


def flying(kind, way, via):
    """A vehicle on its way to a piece from the west, south around the zone."""
    bench = FlightBench(kind, zones=(ZONE,), zones_known=True).discover()
    track = Track(bench)
    bench.assign(list_of(1, WEST, way, LATER, via=via))
    return bench, track


def metres_along(position, way):
    """How far along a way the nearest spot is [m], and how far away [m]."""
    best, at = (math.inf, 0.0), 0.0
    for a, b in pairwise(way):
        share = min(1.0, max(0.0, segment_fraction(position, a, b)))
        best = min(best, (math.dist(position, nearest_on_segment(position, a, b)),
                          at + share * math.dist(a, b)))
        at += math.dist(a, b)
    return best[1], best[0]


def until_along(bench, task, metres):
    """Fly until the vehicle is that far along the piece."""
    body = bench.vehicles[1].flight.body

    def there():
        along, away = metres_along(body.position, task.path)
        item = bench.onboard().progress.active
        return away < 12.0 and metres <= along < metres + 40.0 and (
            item is not None and item.task == 'B' and (item.along or metres == 0.0))
    assert bench.run(there, 300.0)


def nearest(track, since=0):
    """Least distance from the centre of the zone [m]."""
    return min(math.dist(p[:2], CENTER) for p in track.points[since:])


@BOTH
@pytest.mark.parametrize(('way', 'via'), [(BENT, VIA), (ORBIT, VIA_ORBIT)], ids=['bent', 'orbit'])
@pytest.mark.parametrize('metres', [0.0, 3.0, 60.0, 130.0, 190.0])
def test_a_list_replaced_on_a_bent_way_is_continued_along_it(kind, way, via, metres):
    bench, track = flying(kind, way, via)
    until_along(bench, way, metres)
    bench.assign(list_of(2, way, OTHER, LATER, via=via))
    assert bench.run(lambda: 'B' in bench.completed(), 300.0)
    assert nearest(track) > SAFE
    assert min(track.times_flown(way)) >= 1


@BOTH
def test_detours_planned_while_it_was_beside_its_way_are_not_flown_to(kind):
    bench, track = flying(kind, BENT, VIA)
    until_along(bench, BENT, 150.0)
    bench.assign(list_of(2, BENT, OTHER, via=((170.0, 90.0, HEIGHT),)))
    assert bench.run(lambda: 'B' in bench.completed(), 300.0)
    assert nearest(track) > SAFE
    assert track.times_flown(BENT).count(1) >= len(track.times_flown(BENT)) - 4


@BOTH
def test_a_bent_way_is_continued_from_elsewhere_around_the_zone(kind):
    bench, track = flying(kind, BENT, VIA)
    until_along(bench, BENT, 150.0)
    south = piece('S', (160, 30), (100, 30))
    bench.assign(TaskList(2, (MissionStop(south, tuple(
        (x, y, HEIGHT) for x, y in ring(60, 160))), MissionStop(BENT))))
    assert bench.run(lambda: bench.completed() == ['W', 'S', 'B'], 400.0)
    assert nearest(track) > SAFE
    assert min(track.times_flown(BENT)) >= 1


def test_px4_does_not_fly_back_for_a_mission_that_it_took_late():
    bench, track = flying('px4', BENT, VIA)
    body = bench.vehicles[1].flight.body
    assert bench.run(lambda: 'W' in bench.completed() and body.position[0] > 120.0, 300.0)
    bench.line.tampers.append(lambda direction, m, now: [] if (
        m.get_type() == 'MISSION_ITEM_INT' and metres_along(body.position, BENT.path)[0] < 70.0
    ) else None)
    bench.assign(list_of(2, BENT, OTHER, LATER, via=VIA))
    assert not bench.onboard().progress.active.along
    assert bench.run(lambda: 'B' in bench.completed(), 300.0)
    assert nearest(track) > SAFE
    assert set(track.times_flown(BENT)) == {1}


WAY = tuple((float(x), float(y), HEIGHT) for x, y in ((160, 60), (160, 220), (40, 220)))
LEFT_AT = 160.0 + 60.0  # [m] from its first point, north of the zone
SOUTH = (100.0, 80.0, HEIGHT)


def points_to(place, begin=LEFT_AT, via=(), zones=(ZONE,), on_way=False):
    return approach(via, place, WAY, begin, zones, 15.0, on_way)


def test_a_way_is_continued_straight_where_no_zone_is_between():
    assert points_to((60.0, 260.0, HEIGHT)) == ()
    assert points_to(SOUTH, zones=()) == ()
    assert points_to((105.0, 221.0, HEIGHT), via=(SOUTH,), on_way=True) == ()


def test_from_elsewhere_it_comes_by_the_first_point_where_a_zone_is_between():
    assert points_to(SOUTH) == WAY[:2]
    assert points_to((0.0, 80.0, HEIGHT), via=(SOUTH,)) == (SOUTH, *WAY[:2])
    assert points_to(None) == WAY[:2]


def test_from_beside_the_way_it_flies_along_it():
    assert points_to((165.0, 100.0, HEIGHT)) == ((160.0, 100.0, HEIGHT), WAY[1])
    assert points_to((165.0, 100.0, HEIGHT), via=(SOUTH,)) == ((160.0, 100.0, HEIGHT), WAY[1])
    back = points_to((45.0, 222.0, HEIGHT), begin=40.0)
    assert back == ((45.0, 220.0, HEIGHT), WAY[1])


def test_the_detour_points_of_a_way_that_is_not_begun_are_kept():
    assert points_to(SOUTH, begin=0.0, via=((130.0, 70.0, HEIGHT),)) == ((130.0, 70.0, HEIGHT),)
    assert points_to((0.0, 0.0, HEIGHT), begin=0.0) == ()


def test_new_points_before_the_task_under_way_are_flown():
    old, new = mission(*'aAbB'), mission(*'xyabB')[1:]
    assert resumed_at(old, 3, MissionDiff(DiffKind.REPLACE, new, 0)) == 0


def mission(*names):
    """Items of tasks by letters; a capital completes."""
    return tuple(Item(16, x=ord(name), y=n, task=name.upper(), completes=name.isupper(),
                      position=(float(n), 0.0, 0.0)) for n, name in enumerate(names))


@pytest.mark.parametrize(('current', 'start', 'resumed'), [
    (4, 0, 2), (2, 0, 0), (4, 2, 2), (None, 0, 0), (6, 0, 0)])
def test_what_was_flown_during_the_upload_is_not_flown_again(current, start, resumed):
    old = mission(*'aAbbbBcC')
    new = old[2:6] + mission(*'dD')
    diff = MissionDiff(DiffKind.REPLACE, new, start)
    assert resumed_at(old, current, diff) == resumed
