# SPDX-License-Identifier: Apache-2.0
"""Flight time of legs, as autopilots fly straight lines: the slowest of three axes sets the speed.

On a straight part the speed along the line is limited so that neither the horizontal nor the
vertical speed exceeds its limit (ArduPilot WPNAV_SPEED, WPNAV_SPEED_UP and _DN; PX4 MPC_XY_CRUISE,
MPC_Z_V_AUTO_UP and _DN). Acceleration is neglected.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from uav_task_alloc.geometry.outline import Floats
from uav_task_alloc.kernel import inner_kernel
from uav_task_alloc.model import Point, Task, Uav


def straight_time(dx: float, dy: float, dz: float, cruise: float, climb: float,
                  descent: float) -> float:
    """Return the flight time of a straight part. O(1)

    Args:
        dx, dy, dz: the part [m].
        cruise, climb, descent: [m/s] at most.

    Returns:
        [s].
    """
    vertical = dz / climb if dz > 0.0 else -dz / descent
    return max(math.sqrt(dx * dx + dy * dy) / cruise, vertical)


straight_time_kernel = inner_kernel(straight_time)  # the same, for kernels


@inner_kernel
def path_time(points: Floats, n: int, cruise: float, climb: float, descent: float) -> float:
    """Time [s] of the polyline points[:n], float64 (n, 3) [m], at these speeds at most. O(n)"""
    total = 0.0
    for i in range(1, n):
        total += straight_time_kernel(
            points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1],
            points[i, 2] - points[i - 1, 2], cruise, climb, descent)
    return total


def flight_time(uav: Uav, points: Sequence[Point]) -> float:
    """Time that a UAV needs along a polyline.

    Args:
        uav: its cruise, climb and descent speed count.
        points: [m] ENU, in order.

    Returns:
        [s]; 0.0 for less than two points.
    """
    speeds = uav.cruise_speed, uav.climb_speed, uav.descent_speed
    return sum(straight_time(x1 - x, y1 - y, z1 - z, *speeds)
               for (x, y, z), (x1, y1, z1) in pairwise(points))


def service_seconds(uav: Uav, task: Task, turned: bool = False) -> float:
    """Time that a UAV needs for the service of a task, with the flight along its path.

    Args:
        uav: its cruise, climb and descent speed count.
        task: flown from its position; an action `speed` replaces the cruise speed along the path.
        turned: its path is flown from the last point instead.

    Returns:
        [s].
    """
    if not task.path:
        return task.stay
    cruise = next((each['speed'] for each in task.actions if each.name == 'speed'),
                  uav.cruise_speed)
    return task.stay + sum(
        straight_time(x1 - x, y1 - y, z1 - z, cruise, uav.climb_speed, uav.descent_speed)
        for (x, y, z), (x1, y1, z1) in pairwise(task.path[::-1] if turned else task.path))
