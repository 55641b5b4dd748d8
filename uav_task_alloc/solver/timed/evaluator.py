# SPDX-License-Identifier: Apache-2.0
"""The evaluator of plans with time: what routes cost and violate, in Python without kernels.

It is independent of the search, which must agree with it: all plans with time are evaluated here
before they are returned.

A trip begins at its ready time: now or `available_from`; after a visit of the base, `turnaround`
later. A UAV on the ground takes off as late as is useful: waiting there uses no endurance. A UAV
in the air cannot wait without using endurance, which counts from now.

With departure d, service i starts at max(K_i, d + C_i): C_i is flying and service before it, K_i
follows from windows and releases. So a later departure shortens the trip until nobody waits
anywhere, and until then its end stays the same.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from uav_task_alloc.geometry.flight_time import flight_time, service_seconds
from uav_task_alloc.model import Leg, Point, Task, Uav, turned_tasks
from uav_task_alloc.objective import response_time
from uav_task_alloc.solver.problem import Rules, excess_cost
from uav_task_alloc.timetable import Timetable

_TOLERANCE = 1e-6  # [s], [m] or [kg] that are rounding
Trips = Sequence[Sequence[str]]  # task ids of each trip
LegOf = Callable[[Uav, Point, Point], tuple[float, float]]  # length [m] and flight time [s]


@dataclass(frozen=True, slots=True)
class Held:
    """What UAVs hold already, by UAV id.

    Arguments of methods:
        uav: of the fleet.
        task: any.
    """

    locked: Mapping[str, Sequence[str]] = field(default_factory=dict)  # first tasks of its route
    aboard: Mapping[str, frozenset[str]] = field(default_factory=dict)  # payload on board

    def has_locked(self, uav: Uav, task: Task) -> bool:
        """Whether the task is locked to the UAV."""
        return task.id in self.locked.get(uav.id, ())

    def has_aboard(self, uav: Uav, task: Task) -> bool:
        """Whether a UAV in the air has the payload of the task on board."""
        return not uav.at_base and task.payload > 0.0 and (
            self.has_locked(uav, task) or task.id in self.aboard.get(uav.id, uav.aboard or ()))


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


@dataclass(frozen=True, slots=True)
class _Stop:
    """A task on a trip and the leg to it."""

    task: Task
    seconds: float  # of the leg
    service: float  # [s] with the flight along its path
    is_locked: bool


@dataclass(slots=True)
class _Trip:
    """One trip of a UAV: when it departs, starts its services and ends, and what it takes."""

    uav: Uav
    number: int  # from 0
    stops: list[_Stop]
    metres: float
    last_leg: float  # [s] to the base; 0 where it ends at its last task
    departure: float = 0.0  # [s]
    end: float = 0.0  # [s]
    arrivals: list[float] = field(default_factory=list)  # [s]
    starts: list[float] = field(default_factory=list)  # [s]

    @property
    def on_ground(self) -> bool:
        """Whether it begins at the base."""
        return self.number > 0 or self.uav.at_base

    @property
    def endurance(self) -> float:
        """[s] that it may be in the air."""
        full = self.uav.full_endurance
        return self.uav.endurance if self.number == 0 or full is None else full

    @property
    def range(self) -> float:
        """[m] that it may fly."""
        full = self.uav.full_range
        return self.uav.range if self.number == 0 or full is None else full

    @property
    def in_air(self) -> float:
        """[s] in the air: from now where it is in the air already."""
        return self.end - (self.departure if self.on_ground else 0.0)


def straight_legs(rules: Rules) -> LegOf:
    """Return what measures straight legs; cut lengths are flown at cruise speed.

    Args:
        rules: whether lengths are cut.

    Returns:
        A function of UAV, start and end: length [m] and flight time [s].
    """
    def leg(uav: Uav, start: Point, end: Point) -> tuple[float, float]:
        metres = math.dist(start, end)
        if not rules.grain:
            return metres, flight_time(uav, (start, end))
        metres = math.floor(metres * rules.grain) / rules.grain
        return metres, metres / uav.cruise_speed
    return leg


def evaluate_routes(uavs: Sequence[Uav], tasks: Sequence[Task], rules: Rules,
             routes: Mapping[str, Trips], leg: LegOf | None = None,
             held: Held | None = None, reversed: Collection[str] = ()) -> TimedEvaluation:
    """Evaluate routes with the best departures.

    Args:
        uavs: the fleet.
        tasks: all tasks, locked ones included.
        rules: how routes end, ranges, objective, number of trips.
        routes: trips by UAV id.
        leg: lengths and flight times; None: straight legs.
        held: locked tasks, whose windows are no rule, and payloads on board.
        reversed: ids of the tasks with a path that are flown from their last point.

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
    trips = [each for uav in uavs for each in _trips(
        uav, [[known[name] for name in row if name in known] for row in routes.get(uav.id, ())],
        rules, leg, held)]
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


