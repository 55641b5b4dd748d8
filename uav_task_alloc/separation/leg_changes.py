# SPDX-License-Identifier: Apache-2.0
"""Changes of a planned leg that may set it apart from others: other heights, waits."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.model import Point
from uav_task_alloc.separation.flight_legs import Flight, FlightLeg, leg_times
from uav_task_alloc.separation.rule import Separation
from uav_task_alloc.separation.transit_paths import slanted, upright

_LAYERS = 10  # above the ends of a leg, at most
_PRICE = 0.15  # [s/m] of a climb above the ends of a leg, whose power a wait does not take
_MARGIN = 0.5  # [m] more between layers than the vertical distance: heights are kept nearly
_ON_LINE = 0.01  # [m] a detour point so near to the line of its neighbours only changes the height


@dataclass(frozen=True, slots=True)
class TransitLimits:
    """Where transit legs may go.

    Attributes:
        altitude_min, altitude_max: [m] ENU.
        is_clear: whether a polyline [m] ENU enters no zone.
        stop: polled before each change that is tried; True ends the search for changes.
        max_price: [s] of flight that the change of a return that cannot wait may cost; changes
            that cost more are left to the flight, where less is uncertain.
        is_allowed: whether a UAV may fly so: limits of it that the separation does not know.
    """

    altitude_min: float = -math.inf  # [m]
    altitude_max: float = math.inf  # [m]
    is_clear: Callable[[Sequence[Point]], bool] = lambda points: True
    stop: Callable[[], bool] = lambda: False
    max_price: float = math.inf  # [s]
    is_allowed: Callable[[Flight], bool] = lambda flight: True


@dataclass(frozen=True, slots=True)
class LegChange:
    """A leg as it could be flown, and its price."""

    leg: FlightLeg
    seconds: float  # price: more than as planned, with the wait and for a climb
    text: str
    kind: str  # `height`, `hold` or ''


def with_wait(path: LegChange, begin: float, wait: float) -> LegChange:
    """Return a change with a wait before the leg.

    Args:
        path: the change without it.
        begin: when the leg would begin [s].
        wait: [s]; 0: the change as it is.
    """
    if wait == 0.0:
        return path
    return LegChange(replace(path.leg, hold_until=begin + wait), path.seconds + wait, ' and '.join(
        filter(None, (path.text, f'waits {wait:g} s'))), path.kind or 'hold')


def keeps_deadlines(flight: Flight, n: int, delay: float, ready: float) -> bool:
    """Return whether no service that was to begin in time begins too late after a delay.

    Args:
        flight: planned.
        n: index of the leg that is delayed.
        delay: [s] of its end.
        ready: end of the leg without the delay [s].
    """
    if delay <= 0.0:
        return True
    leg, later = flight.legs[n], ready + delay
    if ready - leg.service <= leg.latest < later - leg.service:
        return False
    for leg in flight.legs[n + 1:]:
        ready, later = leg_times(flight, leg, ready).end, leg_times(flight, leg, later).end
        if ready - leg.service <= leg.latest < later - leg.service:
            return False
    return True


def other_heights(flight: Flight, leg: FlightLeg, rule: Separation,
                  limits: TransitLimits) -> Iterator[LegChange]:
    """Yield the leg at other transit heights that it may have.

    Args:
        flight: that the leg is of.
        leg: as planned.
        rule: that is on.
        limits: of heights and zones.
    """
    points = _level_points(leg, limits)
    planned = flight.leg_seconds(leg)
    ends = [height for height, on_ground in (
        (max(points[0][2], leg.top), leg.takes_off and leg.top == -math.inf),
        (points[-1][2], leg.lands)) if not on_ground]
    ends = ends or [max(point[2] for point in points)]
    levels = {max(ends), min(ends), *(
        max(ends) + step * (rule.vertical + _MARGIN) for step in range(1, _LAYERS + 1))}
    above = max(ends) + rule.vertical
    if above <= limits.altitude_max < above + _MARGIN:
        levels.add(above)  # the only other layer
    for level in levels:
        if not limits.altitude_min <= level <= limits.altitude_max:
            continue
        for path in {slanted(flight, leg, points, level), upright(leg, points, level)}:
            new = replace(leg, points=path)
            if path != leg.points and limits.is_clear(new.flown()):
                price = flight.leg_seconds(new) - planned + _PRICE * max(
                    0.0, level - max(ends))
                if leg.may_wait or price <= limits.max_price:
                    yield LegChange(new, price, f'flies at {level:.1f} m', 'height')


def _level_points(leg: FlightLeg, limits: TransitLimits) -> tuple[Point, ...]:
    """Points of a leg without those that only change its height."""
    points = list(leg.points)
    k = 1
    while k < len(points) - 1:
        a, point, b = (each[:2] for each in points[k - 1:k + 2])
        if segment_distance(point, a, b) <= _ON_LINE and limits.is_clear(
                (points[k - 1], points[k + 1])):
            del points[k]
        else:
            k += 1
    return tuple(points)
