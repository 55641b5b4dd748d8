# SPDX-License-Identifier: Apache-2.0
"""Ways and legs above the ground are items above mean sea level, flown by both autopilots."""
import math

import numpy as np
import pytest
from flight_bench import FlightBench
from mission_bench import ORIGIN, PROFILES
from piece_bench import Track
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import to_geodetic
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList, mission_items
from uav_task_alloc.model import Task
from uav_task_alloc.terrain import Terrain
from uav_task_alloc.work.pieces import Work, pieces_of
from uav_task_alloc.work.values import Kind, Vertical

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
STEP, NODES = 0.0001, 200  # [deg] some 11 m
LINE = Work(Task('line', (0.0, 0.0, 0.0)), Kind.LINE, (
    (120.0, 60.0, 40.0), (420.0, 60.0, 40.0)), vertical=Vertical.TERRAIN)


def ridge():
    """A ridge 60 m high, 300 m east of the home, which is on level ground."""
    scale = math.cos(math.radians(ORIGIN.latitude)) * 111_320.0
    east = (np.arange(NODES) - NODES / 2) * STEP * scale
    heights = ORIGIN.altitude_amsl + 60.0 * np.exp(-((east - 300.0) / 60.0)**2) + np.zeros(
        (NODES, 1))
    return Terrain(heights, lambda longitude, latitude: (
        (longitude - ORIGIN.longitude) / STEP + NODES / 2,
        (ORIGIN.latitude - latitude) / STEP + NODES / 2), ORIGIN)


def over_the_ridge(ground):
    """A list with the line, and a point beyond it that a raised leg leads to."""
    piece, = pieces_of(LINE, terrain=ground)
    hut, = ground.raised([(60.0, -40.0, 0.0)], 40.0)
    return TaskList(1, (MissionStop(piece), MissionStop(
        Task('hut', hut), ground.lifted(piece.end, hut, 30.0))))


@BOTH
def test_items_have_the_height_of_the_ground_and_the_task_above_sea_level(kind):
    ground = ridge()
    tasks = over_the_ridge(ground)
    items = [item for item in mission_items(tasks, PROFILES[kind].rules, ORIGIN)
             if item.position is not None]
    assert {item.frame for item in items} <= {d.MAV_FRAME_GLOBAL_INT, d.MAV_FRAME_GLOBAL}
    for item in items:
        assert item.z == pytest.approx(to_geodetic(ORIGIN, item.position)[2], abs=0.01)
    line = [item for item in items if item.task == 'line#1']
    above = ground.above_ground([item.position for item in line])
    assert above == pytest.approx([40.0] * len(line), abs=0.1)
    assert max(item.z for item in line) == pytest.approx(ORIGIN.altitude_amsl + 100.0, abs=4.0)


@BOTH
def test_a_way_and_a_leg_over_a_ridge_are_flown_above_the_ground(kind):
    ground = ridge()
    bench = FlightBench(kind).discover()
    track = Track(bench)
    bench.assign(over_the_ridge(ground))
    begun = []

    def done():
        if not begun and track.points and math.dist(track.points[-1], (120.0, 60.0, 40.0)) < 5.0:
            begun.append(len(track.points))
        return bench.completed() == ['line#1', 'hut']
    assert bench.run(done, 400.0)
    above = ground.above_ground(track.points[begun[0]:])
    assert above.min() >= 30.0
    on_line = [point for point in track.points[begun[0]:] if abs(point[1] - 60.0) < 2.0]
    assert ground.above_ground(on_line).max() <= 60.0
