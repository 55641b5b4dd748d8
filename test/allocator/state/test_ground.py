# SPDX-License-Identifier: Apache-2.0
"""The allocator over terrain: heights above ground, refused tasks, legs that keep clear of it."""
import re
from itertools import pairwise

import numpy as np
import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.terrain import Terrain
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.values import Kind, Vertical

ORIGIN, STEP, NODES = Origin(47.0, 8.0, 500.0), 0.0002, 240
HUT = Task('hut', (900.0, 0.0, 10.0))
PEAK = Work(Task('peak', (0.0, 300.0, 60.0)), vertical=Vertical.TERRAIN)
PATH = Work(Task('path', (0.0, 0.0, 0.0)), Kind.LINE, (
    (-600.0, -500.0, 40.0), (600.0, -500.0, 40.0)), vertical=Vertical.TERRAIN)


def ridge():
    """A ridge 200 m high from south to north through the origin, 1.8 km to each side."""
    east = (np.arange(NODES) - NODES / 2) * STEP * 76_000.0
    heights = 500.0 + 200.0 * np.exp(-(east / 150.0)**2) + np.zeros((NODES, 1))
    return Terrain(heights, lambda longitude, latitude: (
        (longitude - ORIGIN.longitude) / STEP + NODES / 2,
        (ORIGIN.latitude - latitude) / STEP + NODES / 2), ORIGIN, 'ground.tif')


def fleet(saved=None, terrain=None, **params):
    return AllocatorDriver(saved, terrain=terrain or ridge(), **params)


def legs(driver, uav_id='a'):
    """(points) of each leg of the list of a UAV, with that home."""
    each, at, found = driver.world.list_of(uav_id), driver.world.uav(uav_id).position, []
    for stop in each.stops:
        found.append((at, *stop.leg.via, stop.entry))
        at = stop.exit
    return [*found, (at, *each.end_via, driver.world.uav(uav_id).home)] if each.returns else found


def check_clear(driver, clearance=30.0):
    ground = ridge()
    for points in legs(driver):
        for a, b in pairwise(points):
            assert a[:2] == b[:2] or ground.least_clearance(a, b)[0] >= clearance - 0.1, points


def test_lists_keep_clear_of_a_ridge_and_lead_home_over_it():
    driver = fleet(route_end='home')
    driver.uav('a', -900.0, 0.0, 0.5, standby=True)
    driver.add(HUT, PEAK, PATH)
    driver.settle()
    assert set(driver.world.list_of('a').task_ids) == {'hut', 'peak', 'path#1'}
    assert driver.world.list_of('a').returns
    check_clear(driver)
    assert max(z for points in legs(driver) for _, _, z in points) > 225.0
    before = driver.world.list_of('a')
    driver.uav('a', -880.0, 3.0, 21.0)  # on its way: nothing new
    driver.add(Task('late', (-1200.0, 0.0, 60.0)))
    driver.settle()
    assert driver.world.list_of('a').stops[0].leg.via == before.stops[0].leg.via


def test_heights_of_tasks_count_from_the_ground_and_survive_a_restart():
    driver, ground = fleet(), ridge()
    driver.uav('a', -900.0, 0.0, 50.0)
    driver.add(PEAK, PATH)
    assert ground.above_ground([driver.world.task_records()['peak'].task.position])[0] \
        == pytest.approx(60.0, abs=0.01)
    way = driver.world.task_records()['path#1'].task.path
    assert all(36.0 <= ground.least_clearance(a, b)[0] <= 44.0 for a, b in pairwise(way))
    assert [verdict.unchanged for verdict in driver.add(PEAK, PATH)] == [True, True]
    again = fleet(restored_state(driver.core.rows()))
    again.settle()
    assert again.world.task_records()['path#1'].task.path == way
    assert again.world.works.records['path'].work.vertical is Vertical.TERRAIN


