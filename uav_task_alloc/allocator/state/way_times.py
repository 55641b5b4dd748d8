# SPDX-License-Identifier: Apache-2.0
"""When a UAV is where on a way from stop to stop, which it begins and ends at rest."""
from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from uav_task_alloc.allocator.state.flight_pace import FlightPace
from uav_task_alloc.model import Point


def timed_points(points: Sequence[Point], pace: FlightPace, share: float = 0.0
                 ) -> list[tuple[float, Point]]:
    """Return where a UAV is when on a way at whose end it comes to rest.

    Args:
        points: [m] ENU.
        pace: of the UAV.
        share: of its speed that it has at the begin, 0 to 1.

    Returns:
        Times [s] and points [m] ENU, in order: those of the way but the first, and between them
        where it speeds up and brakes. At constant speed between two, a position is right to
        1/16 of its braking distance. The last time is that of `FlightPace.from_stop`.
    """
    pieces = [pace.seconds(pair) for pair in pairwise(points)]
    marks = _speed_marks(sum(pieces), pace.stop_time, share)
    found, begin, lost, n = list[tuple[float, Point]](), 0.0, 0.0, 0
    for k, seconds in enumerate(pieces):
        a, b, end = points[k], points[k + 1], begin + seconds
        while n < len(marks) and marks[n][1] < end:
            clock, way = marks[n]
            part = (way - begin) / seconds
            x, y, z = (p + part * (q - p) for p, q in zip(a, b, strict=True))
            found.append((clock + lost, (x, y, z)))
            n += 1
        corner = pace.stop_time * pace.corners(points[k:k + 3])  # half before it, half after it
        found.append((_reached_at(marks, end, n) + lost + 0.5 * corner, b))
        begin, lost = end, lost + corner
    return found


def _reached_at(marks: Sequence[tuple[float, float]], way: float, n: int) -> float:
    """Time [s] at which a way [s] is flown; it is beyond the first `n` marks, not the next."""
    (t0, s0), (t1, s1) = marks[n - 1] if n else (0.0, 0.0), marks[min(n, len(marks) - 1)]
    return t1 if s1 <= s0 else t0 + (t1 - t0) * min(1.0, (way - s0) / (s1 - s0))


def _speed_marks(seconds: float, stop_time: float, share: float) -> list[tuple[float, float]]:
    """Times [s], and the parts of a way [s at full speed] flown by then; see `stopping`.

    They are in the middle and at the end of speeding up, and the same of braking.
    """
    if stop_time <= 0.0 or seconds <= 0.0:
        return [(seconds, seconds)]
    way = seconds / stop_time  # now the speed and the acceleration are 1
    if 2.0 * way <= share * share:  # it brakes, harder
        marks = [(way / share, 0.75 * way), (2.0 * way / share, way)]
    else:
        top = min(1.0, math.sqrt(way + 0.5 * share * share))
        rise, braking = top - share, 0.5 * top * top
        gained = 0.5 * (top + share) * rise
        level = rise + (way - gained - braking) / top  # time at which it begins to brake
        marks = [(0.5 * rise, 0.5 * rise * (share + 0.25 * rise)), (rise, gained),
                 (level, way - braking), (level + 0.5 * top, way - 0.25 * braking),
                 (level + top, way)]
    return [(stop_time * t, stop_time * s) for t, s in marks]
