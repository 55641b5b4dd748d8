# SPDX-License-Identifier: Apache-2.0
"""The schedule of trips with the best departures: arrivals, starts and ends, without kernels.

A trip begins at its ready time: now or `available_from`; after a visit of the base, `turnaround`
later. A UAV on the ground takes off as late as is useful: waiting there uses no endurance. A UAV
in the air cannot wait without using endurance, which counts from now.

With departure d, service i starts at max(K_i, d + C_i): C_i is flying and service before it, K_i
follows from windows and releases. So a later departure shortens the trip until nobody waits
anywhere, and until then its end stays the same.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from uav_task_alloc.geometry.flight_time import flight_time, service_seconds
from uav_task_alloc.model import Point, Task, Uav
from uav_task_alloc.solver.problem import Rules

ROUNDING = 1e-6  # [s], [m] or [kg] that are rounding
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
class GivenWaits:
    """When the trips of a UAV depart at the earliest, and how long it waits before each leg.

    Such trips are not postponed. A wait counts from when the leg would begin: where it is early
    for the window of a task it waits for that before the leg, too.
    """

    departures: Sequence[float]  # [s] of each trip
    waits: Sequence[float]  # [s] before each leg, also of those to the base


@dataclass(frozen=True, slots=True)
class Stop:
    """A task on a trip and the leg to it."""

    task: Task
    seconds: float  # of the leg
    service: float  # [s] with the flight along its path
    is_locked: bool
    wait: float = 0.0  # [s] before the leg, as given


@dataclass(slots=True)
class Trip:
    """One trip of a UAV: when it departs, starts its services and ends, and what it takes."""

    uav: Uav
    number: int  # from 0
    stops: list[Stop]
    metres: float
    last_leg: float  # [s] to the base, with a wait before it; 0 where it ends at its last task
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


def scheduled_trips(uav: Uav, rows: Sequence[Sequence[Task]], rules: Rules, leg: LegOf,
                    held: Held, given: GivenWaits | None = None) -> list[Trip]:
    """The trips of a UAV with their times, the best or with what is given; none without tasks."""
    if not any(rows):
        return []
    made: list[Trip] = []
    waits = iter(given.waits if given else ())
    place, ready = uav.position, uav.available_from
    for number, row in enumerate(rows):
        trip = Trip(uav, number, [], 0.0, 0.0)
        for task in row:
            metres, seconds = leg(uav, place, task.position)
            trip.stops.append(Stop(task, seconds, service_seconds(uav, task),
                                    held.has_locked(uav, task), next(waits, 0.0)))
            trip.metres += metres + task.path_length
            place = task.end
        if rules.returns or number + 1 < len(rows):
            metres, trip.last_leg = leg(uav, place, uav.base)
            trip.metres += metres
            trip.last_leg += next(waits, 0.0)
        if given:
            _fly(trip, max(ready, given.departures[number]))
        else:
            _schedule(trip, ready, rules, held)
        place, ready = uav.base, trip.end + uav.turnaround
        made.append(trip)
    return made


def _schedule(trip: Trip, ready: float, rules: Rules, held: Held) -> None:
    """Set the times of a trip: departure, starts of services, end."""
    releases = [ready, *(stop.task.release for stop in trip.stops
                         if stop.task.payload > 0.0 and not (
                             trip.number == 0 and held.has_aboard(trip.uav, stop.task)))]
    if trip.on_ground and trip.stops:
        releases.append(trip.stops[0].task.release)
    earliest = max(releases)
    _fly(trip, earliest)
    busy = math.fsum(stop.seconds + stop.service for stop in trip.stops) + trip.last_leg
    if trip.on_ground and trip.end - trip.departure > busy + ROUNDING:  # it waits somewhere
        _fly(trip, earliest + _postponement(trip, rules))


def _fly(trip: Trip, departure: float) -> None:
    trip.departure = time = departure
    arrivals, starts = [], []
    for k, stop in enumerate(trip.stops):
        task = stop.task
        time = time if time > task.release else task.release
        if stop.wait > 0.0:
            time = max(time, task.earliest - stop.seconds) + stop.wait
            if k == 0:
                trip.departure = time
        time += stop.seconds
        arrivals.append(time)
        time = time if time > task.earliest else task.earliest
        starts.append(time)
        time += stop.service
    trip.arrivals, trip.starts, trip.end = arrivals, starts, time + trip.last_leg


def _postponement(trip: Trip, rules: Rules) -> float:
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
