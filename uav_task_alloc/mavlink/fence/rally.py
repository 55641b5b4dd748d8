# SPDX-License-Identifier: Apache-2.0
"""Rally points: which of the given places a UAV may return to straight, and their items."""
from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.model import Point

_STEP = 50.0  # [m] between the places of a plan from which a return is looked at
_MOST_PLACES = 200
_LONGEST = 32767.0  # [m] ArduPilot keeps the height in 16 bits


@dataclass(frozen=True, slots=True)
class RallyPoint:
    """A place to return to."""

    latitude: float  # [deg]
    longitude: float  # [deg]
    height: float  # [m] above the home of the vehicle
    position: Point  # [m] ENU; its height does not count

    @property
    def text(self) -> str:
        """As in the parameter."""
        return f'{self.latitude:.5f},{self.longitude:.5f}'


def choose_rally(points: Sequence[RallyPoint], path: Sequence[Point], home: Point,
                 crosses: Callable[[Point, Point], bool]) -> tuple[RallyPoint, ...]:
    """Choose rally points so that returns along a plan cross as few zones as possible.

    An autopilot returns straight to the nearest of its rally points and home. Points in a zone
    are left out, then one after another those without which fewer returns cross a zone.
    O(points^2 places) calls of `crosses`.

    Args:
        points: that may be used.
        path: flown by the UAV [m] ENU.
        home: [m] ENU.
        crosses: whether the straight way between two places enters a zone.

    Returns:
        In the order of `points`.
    """
    chosen = [point for point in points if not crosses(point.position, point.position)]
    places = _places(path)

    def crossings(left: Sequence[RallyPoint]) -> int:
        ends = [home, *(point.position for point in left)]
        return sum(crosses(place, min(ends, key=lambda end: math.dist(place[:2], end[:2])))
                   for place in places)

    count = crossings(chosen)
    while count and chosen:
        fewer, worst = min((crossings([p for p in chosen if p is not point]), number)
                           for number, point in enumerate(chosen))
        if fewer >= count:
            break
        del chosen[worst]
        count = fewer
    return tuple(chosen)


def _places(path: Sequence[Point]) -> list[Point]:
    """Places along a path, not more than _MOST_PLACES."""
    places = list(path[:1])
    for a, b in pairwise(path):
        parts = max(1, math.ceil(math.dist(a, b) / _STEP))
        places += [(a[0] + (b[0] - a[0]) * k / parts, a[1] + (b[1] - a[1]) * k / parts, b[2])
                   for k in range(1, parts + 1)]
    return places[::max(1, math.ceil(len(places) / _MOST_PLACES))]


def rally_items(points: Sequence[RallyPoint]) -> tuple[Item, ...]:
    """The items of rally points, above home, which is the one frame that both autopilots take.

    Protocol: https://mavlink.io/en/services/mission.html#rally_points

    Args:
        points: in their order on board.

    Returns:
        By seq.
    """
    return tuple(Item(d.MAV_CMD_NAV_RALLY_POINT, d.MAV_FRAME_GLOBAL_RELATIVE_ALT,
                      round(point.latitude * 1e7), round(point.longitude * 1e7),
                      min(_LONGEST, float(math.ceil(point.height)))) for point in points)


def rally_alike(sent: Sequence[Item], held: Sequence[Item]) -> bool:
    """Whether rally points read back are those sent.

    Args:
        sent: items of the upload, by seq.
        held: items of the readback, by seq.

    Returns:
        False where a place differs, or a height by more than 0.5 m.
    """
    return len(sent) == len(held) and all(
        a.command == b.command and abs(a.x - b.x) <= 1 and abs(a.y - b.y) <= 1
        and abs(a.z - b.z) <= 0.5 for a, b in zip(sent, held, strict=True))