def _trips(uav: Uav, rows: Sequence[Sequence[Task]], rules: Rules, leg: LegOf,
           held: Held) -> list[_Trip]:
    """The trips of a UAV with their times; none where it serves nothing."""
    if not any(rows):
        return []
    made: list[_Trip] = []
    place, ready = uav.position, uav.available_from
    for number, row in enumerate(rows):
        trip = _Trip(uav, number, [], 0.0, 0.0)
        for task in row:
            metres, seconds = leg(uav, place, task.position)
            trip.stops.append(_Stop(task, seconds, service_seconds(uav, task),
                                    held.has_locked(uav, task)))
            trip.metres += metres + task.path_length
            place = task.end
        if rules.returns or number + 1 < len(rows):
            metres, trip.last_leg = leg(uav, place, uav.base)
            trip.metres += metres
        _schedule(trip, ready, rules, held)
        place, ready = uav.base, trip.end + uav.turnaround
        made.append(trip)
    return made


def _schedule(trip: _Trip, ready: float, rules: Rules, held: Held) -> None:
    """Set the times of a trip: departure, starts of services, end."""
    releases = [ready, *(stop.task.release for stop in trip.stops
                         if stop.task.payload > 0.0 and not (
                             trip.number == 0 and held.has_aboard(trip.uav, stop.task)))]
    if trip.on_ground and trip.stops:
        releases.append(trip.stops[0].task.release)
    earliest = max(releases)
    _fly(trip, earliest)
    busy = math.fsum(stop.seconds + stop.service for stop in trip.stops) + trip.last_leg
    if trip.on_ground and trip.end - trip.departure > busy + _TOLERANCE:  # it waits somewhere
        _fly(trip, earliest + _postponement(trip, rules))


def _fly(trip: _Trip, departure: float) -> None:
    trip.departure = time = departure
    arrivals, starts = [], []
    for stop in trip.stops:
        task = stop.task
        time = (time if time > task.release else task.release) + stop.seconds
        arrivals.append(time)
        time = time if time > task.earliest else task.earliest
        starts.append(time)
        time += stop.service
    trip.arrivals, trip.starts, trip.end = arrivals, starts, time + trip.last_leg


def _postponement(trip: _Trip, rules: Rules) -> float:
    """Seconds by which the departure is useful to postpone; the trip flies at its earliest now.

    As much as endurance needs, but not past a latest start; and as far as nothing that the
    objective counts changes.
    """
    elapsed, harmless, allowed = 0.0, math.inf, math.inf  # elapsed: flying and service before
    for stop, start in zip(trip.stops, trip.starts, strict=True):
        elapsed += stop.seconds
        unforced = trip.departure + elapsed
        limit = math.inf if stop.is_locked else stop.task.latest
        if math.isinf(rules.objective.lateness):
            allowed = min(allowed, max(limit, start) - unforced)
        counted = start if rules.objective.response > 0.0 else max(limit, start)
        harmless = min(harmless, counted - unforced)
        elapsed += stop.service
    waiting = trip.end - trip.departure - elapsed - trip.last_leg
    needed = max(0.0, trip.end - trip.departure - trip.endurance)
    return max(0.0, min(waiting, allowed, max(needed, harmless)))


