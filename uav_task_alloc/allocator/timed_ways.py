# SPDX-License-Identifier: Apache-2.0
"""Where a UAV in flight will be and when: along a line, home, on its own return, or drifting."""
from __future__ import annotations

import math
from collections.abc import Sequence

from uav_task_alloc.allocator.state.fleet import UavRecord
from uav_task_alloc.allocator.state.flight_pace import FlightPace
from uav_task_alloc.allocator.state.way_times import timed_points
from uav_task_alloc.model import Point
from uav_task_alloc.params import BridgeParams
from uav_task_alloc.separation.prediction import HORIZON

MOVES = 2.0  # [m/s]; with more it does not hover
_CLIMBS = 0.5  # [m/s]; with more it does not fly level
_TOWARDS = math.cos(math.radians(15.0))  # of the course and the direction of home
_CLIMBS_ON = 5.0  # [s] for which a take-off to an unknown height goes on at least
TimedPoints = list[tuple[float, Point]]  # [s] from now, and [m] ENU


def top_of_climb(record: UavRecord, height: float) -> Point:
    """Where a take-off ends: at the height that the bridge reports, whatever the leg.

    One that is above that, or reports none, climbs on for some seconds.
    """
    x, y, z = record.report.position
    rise = (record.report.velocity or (0.0, 0.0, 0.0))[2]
    known = record.report.takeoff_height
    top = record.home[2] + (known or BridgeParams.cruise_altitude)
    if known and z < top:
        return x, y, top
    return x, y, max(z + _CLIMBS_ON * rise, top if known else max(top, height))


def timed_along(points: TimedPoints, line: Sequence[Point], pace: FlightPace,
                share: float = 0.0) -> TimedPoints:
    """The points, and then those of a leg, from a share of its speed to a stop."""
    clock, place = points[-1]
    return [*points, *((clock + t, point)
                       for t, point in timed_points((place, *line), pace, share))]


def timed_home(points: TimedPoints, record: UavRecord, pace: FlightPace,
               via: Sequence[Point] = (), share: float = 0.0) -> TimedPoints:
    """The points, and then the way home at the height of the last one, and down."""
    place, home = points[-1][1], record.home
    above = (home[0], home[1], max(home[2], (via[-1] if via else place)[2]))
    clock, place = (points := timed_along(points, (*via, above), pace, share))[-1]
    return [*points, (clock + pace.seconds((place, home)), home)]


def seems_to_return(record: UavRecord) -> bool:
    """Whether a UAV that others fly climbs to the height of its return, or flies to its home."""
    report, home = record.report, record.home
    x, y, z = report.position
    vx, vy, vz = report.velocity or (0.0, 0.0, 0.0)
    speed, far = math.hypot(vx, vy), math.hypot(home[0] - x, home[1] - y)
    if report.mode == 'RETURNING':
        return True
    if speed < MOVES:
        return vz > _CLIMBS and z < home[2] + (report.return_height or 0.0)
    return vx * (home[0] - x) + vy * (home[1] - y) > _TOWARDS * speed * far


def timed_own_return(record: UavRecord, pace: FlightPace) -> TimedPoints:
    """The way of an autopilot's return mode: up to its own height, home, and down."""
    report, home = record.report, record.home
    (x, y, z), (vx, vy, vz) = report.position, report.velocity or (0.0, 0.0, 0.0)
    top = max(z, home[2] + (report.return_height or 0.0))
    if math.hypot(vx, vy) > MOVES and vz < _CLIMBS:  # it has climbed
        top = z
    up = (x, y, top)
    share = min(1.0, math.hypot(vx, vy) / pace.speed) if top == z else 0.0
    return timed_home([(0.0, report.position), (pace.seconds((report.position, up)), up)], record,
                      pace, share=share)


def timed_drift(record: UavRecord, age: float = 0.0) -> TimedPoints:
    """Where its velocity takes a UAV, down to the height of its home, `age` [s] after a report."""
    x, y, z = record.report.position
    vx, vy, vz = record.report.velocity or (0.0, 0.0, 0.0)
    low = min(z, record.home[2])
    x, y, z = x + vx * age, y + vy * age, max(low, z + vz * age)
    ends = [HORIZON] if z + vz * HORIZON >= low else [(low - z) / vz, HORIZON]
    return [(0.0, (x, y, z)), *((t, (x + vx * t, y + vy * t, max(low, z + vz * t)))
                                for t in ends)]
