# SPDX-License-Identifier: Apache-2.0
"""`plan --terrain` raises legs over the ground, and refuses tasks below it."""
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from uav_task_alloc import plan
from uav_task_alloc.cli.plan_pieces import with_pieces
from uav_task_alloc.cli.plan_terrain import (
    check_ground,
    ground_of,
    over_terrain,
    plan_over_terrain,
)
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.model.route_stops import route_points
from uav_task_alloc.scenario import parse
from uav_task_alloc.terrain import Terrain
from uav_task_alloc.work.pieces import Work, pieces_of
from uav_task_alloc.work.values import Kind, Vertical

SCENARIO = """
uavs:
  - {id: uav_1, position: [-900, 0, 0.5]}
tasks:
  - {id: hut, position: [900, 0, 10]}
  - {id: top, position: [-400, 900, 60], vertical: terrain}
  - {id: path, kind: line, vertical: terrain, path: [[-600, -500, 40], [600, -500, 40]]}
  - {id: field, kind: area, vertical: terrain, altitude: 80, strip_width: 60,
     path: [[-200, -200], [200, -200], [200, 100], [-200, 100]]}
altitude_max: 500
"""


def ridge(origin, peak=200.0):
    """A ridge from south to north through the origin, 300 m wide, on a plain at its height."""
    step, nodes = 0.0002, 220
    y, x = np.mgrid[0:nodes, 0:nodes]
    west, north = origin.longitude - step * nodes / 2, origin.latitude + step * nodes / 2
    east = (x - nodes / 2) * step * 75_000.0
    heights = origin.altitude_amsl + peak * np.exp(-(east / 150.0)**2) + 0.0 * y
    return Terrain(heights, lambda longitude, latitude: ((longitude - west) / step,
                                                         (north - latitude) / step), origin)


def test_legs_and_ways_keep_clear_of_a_ridge():
    given = parse(SCENARIO)
    terrain = ridge(given.origin)
    loaded = with_pieces(given, terrain)
    assert check_ground(loaded, terrain, 30.0) == []
    tasks = {timed.task.id: timed.task for timed in loaded.tasks}
    uav = loaded.uavs[0].uav
    flat = plan([uav], list(tasks.values()), budget=0.05, seed=1)
    higher, blocked = over_terrain(loaded, flat, terrain, 30.0)
    assert blocked == {}
    assert higher.routes == flat.routes
    assert higher.distance > flat.distance
    points = route_points(uav, higher, tasks)
    low = {uav.position, tasks['hut'].position}
    for a, b in pairwise(points):
        if a not in low and b not in low:
            assert terrain.least_clearance(a, b)[0] >= 30.0 - 0.01
        elif a != b:
            assert a[:2] == b[:2]  # upright
    assert len(tasks['path#1'].path) > 3
    _, blocked = over_terrain(replace(loaded, altitude_max=20.0), flat, terrain, 30.0)
    assert blocked['hut'] == 'uav_1'
    home = plan([uav], list(tasks.values()), budget=0.05, seed=1, route_end='home')
    with pytest.raises(InvalidValue, match='uav_1: leg to its home'):
        over_terrain(replace(loaded, altitude_max=20.0), home, terrain, 30.0)


@pytest.mark.parametrize(('shape', 'reached'), [
    ('{shape: cylinder, center: [0, 0], radius: 200, z_min: 150, z_max: 900}', True),
    ('{shape: polygon, z_min: 150, vertices: [[-100, -2600], [100, -2600], [100, 2600],'
     ' [-100, 2600]], z_max: 900}', False)])
