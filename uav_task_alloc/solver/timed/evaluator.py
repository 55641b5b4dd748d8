# SPDX-License-Identifier: Apache-2.0
"""The evaluator of plans with time: what routes cost and violate, in Python without kernels.

It is independent of the search, which must agree with it: all plans with time are evaluated here
before they are returned.
"""
from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from uav_task_alloc.geometry.flight_time import flight_time
from uav_task_alloc.model import Leg, Point, Task, Uav, turned_tasks
from uav_task_alloc.objective import response_time
from uav_task_alloc.solver.problem import Rules, excess_cost
from uav_task_alloc.solver.timed.schedule import (
    ROUNDING,
    GivenWaits,
    Held,
    LegOf,
    Trip,
    scheduled_trips,
    straight_legs,
)
from uav_task_alloc.timetable import Timetable

Trips = Sequence[Sequence[str]]  # task ids of each trip


@dataclass(frozen=True, slots=True)
class TimedEvaluation:
    """A plan with its times, its cost and what it violates."""

    timetable: Timetable  # of the best departures
    cost: float  # of the objective, with the price of `penalty`
    distance: float  # [m]
    value: float  # of the tasks served
    penalty: float  # [m] beyond ranges, and beyond endurances at cruise speed
    finish: float  # [s]
    lateness: float  # [s] sum over all tasks
    violations: tuple[str, ...]  # texts; empty: the plan is valid


def evaluate_routes(uavs: Sequence[Uav], tasks: Sequence[Task], rules: Rules,
             routes: Mapping[str, Trips], leg: LegOf | None = None,
             held: Held | None = None, reversed: Collection[str] = (),
             given: Mapping[str, GivenWaits] | None = None) -> TimedEvaluation:
    """Evaluate routes with the best departures, or with those that are given.

    Args:
        uavs: the fleet.
        tasks: all tasks, locked ones included.
        rules: how routes end, ranges, objective, number of trips.
        routes: trips by UAV id.
        leg: lengths and flight times; None: straight legs.
        held: locked tasks, whose windows are no rule, and payloads on board.
        reversed: ids of the tasks with a path that are flown from their last point.
        given: departures and waits by UAV id; a UAV without has the best departures.

    Returns:
        Times, cost and violations.
    """
    held, leg = held or Held(), leg or straight_legs(rules)
    wrong = [task.id for task in tasks if task.id in reversed and not task.reversible]
    tasks = turned_tasks(tasks, reversed)
    known = {task.id: task for task in tasks}
    fleet = {uav.id: uav for uav in uavs}
    violations = [f'{uav_id} is no UAV' for uav_id in routes.keys() - fleet.keys()]
    violations += [f'{name} is flown from its last point' for name in wrong]
    violations += _wrong_tasks(known, routes)
    trips = [each for uav in uavs for each in scheduled_trips(
        uav, [[known[name] for name in row if name in known] for row in routes.get(uav.id, ())],
        rules, leg, held, (given or {}).get(uav.id))]
    holders = _holders(uavs, tasks, held)
    for trip in trips:
        violations += _trip_violations(trip, rules, held)
        violations += _foreign_loads(trip, holders)
    for uav in uavs:
        violations += _route_violations(uav, [t for t in trips if t.uav is uav], rules, held)
    return _evaluation(tasks, rules, trips, violations)


def _wrong_tasks(known: Mapping[str, Task], routes: Mapping[str, Trips]) -> Iterator[str]:
    served: dict[str, str] = {}
    for uav_id, rows in routes.items():
        for name in (name for row in rows for name in row):
            if name not in known:
                yield f'{uav_id} serves {name}, which is no task'
            elif name in served:
                yield f'{uav_id} serves {name}, which {served[name]} serves'
            served[name] = uav_id


def _trip_violations(trip: Trip, rules: Rules, held: Held) -> Iterator[str]:
    """What one trip violates: windows, ability, range, endurance, load."""
    name, place = trip.uav.id, f'{trip.uav.id}, trip {trip.number + 1}'
    if math.isinf(trip.metres):
        yield f'{place} has a leg without a safe way'
        return
    for stop, start in zip(trip.stops, trip.starts, strict=True):
        task = stop.task
        if not task.required_capabilities <= trip.uav.capabilities or (
                task.allowed_uavs is not None and name not in task.allowed_uavs):
            yield f'{name} may not serve {task.id}'
        if (start > task.latest + ROUNDING and math.isinf(rules.objective.lateness)
                and not stop.is_locked):
            yield f'{name} starts {task.id} at {start:.1f} s, its latest is {task.latest:.1f} s'
    if rules.hard and trip.metres > trip.range * (1.0 + 1e-9) + ROUNDING:
        yield f'{place} is {trip.metres:.1f} m long, the range is {trip.range:.1f} m'
    if rules.hard and trip.in_air > trip.endurance + ROUNDING:
        yield f'{place} takes {trip.in_air:.1f} s, the endurance is {trip.endurance:.1f} s'
    yield from _load_violations(trip, place, held)


def _load_violations(trip: Trip, place: str, held: Held) -> Iterator[str]:
    loaded = [stop.task for stop in trip.stops if stop.task.payload > 0.0]
    if trip.on_ground:
        load = math.fsum(task.payload for task in loaded)
        if load > trip.uav.payload_capacity + ROUNDING:
            yield f'{place} carries {load:g} kg, the capacity is {trip.uav.payload_capacity:g} kg'
        return
    for task in loaded:
        if not held.has_aboard(trip.uav, task):
            yield f'{trip.uav.id} is in the air without the payload of {task.id}'


