# SPDX-License-Identifier: Apache-2.0
"""ORBIT: turns around a centre, flown as the corners of a regular polygon."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from uav_task_alloc.actions import Action
from uav_task_alloc.checks import check_number
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Point, Task, ThreatZone
from uav_task_alloc.work.line import free_ways
from uav_task_alloc.work.values import MOST_CORNERS, ORBIT_RADII, Geometry, refuse_unused

_USED = 'direction', 'radius', 'turns'
_SIDE = 10.0  # [m] of the polygon, where it has not too few or too many corners
_CORNERS = 16, 48  # fewest, most; of 16 a side is 2 % of the radius nearer to the centre


def check_orbit(given: Geometry) -> None:
    """Check an ORBIT; no turns given: one.

    Raises:
        InvalidValue: a value is out of range, or there would be too many corners.
    """
    refuse_unused(given, _USED)
    check_number(given.place('radius'), given.radius, *ORBIT_RADII)
    if given.turns == 0.0:
        object.__setattr__(given, 'turns', 1.0)
    corners = abs(given.turns) * orbit_corners(given.radius)
    if corners > MOST_CORNERS:
        raise InvalidValue(given.place('turns'), given.turns,
                           f'at most {MOST_CORNERS / orbit_corners(given.radius):.3g}')


def orbit_corners(radius: float) -> int:
    """Corners of one turn.

    Args:
        radius: [m].
    """
    fewest, most = _CORNERS
    return min(most, max(fewest, math.ceil(2 * math.pi * radius / _SIDE)))


def orbit_ways(given: Geometry, zones: Sequence[ThreatZone],
               clearance: float) -> list[tuple[Point, ...]]:
    """The way of an ORBIT, cut where it enters zones.

    Args:
        given: checked.
        zones: each is enlarged by its margin and `clearance`.
        clearance: [m].

    Returns:
        [m] ways outside all zones, in the order of flight.
    """
    x, y, z = given.task.position
    step = -math.copysign(2 * math.pi / orbit_corners(given.radius), given.turns)
    count = max(1, round(abs(given.turns) * orbit_corners(given.radius)))
    first = given.direction or 0.0
    path = [(x + given.radius * math.cos(first + k * step),
             y + given.radius * math.sin(first + k * step), z) for k in range(count + 1)]
    return free_ways(path, zones, clearance)


def looks_at_centre(given: Geometry, task: Task) -> Task:
    """A piece of an ORBIT with the camera on the centre, unless its actions say otherwise.

    Args:
        given: the whole.
        task: a piece.
    """
    if any(action.name in ('roi', 'gimbal') for action in task.actions):
        return task
    x, y, z = given.task.position
    return replace(task, actions=(Action('roi', (('x', x), ('y', y), ('z', z))), *task.actions))