def test_a_zone_above_a_ridge_is_flown_around_or_the_task_left_out(shape, reached):
    given = parse(SCENARIO.replace('uavs:', 'zones:\n  - {id: air, ' + shape[1:] + '\nuavs:'))
    terrain, ends = ridge(given.origin), ('hut',)
    loaded = with_pieces(replace(given, tasks=tuple(
        timed for timed in given.tasks if timed.task.id in ends)), terrain)
    uav = loaded.uavs[0].uav

    def solve(some):
        return plan([uav], [timed.task for timed in some.tasks], [
            timed.zone for timed in some.zones], budget=0.2, seed=1, clearance=some.clearance,
                    clock=time.thread_time)

    flat = solve(loaded)
    assert flat.legs['uav_1'][0].via == ()  # below the zone
    higher = plan_over_terrain(loaded, flat, terrain, 30.0, solve)
    if not reached:
        assert higher.routes['uav_1'] == ()
        assert 'a zone or altitude_max = 500 m is in the way' in higher.unassigned['hut']
        return
    tasks = {timed.task.id: timed.task for timed in loaded.tasks}
    points = route_points(uav, higher, tasks)
    assert path_is_clear(points, [timed.zone for timed in loaded.zones], loaded.clearance)
    assert all(terrain.least_clearance(a, b)[0] >= 29.8 for a, b in pairwise(points)
               if a[:2] != b[:2])


def test_a_task_that_one_uav_does_not_reach_is_flown_by_another():
    given = parse(SCENARIO.replace('uavs:', """zones:
  - {id: air, shape: polygon, z_min: 150, vertices: [[-100, -2600], [100, -2600], [100, 2600],
     [-100, 2600]], z_max: 900}
uavs:
  - {id: uav_2, position: [900, 2400, 0.5]}"""))
    terrain = ridge(given.origin)
    loaded = replace(given, tasks=tuple(
        timed for timed in given.tasks if timed.task.id == 'hut'))
    uavs = [timed.uav for timed in loaded.uavs]

    def solve(some):
        return plan(uavs, [timed.task for timed in some.tasks], [
            timed.zone for timed in some.zones], budget=0.2, seed=1, clearance=some.clearance,
                    clock=time.thread_time)

    flat = solve(loaded)
    assert flat.routes['uav_1'] == ('hut',)  # it is nearer, but for the ridge
    higher = plan_over_terrain(loaded, flat, terrain, 30.0, solve)
    assert (higher.routes, higher.unassigned) == ({'uav_1': (), 'uav_2': ('hut',)}, {})


def test_heights_above_ground_are_those_of_the_task():
    given = parse(SCENARIO)
    terrain = ridge(given.origin)
    tasks = {timed.task.id: timed.task for timed in with_pieces(given, terrain).tasks}
    assert terrain.above_ground([tasks['top'].position])[0] == pytest.approx(60.0, abs=0.01)
    for name, height in ('path#1', 40.0), ('field#1', 80.0):
        for a, b in pairwise(tasks[name].path):
            assert terrain.least_clearance(a, b)[0] >= height - 0.1 * height - 2.0
    assert terrain.above_ground(tasks['field#1'].path) == pytest.approx(80.0, abs=0.1)


def test_a_task_below_the_ground_is_refused_and_a_low_way_named():
    loaded = parse(SCENARIO.replace('[900, 0, 10]', '[0, 0, 150]'))
    terrain = ridge(loaded.origin)
    with pytest.raises(InvalidValue, match=r'task hut: position = 150\.0: expected at least 200'):
        check_ground(with_pieces(loaded, terrain), terrain, 30.0)
    loaded = parse(SCENARIO.replace('[-900, 0, 0.5]', '[0, 0, 0]'))
    low, start = check_ground(with_pieces(loaded, terrain), terrain, 38.0)
    assert low.startswith('task path#1: its way comes as near as 3')
    assert start.startswith('uav_1 starts 200 m below the ground')


def test_heights_above_a_ground_that_is_not_known_are_refused():
    work = Work(parse(SCENARIO).tasks[0].task, Kind.POINT, vertical=Vertical.TERRAIN)
    with pytest.raises(InvalidValue, match=r"vertical = 'TERRAIN': expected ORIGIN: no terrain"):
        pieces_of(work)
    loaded = parse(SCENARIO)
    assert any(timed.whole.vertical is Vertical.TERRAIN for timed in loaded.tasks)
    with pytest.raises(InvalidValue, match=r"vertical = 'terrain': expected --terrain with"):
        ground_of(loaded, None, None)
