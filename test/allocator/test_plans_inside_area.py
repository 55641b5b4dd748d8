# SPDX-License-Identifier: Apache-2.0
"""Plans stay inside of `fence_area`: tasks outside of it wait, ways go around its corners."""
from itertools import pairwise

import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.fence_area import area_corners
from uav_task_alloc.geometry.frames import Origin, to_geodetic
from uav_task_alloc.geometry.polygon import contains_point, edges, segments_cross
from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.values import Kind

DEFAULT = AllocatorParams()
ORIGIN = Origin(DEFAULT.origin__latitude, DEFAULT.origin__longitude,
                DEFAULT.origin__altitude_amsl)
# two arms, open to the north
U = (-200.0, -200.0), (1200.0, -200.0), (1200.0, 1000.0), (700.0, 1000.0), (700.0, 200.0), (
    300.0, 200.0), (300.0, 1000.0), (-200.0, 1000.0)
AREA = tuple('{:.9f},{:.9f}'.format(*to_geodetic(ORIGIN, (x, y, 0.0))[:2]) for x, y in U)
CORNERS = area_corners(AREA, ORIGIN)


def a_driver(saved=None, **more):
    return AllocatorDriver(saved, plan, fence_area=AREA, solve_budget=0.05, **more)


def stays_inside(points):
    ground = [point[:2] for point in points]
    return all(contains_point(CORNERS, point) for point in ground) and not any(
        segments_cross(a, b, *edge) for a, b in pairwise(ground) for edge in edges(CORNERS))


def points_of(driver, uav_id):
    flown = driver.lists[uav_id]
    points = [driver.world.uav_record(uav_id).report.position]
    for stop in flown.stops:
        points += [*stop.through.via, stop.task.position, *stop.task.path]
    return [*points, *flown.end_via]


def test_the_way_to_the_other_arm_stays_inside():
    driver = a_driver(route_end='home')
    driver.uav('a', 0.0, 800.0, 50.0, home=(0.0, 800.0, 0.0))
    driver.add(('t1', 1000, 800))
    driver.settle()
    points = points_of(driver, 'a')
    assert driver.route('a') == ('t1',)
    assert len(points) >= 4
    assert stays_inside([*points, (0.0, 800.0, 0.0)])


def test_a_task_outside_waits_and_says_why():
    driver = a_driver()
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('in', 100, 100), ('out', 500, 600), ('far', 5000, 0))
    driver.settle()
    assert driver.route('a') == ('in',)
    for task_id in ('out', 'far'):
        assert 'inside zone outside of fence_area' in driver.reason(task_id)


def test_a_uav_that_starts_outside_gets_no_tasks():
    driver = a_driver()
    driver.uav('a', 500.0, 600.0, 0.0, standby=True)
    driver.add(('in', 100, 100))
    driver.settle()
    assert driver.state('in') == 'UNASSIGNED'
    assert any('a is on the ground inside zone outside of fence_area' in note
               for note in driver.notes)


def test_work_is_cut_at_its_border():
    driver = a_driver()
    driver.uav('a', 0.0, 0.0, 50.0)
    ends = (0.0, 700.0, 50.0), (1000.0, 700.0, 50.0)
    driver.add(Work(Task('line', ends[0]), Kind.LINE, ends))
    driver.settle()
    pieces = [stop.task for stop in driver.lists['a'].stops]
    assert len(pieces) == 2
    assert all(stays_inside(piece.path) for piece in pieces)
    assert stays_inside(points_of(driver, 'a'))


def test_zones_are_announced_stored_and_counted_without_it():
    driver = a_driver()
    zone = ThreatZone.cylinder('z', (100.0, 100.0), 20.0)
    driver.world.set_zones([zone], (), driver.now)
    assert list(driver.world.airspace.zones) == ['z']
    assert len(driver.world.airspace.no_fly_zones()) == 3


def test_an_invalid_area_ends_the_start():
    with pytest.raises(InvalidValue, match='fence_area'):
        AllocatorDriver(fence_area=('47.4,8.5', 'x'))
