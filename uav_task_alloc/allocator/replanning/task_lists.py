# SPDX-License-Identifier: Apache-2.0
"""Task lists from routes: published legs are kept while safe; arrival times, length."""
from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.state.flight_pace import UavFlight
from uav_task_alloc.allocator.state.safe_paths import SafePaths
from uav_task_alloc.allocator.state.stop_times import timed_stops, way_ahead
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Leg, Plan, Point, Task, Uav

_START, _HOME = '', '~'  # neither is a task id
_BACK = 30.0  # [m] longer than a fresh leg is one under way to which the UAV would turn back
_WORTH = 1.0  # [m] that a path must be shorter, at least, to replace a published one
LegKey = tuple[str, str, str]  # UAV (if it starts or returns home there), stop before, stop


def planned_legs(plan: Plan) -> dict[LegKey, Leg]:
    """Return the legs of a plan by the stops they connect."""
    legs = {}
    for uav_id, tasks in plan.routes.items():
        stops = (_START, *tasks, *((_HOME,) if plan.returns and tasks else ()))
        for (before, after), leg in zip(pairwise(stops), plan.legs.get(uav_id, ()),
                                        strict=False):
            legs[_leg_key(uav_id, before, after)] = leg
    return legs


def legs_of_list(each: UavList) -> dict[LegKey, Leg]:
    """Return the legs of a list by the stops they connect, as `planned_legs` does.

    Args:
        each: list of a UAV, which may have flown a part of the first leg.

    Returns:
        All but the first leg, which begins where the UAV was.
    """
    legs = {_leg_key(each.uav, before.task.id, stop.task.id): stop.leg
            for before, stop in pairwise(each.stops)}
    if each.returns and each.stops:
        last = each.stops[-1].task.id
        legs[_leg_key(each.uav, last, _HOME)] = Leg(each.end_via, 0.0)  # its length is not used
    return legs


def build_task_list(uav: Uav, tasks: Sequence[Task], returns: bool,
                    legs: Mapping[LegKey, Leg], published: UavList,
                    paths: SafePaths,
                    flight: UavFlight | None = None,
                    keep: bool = False,
                    backward: Collection[str] = ()) -> tuple[UavList, dict[str, str]]:
    """Build the list of a route from the present position of a UAV.

    Args:
        uav: at its position.
        tasks: in the order flown.
        returns: whether the list should end with a return home; without a safe path home it ends
            with HOLD.
        legs: of the plan, see `planned_legs`.
        published: list in force, whose legs are kept while they are safe.
        paths: around the present zones.
        flight: of the UAV, for the times; None: as planned, from now.
        keep: the leg under way stays while it is safe, also where a fresh one is a little
            shorter: its heights keep UAVs apart.
        backward: ids of the tasks whose paths are flown from the last point.

    Returns:
        The list, and why no safe path leads to a task, by its id.
    """
    stops: list[ListStop] = []
    unreachable: dict[str, str] = {}
    before, place, velocity = _START, uav.position, flight.velocity if flight else None
    known = _published_stops(published)
    for task in tasks:
        new = ListStop(task, Leg((), 0.0), 0.0, reversed=task.id in backward)
        previous, old = known.get(task.id, ('', None))
        if old is not None and (previous != before or old.way != new.way):
            old = None
        leg = _steady_leg(old, before == _START, place, paths, _planned_leg(
            legs, _leg_key(uav.id, before, task.id), place, new.entry, paths), keep, velocity)
        if leg is None or (task.path and not paths.clear(*new.way)):
            why = paths.why_no_leg(place, new.entry) if leg is None else ''
            unreachable[task.id] = f'no safe path for {uav.id}' + (f': {why}' if why else '')
            continue
        stops.append(replace(new, leg=leg, begin_after=old.begin_after if old else 0.0))
        before, place = task.id, new.exit
    distance = math.fsum(stop.length for stop in stops)
    home = _leg_home(uav, before, place, legs, published, paths,
                     velocity) if returns else None
    timed = timed_stops(stops, flight or UavFlight.of(uav))
    return replace(published, stops=timed, returns=home is not None,
                   end_via=home.via if home else (),
                   distance=distance + (home.length if home and stops else 0.0)), unreachable


def _leg_home(uav: Uav, before: str, place: Point, legs: Mapping[LegKey, Leg],
              published: UavList, paths: SafePaths, velocity: Point | None) -> Leg | None:
    goal = uav.home or uav.position
    if before == _START and published.returns and not published.stops:  # perhaps under way
        metres = paths.rest_of_leg(place, Leg(published.end_via, 0.0), goal, velocity)
        if metres is not None:
            return Leg(published.end_via, metres)
    return _planned_leg(legs, _leg_key(uav.id, before, _HOME), place, goal, paths)


def _leg_key(uav_id: str, before: str, after: str) -> LegKey:
    return uav_id if before == _START or after == _HOME else '', before, after


def _planned_leg(legs: Mapping[LegKey, Leg], key: LegKey, a: Point, b: Point,
                 paths: SafePaths) -> Leg | None:
    """The leg of the plan while it is safe, else a new one."""
    leg = legs.get(key)
    if leg is not None and paths.leg_clear(a, *leg.via, b):
        return Leg(leg.via, polyline_length((a, *leg.via, b)))
    return paths.leg(a, b)


def _steady_leg(stop: ListStop | None, first: bool, place: Point, paths: SafePaths,
                fresh: Leg | None, keep: bool, velocity: Point | None) -> Leg | None:
    """The published leg while it is safe and not longer by the margin; else the fresh one."""
    if stop is None:
        return fresh
    old = stop.leg
    if first and stop.task.path and way_ahead(place, stop):
        return Leg((), 0.0)
    if first:
        metres = paths.rest_of_leg(place, old, stop.entry, velocity)
    elif (fresh is not None and fresh.via == old.via) or paths.leg_clear(
            place, *old.via, stop.entry):
        metres = old.length
    else:
        metres = None
    if metres is None:
        return fresh
    if fresh is None:
        return Leg(old.via, metres)
    if keep and first:
        return fresh if fresh.length + _BACK < metres else Leg(old.via, metres)
    shorter = fresh.length + _WORTH < metres * (1.0 - paths.margin)
    return fresh if shorter else Leg(old.via, metres)


def _published_stops(published: UavList) -> dict[str, tuple[str, ListStop | None]]:
    """The stops of a list by task id, each with the id of the task before it."""
    befores = (_START, *published.task_ids)
    return {stop.task.id: (before, stop) for before, stop in zip(befores, published.stops,
                                                                 strict=False)}