@pytest.mark.parametrize(('item', 'why'), [
    (Task('low', (0.0, 0.0, 150.0)), r'task low: position = 150\.0: expected at least 200\.0 m'),
    (Task('far', (9000.0, 0.0, 50.0)), r'ground\.tif: it does not reach to \(9000, 0\)'),
    (Work(Task('deep', (0.0, 0.0, 0.0)), Kind.LINE, ((-900.0, 0.0, 50.0), (900.0, 0.0, 50.0))),
     'task deep#1: path = -1'),
    (Work(Task('off', (0.0, 0.0, 0.0)), Kind.LINE, ((0.0, 0.0, 50.0), (9000.0, 0.0, 50.0)),
          vertical=Vertical.TERRAIN), 'it does not reach')])
def test_tasks_below_the_ground_or_outside_the_raster_are_refused(item, why):
    driver = fleet()
    driver.uav('a', -900.0, 0.0, 50.0)
    verdict, other = driver.add(item, HUT)
    assert (verdict.accepted, other.accepted) == (False, True)
    assert re.search(why, verdict.reason), verdict.reason


def test_heights_above_ground_need_a_terrain():
    driver = AllocatorDriver()
    verdicts = driver.add(PEAK, PATH)
    assert [verdict.accepted for verdict in verdicts] == [False, False]
    assert all('ORIGIN: no terrain is given' in verdict.reason for verdict in verdicts)


def test_a_zone_over_the_ridge_is_flown_around_above_the_ground():
    driver = fleet()
    driver.uav('a', -900.0, 0.0, 0.5, standby=True)
    zone = ThreatZone.cylinder('air', (0.0, 0.0), 200.0, 150.0, 900.0)
    driver.world.set_zones([zone], (), driver.now)
    driver.add(HUT)
    driver.settle()
    points, = legs(driver)
    assert driver.world.airspace.paths().clear(*points)
    check_clear(driver)


def test_what_no_leg_reaches_over_the_ground_is_left_out_with_the_reason():
    driver = fleet(altitude_max=150.0)
    driver.uav('a', -900.0, 0.0, 0.5, standby=True)
    driver.add(HUT, Task('here', (-900.0, 300.0, 60.0)))
    driver.settle()
    assert driver.world.list_of('a').task_ids == ('here',)
    assert driver.world.task_records()['hut'].reason == (
        'no safe path for a: 30 m above the ground a zone or altitude_max = 150 m is in the way')


def test_a_uav_without_tasks_waits_above_the_ground():
    driver = fleet(anticipate='even', anticipate_area=(-200.0, -1000.0, 400.0, -400.0),
                   default_range=60_000.0)
    driver.uav('a', -700.0, -700.0, 60.0, home=(-700.0, -700.0, 0.0), authority='HELD',
               mode='HOLD')
    driver.settle(10.0)
    way = (-700.0, -700.0, 60.0), *driver.world.list_of('a').end_via
    assert len(way) > 1
    ground = ridge()
    for a, b in pairwise(way):
        assert a[:2] == b[:2] or ground.least_clearance(a, b)[0] >= 29.9, way
    assert ground.above_ground([way[-1]])[0] >= 29.9


def test_a_uav_that_stands_far_from_the_ground_is_named():
    driver = fleet()
    driver.uav('a', 0.0, 0.0, 0.0, standby=True)
    driver.uav('b', -900.0, 0.0, 0.5, standby=True)
    texts = [note.text for note in driver.core.collect().notes if 'stands' in note.text]
    assert texts[0].startswith('a stands 200 m below the ground of ground.tif: are its heights')
    assert len(texts) == 1


def test_a_list_made_without_terrain_is_raised_after_a_restart():
    flat = AllocatorDriver()
    flat.uav('a', -900.0, 0.0, 40.0)
    flat.add(HUT)
    flat.settle()
    assert flat.world.list_of('a').stops[0].leg.via == ()
    driver = fleet(restored_state(flat.core.rows()))
    driver.uav('a', -900.0, 0.0, 40.0)
    driver.settle()
    check_clear(driver)
    assert driver.world.list_of('a').stops[0].leg.via


def test_the_clearance_is_a_parameter_of_the_node():
    assert AllocatorParams().terrain_clearance == 30.0
    driver = fleet(terrain_clearance=80.0)
    driver.uav('a', -900.0, 0.0, 0.5, standby=True)
    driver.add(HUT)
    driver.settle()
    check_clear(driver, 80.0)