def _holders(uavs: Sequence[Uav], tasks: Sequence[Task], held: Held) -> dict[str, list[Uav]]:
    """By id of each task whose payload is on board: the UAVs that have it."""
    known, found = {task.id: task for task in tasks}, dict[str, list[Uav]]()
    for uav in (uav for uav in uavs if not uav.at_base):
        names = {*held.locked.get(uav.id, ()), *held.aboard.get(uav.id, uav.aboard or ())}
        for name in names:
            if name in known and held.has_aboard(uav, known[name]):
                found.setdefault(name, []).append(uav)
    return found


def _foreign_loads(trip: Trip, holders: Mapping[str, Sequence[Uav]]) -> Iterator[str]:
    """Tasks whose payload is on board of another UAV, or was when this one left its base."""
    for task in (stop.task for stop in trip.stops):
        for uav in holders.get(task.id, ()):
            if uav is not trip.uav or trip.number > 0:
                yield (f'{trip.uav.id}, trip {trip.number + 1} serves {task.id}, whose payload is '
                       f'on board of {uav.id}')


def _route_violations(uav: Uav, trips: Sequence[Trip], rules: Rules,
                      held: Held) -> Iterator[str]:
    """What the route of a UAV violates: number of trips, availability, locked tasks."""
    most = rules.trips if uav.turnaround < math.inf else 1
    if len(trips) > most:
        yield f'{uav.id} makes {len(trips)} trips, at most {most} are allowed'
    if trips and trips[-1].end > uav.available_until + ROUNDING:
        yield (f'{uav.id} ends at {trips[-1].end:.1f} s, it is available until '
               f'{uav.available_until:.1f} s')
    first = [stop.task.id for stop in trips[0].stops] if trips else []
    wanted = list(held.locked.get(uav.id, ()))
    if first[:len(wanted)] != wanted:
        yield f'{uav.id} begins with {", ".join(first) or "nothing"}, locked are {wanted}'


def _evaluation(tasks: Sequence[Task], rules: Rules, trips: Sequence[Trip],
                violations: Sequence[str]) -> TimedEvaluation:
    """Times and cost of trips that are scheduled."""
    arrivals, starts, late = dict[str, float](), dict[str, float](), dict[str, float]()
    rows, departures = dict[str, tuple[tuple[str, ...], ...]](), dict[str, tuple[float, ...]]()
    ends = dict[str, float]()
    for trip in trips:
        names = tuple(stop.task.id for stop in trip.stops)
        arrivals.update(zip(names, trip.arrivals, strict=True))
        starts.update(zip(names, trip.starts, strict=True))
        rows[trip.uav.id] = (*rows.get(trip.uav.id, ()), names)
        departures[trip.uav.id] = (*departures.get(trip.uav.id, ()), trip.departure)
        ends[trip.uav.id] = trip.end
    for task in tasks:
        if starts.get(task.id, -math.inf) > task.latest + ROUNDING:
            late[task.id] = starts[task.id] - task.latest
    timetable = Timetable(arrivals, starts, rows, departures, ends,
                          response_time(tasks, starts), late)
    distance = math.fsum(trip.metres for trip in trips)
    penalty = math.fsum(_excess(trip) for trip in trips)
    finish, lateness = max(ends.values(), default=0.0), math.fsum(late.values())
    cost = rules.objective.cost(
        distance, finish, timetable.response, lateness,
        math.fsum(task.value for task in tasks if task.id not in starts))
    cost += excess_cost(rules.weights) * rules.objective.distance * penalty
    return TimedEvaluation(timetable, cost, distance,
                      math.fsum(task.value for task in tasks if task.id in starts), penalty,
                      finish, lateness, tuple(violations))


def _excess(trip: Trip) -> float:
    """[m] beyond range, and beyond endurance at cruise speed."""
    metres = max(0.0, trip.metres - trip.range)
    seconds = max(0.0, trip.in_air - trip.endurance)
    return (metres if metres > ROUNDING else 0.0) + (
        seconds * trip.uav.cruise_speed if seconds > ROUNDING else 0.0)


def evaluate_legs(uavs: Sequence[Uav], tasks: Sequence[Task], rules: Rules,
                  routes: Mapping[str, Trips], legs: Mapping[str, Sequence[Leg]],
                  held: Held | None = None, reversed: Collection[str] = (),
                  given: Mapping[str, GivenWaits] | None = None) -> TimedEvaluation:
    """Evaluate routes along their legs.

    Args:
        uavs, tasks, rules, routes, held, reversed, given: as for `evaluate_routes`.
        legs: by UAV id; one to each task and to each base at the end of a trip.

    Returns:
        As `evaluate_routes`.
    """
    return evaluate_routes(uavs, tasks, rules, routes, legs_flown(legs), held, reversed, given)


def legs_flown(legs: Mapping[str, Sequence[Leg]]) -> LegOf:
    """Return what measures legs that are asked for in the order in which they are flown.

    Args:
        legs: by UAV id.

    Returns:
        A function of UAV, start and end: length [m] and flight time [s].
    """
    rest = {uav_id: iter(row) for uav_id, row in legs.items()}

    def leg_of(uav: Uav, start: Point, end: Point) -> tuple[float, float]:
        leg = next(rest.get(uav.id, iter(())), None)
        if leg is None:  # where no safe way leads home the route ends at its last task
            return 0.0, 0.0
        return leg.length, flight_time(uav, (start, *leg.via, end))

    return leg_of
