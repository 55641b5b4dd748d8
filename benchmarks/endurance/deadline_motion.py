# SPDX-License-Identifier: Apache-2.0
"""How the UAVs of deadlines.py truly fly, and how its oracle times a leg by what was measured."""
from __future__ import annotations

import math

from uav_task_alloc.allocator.state.flight_pace import FlightPace
from uav_task_alloc.model import Point

SPEED, HEIGHT = 15.0, 50.0  # [m/s] through the air, [m]


def over_ground(wind: tuple[float, float], dx: float, dy: float) -> float:
    """Ground speed [m/s] of a UAV that holds its speed through the air."""
    length = math.hypot(dx, dy)
    if length == 0.0:
        return SPEED
    tail = (wind[0] * dx + wind[1] * dy) / length
    return tail + math.sqrt(SPEED**2 - (wind[0]**2 + wind[1]**2 - tail**2))


def leg_seconds(pace: FlightPace, start: Point, end: Point, velocity: Point | None) -> float:
    """Time of a level leg with measured wind, speed and stops, from a velocity or rest [s]."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = math.hypot(dx, dy)
    if length == 0.0:
        return 0.0
    tail = (pace.wind[0] * dx + pace.wind[1] * dy) / length
    across = pace.wind[0]**2 + pace.wind[1]**2 - tail**2
    fast = max(tail + math.sqrt(max(0.0, pace.speed**2 - across)), 0.1 * pace.speed)
    return travel_seconds(length, fast, along(velocity or (0.0, 0.0, 0.0), dx, dy),
                          fast / pace.stop_time if pace.stop_time else math.inf)


def along(velocity: Point, dx: float, dy: float) -> float:
    """Part of a velocity in a direction, not negative [m/s]."""
    return max(0.0, (velocity[0] * dx + velocity[1] * dy) / max(math.hypot(dx, dy), 1e-9))


def travel_seconds(metres: float, fast: float, begin: float, acceleration: float) -> float:
    """Time of a straight way that ends at rest, from a speed `begin` [m/s]; [s]."""
    begin = min(fast, begin)
    if begin**2 >= 2.0 * acceleration * metres:
        return 2.0 * metres / begin if begin else 0.0
    top = min(fast, math.sqrt(acceleration * metres + 0.5 * begin**2))
    even = metres - (2.0 * top**2 - begin**2) / (2.0 * acceleration)  # [m] at the top speed
    return (2.0 * top - begin) / acceleration + even / top
