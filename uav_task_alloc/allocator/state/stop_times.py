# SPDX-License-Identifier: Apache-2.0
"""When a UAV reaches the stops of its list, and is done with them: windows, waits, ways."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.state.flight_pace import FlightPace, UavFlight
from uav_task_alloc.geometry.polyline import points_passed, segment_distance
from uav_task_alloc.model import Point

_ON_WAY = 10.0  # [m] from a path, within which a UAV flies along it


def timed_stops(stops: Sequence[ListStop], flight: UavFlight,
                start: Point | None = None) -> tuple[ListStop, ...]:
    """Return stops with their arrivals and waits from the present position of a UAV.

    Args:
        stops: in the order of flight.
        flight: of the UAV; it is on the leg to the first stop, or there.
        start: [m] where that leg began; None: unknown.

    Returns:
        `eta` and `wait` count from `flight.stamp`.
    """
    timed: list[ListStop] = []
    clock, place = _earliest_departure(stops, flight), flight.position
    for k, stop in enumerate(stops):
        task, earliest = stop.task, max(stop.task.earliest, stop.begin_after)
        if k == 0 and flight.serving == task.id:
            since = flight.stamp - earliest  # negative: it waits
            timed.append(stop.timed(0.0, max(0.0, -since), max(0.0, min(flight.served, since)),
                                    _rest_of_path(stop, flight)))
        else:
            clock = max(clock, task.release - flight.stamp)
            clock += _leg_seconds(stop, flight, place, start, first=k == 0)
            timed.append(stop.timed(clock, max(0.0, earliest - flight.stamp - clock), 0.0,
                                    seconds_along(stop, flight.pace)))
        clock, place = timed[-1].finish, stop.exit
    return tuple(timed)


def seconds_along(stop: ListStop, pace: FlightPace) -> float:
    """Return the time along the path of a task, which begins with a corner and not with a stop.

    Args:
        stop: of a list.
        pace: of its UAV.

    Returns:
        [s]; 0.0 for a point.
    """
    if not stop.task.path:
        return 0.0
    before = stop.leg.via[-1:]  # where it comes from matters for the corner only
    corner = pace.stop_time * pace.corners((*before, *stop.way[:2])) if before else 0.0
    own = _pace_along(stop, pace)
    return own.seconds(stop.way) + own.stop_time * own.corners(stop.way) + corner


def _pace_along(stop: ListStop, pace: FlightPace) -> FlightPace:
    """The pace along the path of a task: an action sets the speed over ground."""
    speed = next((each['speed'] for each in stop.task.actions if each.name == 'speed'), None)
    return pace if speed is None else replace(pace, speed=speed, wind=(0.0, 0.0))


def slower_along(stop: ListStop, pace: FlightPace) -> float:
    """Return how much longer the path of a task takes than without its action `speed`.

    Args:
        stop: of a list.
        pace: of its UAV.

    Returns:
        [s]; negative for an action that makes it faster.
    """
    return _pace_along(stop, pace).seconds(stop.way) - pace.seconds(stop.way)


def way_ahead(place: Point, stop: ListStop) -> tuple[Point, ...] | None:
    """Return the points that are ahead of a UAV which flies along the path of a stop.

    Args:
        place: of the UAV [m] ENU.
        stop: the first of its list.

    Returns:
        None where it is not within 10 m of the path, or before its begin.
    """
    way = stop.way
    passed = points_passed(place, way)
    if passed == 0 or segment_distance(place, way[passed - 1], way[passed]) > _ON_WAY:
        return None
    return way[passed:]


def _rest_of_path(stop: ListStop, flight: UavFlight) -> float:
    """[s] that a UAV on the path of a stop still flies along it."""
    if not stop.task.path:
        return 0.0
    rest = stop.way[points_passed(flight.position, stop.way, stop.entry):]
    return _pace_along(stop, flight.pace).from_stop((flight.position, *rest),
                                                    flight.share(rest[0]))


def _earliest_departure(stops: Sequence[ListStop], flight: UavFlight) -> float:
    """[s] from now: on the ground the payloads of the trip are awaited."""
    if not flight.on_ground:
        return 0.0
    return max((0.0, *(stop.task.release - flight.stamp for stop in stops
                       if stop.task.payload > 0.0)))


def _leg_seconds(stop: ListStop, flight: UavFlight, place: Point, start: Point | None,
                 first: bool) -> float:
    """Flight time of a leg; the first one from where the UAV is, as fast as it is."""
    leg = (*stop.leg.via, stop.entry)
    if not first:
        return flight.pace.from_stop((place, *leg))
    if flight.on_ground or flight.climbing:  # it climbs before it flies
        top = flight.takeoff_top if flight.takeoff_top > -math.inf else leg[0][2]
        above = (place[0], place[1], max(place[2], top))
        return (flight.pace.takeoff * flight.on_ground + flight.pace.seconds((place, above))
                + flight.pace.from_stop((above, *leg)))
    rest = leg[flight.passed(leg, start):]
    return flight.pace.from_stop((place, *rest), flight.share(rest[0]))


def first_leg_delay(stops: Sequence[ListStop], flight: UavFlight, speed: float) -> float:
    """Return what a UAV loses on its first leg: it takes off, climbs, speeds up and brakes.

    A solver flies that leg at once and at full speed; it counts a stop after each task only.

    Args:
        stops: of the list in force; none: it is not known where the UAV will fly.
        flight: of the UAV now.
        speed: [m/s] mean over ground, as of the solver.

    Returns:
        [s]; 0.0 of a UAV that has reached its first task.
    """
    if stops and flight.serving == stops[0].task.id:
        return 0.0
    pace = replace(flight.pace, speed=speed, wind=(0.0, 0.0))
    flight = replace(flight, pace=pace)
    if stops:
        leg = *stops[0].leg.via, stops[0].entry
        rest = leg[flight.passed(leg):]
        lost = _leg_seconds(stops[0], flight, flight.position, None, first=True)
        return max(0.0, lost - pace.seconds((flight.position, *rest)))
    if not (flight.on_ground or flight.climbing):
        return pace.stop_time * (0.5 if flight.velocity is None else 1.0)
    climb = max(0.0, flight.takeoff_top - flight.position[2]) / pace.climb
    return pace.takeoff * flight.on_ground + climb + pace.stop_time


def finish_time(each: UavList, flight: UavFlight) -> float:
    """Return the time until a UAV has flown a list, with its way home.

    Args:
        each: with arrival times from now.
        flight: with its pace and home.

    Returns:
        [s]; 0.0 for an empty list.
    """
    if not each.stops:
        return 0.0
    last, home = each.stops[-1], flight.home
    if not each.returns or home is None:
        return last.finish
    return last.finish + flight.pace.from_stop((last.exit, *each.end_via, home))