def _trip_violations(trip: _Trip, rules: Rules, held: Held) -> Iterator[str]:
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
        if (start > task.latest + _TOLERANCE and math.isinf(rules.objective.lateness)
                and not stop.is_locked):
            yield f'{name} starts {task.id} at {start:.1f} s, its latest is {task.latest:.1f} s'
    if rules.hard and trip.metres > trip.range * (1.0 + 1e-9) + _TOLERANCE:
        yield f'{place} is {trip.metres:.1f} m long, the range is {trip.range:.1f} m'
    if rules.hard and trip.in_air > trip.endurance + _TOLERANCE:
        yield f'{place} takes {trip.in_air:.1f} s, the endurance is {trip.endurance:.1f} s'
    yield from _load_violations(trip, place, held)


def _load_violations(trip: _Trip, place: str, held: Held) -> Iterator[str]:
    loaded = [stop.task for stop in trip.stops if stop.task.payload > 0.0]
    if trip.on_ground:
        load = math.fsum(task.payload for task in loaded)
        if load > trip.uav.payload_capacity + _TOLERANCE:
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


def _foreign_loads(trip: _Trip, holders: Mapping[str, Sequence[Uav]]) -> Iterator[str]:
    """Tasks whose payload is on board of another UAV, or was when this one left its base."""
    for task in (stop.task for stop in trip.stops):
        for uav in holders.get(task.id, ()):
            if uav is not trip.uav or trip.number > 0:
                yield (f'{trip.uav.id}, trip {trip.number + 1} serves {task.id}, whose payload is '
                       f'on board of {uav.id}')


def _route_violations(uav: Uav, trips: Sequence[_Trip], rules: Rules,
                      held: Held) -> Iterator[str]:
    """What the route of a UAV violates: number of trips, availability, locked tasks."""
    most = rules.trips if uav.turnaround < math.inf else 1
    if len(trips) > most:
        yield f'{uav.id} makes {len(trips)} trips, at most {most} are allowed'
    if trips and trips[-1].end > uav.available_until + _TOLERANCE:
        yield (f'{uav.id} ends at {trips[-1].end:.1f} s, it is available until '
               f'{uav.available_until:.1f} s')
    first = [stop.task.id for stop in trips[0].stops] if trips else []
    wanted = list(held.locked.get(uav.id, ()))
    if first[:len(wanted)] != wanted:
        yield f'{uav.id} begins with {", ".join(first) or "nothing"}, locked are {wanted}'


def _evaluation(tasks: Sequence[Task], rules: Rules, trips: Sequence[_Trip],
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
        if starts.get(task.id, -math.inf) > task.latest + _TOLERANCE:
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


def _excess(trip: _Trip) -> float:
    """[m] beyond range, and beyond endurance at cruise speed."""
    metres = max(0.0, trip.metres - trip.range)
    seconds = max(0.0, trip.in_air - trip.endurance)
    return (metres if metres > _TOLERANCE else 0.0) + (
        seconds * trip.uav.cruise_speed if seconds > _TOLERANCE else 0.0)


def evaluate_legs(uavs: Sequence[Uav], tasks: Sequence[Task], rules: Rules,
                  routes: Mapping[str, Trips], legs: Mapping[str, Sequence[Leg]],
                  held: Held | None = None,
                  reversed: Collection[str] = ()) -> TimedEvaluation:
    """Evaluate routes along their legs.

    Args:
        uavs, tasks, rules, routes, held, reversed: as for `evaluate_routes`.
        legs: by UAV id; one to each task and to each base at the end of a trip.

    Returns:
        As `evaluate_routes`.
    """
    places, ways = {task.id: (task.position, task.end)
                    for task in turned_tasks(tasks, reversed)}, {}
    for uav in uavs:
        rows = routes.get(uav.id, ())
        stops = [(uav.position, uav.position)]  # where each begins and ends
        for number, row in enumerate(rows):
            stops += [places[name] for name in row]
            stops += [(uav.base, uav.base)] * (number + 1 < len(rows) or rules.returns)
        for (_, start), (end, _), leg in zip(stops, stops[1:], legs.get(uav.id, ()),
                                             strict=False):
            ways[uav.id, start, end] = leg.length, flight_time(uav, (start, *leg.via, end))

    def leg_of(uav: Uav, start: Point, end: Point) -> tuple[float, float]:
        # where no safe way leads home the route ends at its last task
        return ways.get((uav.id, start, end), (0.0, 0.0))

    return evaluate_routes(uavs, tasks, rules, routes, leg_of, held, reversed)
