# SPDX-License-Identifier: Apache-2.0
"""UAVs that fly task lists as bridge and autopilot do, over virtual time, for separation.py."""
from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.records import TaskEventKind, UavReport
from uav_task_alloc.model import Leg as PlannedLeg, Point

ACCELERATION, CLIMB, DESCENT = 3.0, 2.5, 1.5  # [m/s2], [m/s], [m/s]
SPEED = 15.0  # [m/s] as reported; each UAV flies another one
LINK, ARMING = 0.8, 3.0  # [s] until a list or a hold is flown; from the ground to the climb
CRUISE = 50.0  # [m] to which it climbs, the default of the bridge
TOLERANCE, SHORTEST = 5.0, 1.0  # [s] by which a wait is off before it changes; a shorter is none
SHARP = math.cos(math.radians(30.0))  # corners at which it stops


@dataclass(slots=True)
class Leg:
    """A point to fly to, and what follows there."""

    point: Point
    task: str = ''  # served there; '': none
    service: float = 0.0  # [s]
    wait: float = 0.0  # [s] before the leg begins
    begin: float = 0.0  # [s] of the service after the wait
    lands: bool = False


@dataclass(slots=True)
class Craft:
    """One UAV: where it is, what it flies, and which holds it obeys."""

    name: str
    home: Point
    speed: float  # [m/s] through the air, true
    wind: tuple[float, float]
    place: Point = (0.0, 0.0, 0.0)
    rate: float = 0.0  # [m/s] along its way
    velocity: Point = (0.0, 0.0, 0.0)
    landed: bool = True
    dead: bool = False
    held: bool = False
    revision: int = 0
    legs: list[Leg] = field(default_factory=list)
    until: float = 0.0  # [s] it waits or serves
    serving: str = ''
    waiting: tuple[str, float] = ('', 0.0)  # task before whose leg it waits, begin of the service
    climbing: bool = False
    airborne_for: float = 0.0  # [s]
    orders: list[tuple[float, object]] = field(default_factory=list)  # lists and holds under way
    started: set[str] = field(default_factory=set)
    done: set[str] = field(default_factory=set)
    goes_home: bool = False  # its list ends with a return
    via: tuple[Point, ...] = ()  # detour points of the leg under way, as of its last list

    def receive(self, order: object, now: float) -> None:
        """Take a list or a hold, which is flown after the delay of the link."""
        self.orders.append((now + LINK, order))

    def report(self) -> UavReport:
        """What the bridge would report."""
        mode = ('STANDBY' if self.landed else 'TAKEOFF' if self.climbing else 'HOLD' if self.held
                else 'LANDING' if self.descends else 'RETURNING' if self.returns else
                'ON_MISSION' if self.legs or self.serving else 'HOLD')
        task = '' if self.landed else self.serving or self._next_task
        return UavReport(self.name, self.place, self.home, cruise_speed=SPEED,
                         active_task=task if mode in ('TAKEOFF', 'ON_MISSION', 'HOLD') else '',
                         list_revision=self.revision, standby=self.landed,
                         velocity=self.velocity, climb_speed=CLIMB, descent_speed=DESCENT,
                         mode=mode, authority='HELD', takeoff_height=CRUISE)

    @property
    def returns(self) -> bool:
        """Whether no task is left, and it flies home."""
        return self.goes_home and bool(self.legs) and not self.serving and not any(
            leg.task for leg in self.legs)

    @property
    def descends(self) -> bool:
        """Whether it comes down on its pad."""
        return bool(self.legs) and self.legs[0].lands

    def fly(self, now: float, dt: float) -> Iterator[tuple[TaskEventKind, str]]:
        """Fly for `dt` [s]; yields the progress of tasks."""
        while self.orders and self.orders[0][0] <= now:
            self._obey(self.orders.pop(0)[1], now)
        before = self.place
        if self.serving and now >= self.until:
            self.done.add(self.serving)
            yield TaskEventKind.COMPLETED, self.serving
            self.serving = ''
            self._wait(now)
        if self.landed:
            self._take_off(now)
        elif not self.serving:
            task = self._next_task  # from the first detour point on, as of its mission items
            if task and task not in self.started and not self.climbing:
                self.started.add(task)
                yield TaskEventKind.STARTED, task
            self._move(now, dt)
        self.airborne_for += 0.0 if self.landed else dt
        self.velocity = tuple((q - p) / dt for p, q in zip(before, self.place, strict=True))

    def _obey(self, order: object, now: float) -> None:
        if isinstance(order, bool):
            self.held = order
            return
        assert isinstance(order, UavList)
        self.revision, self.goes_home = order.revision, order.returns
        stops = [stop for stop in order.stops if stop.task.id not in self.done]
        if self.serving and stops and stops[0].task.id == self.serving:
            stops = stops[1:]
        legs: list[Leg] = []
        for stop in stops:
            begin = now + stop.eta + stop.wait
            legs += [Leg(point, wait=stop.wait if k == 0 else 0.0, begin=begin)
                     for k, point in enumerate(stop.leg.via)]
            legs.append(Leg(stop.task.position, stop.task.id, stop.task.service_time,
                            0.0 if stop.leg.via else stop.wait, begin))
        if order.returns and (legs or self.serving or not self.landed):
            last = legs[-1].point if legs else self.place
            legs += [Leg(point) for point in order.end_via]
            top = order.end_via[-1][2] if order.end_via else last[2]
            above = (*self.home[:2], max(top, self.home[2] + 5.0))
            legs += [Leg(above)] if not legs or legs[-1].point != above else []
            legs.append(Leg(self.home, lands=True))
        elif not (legs or self.landed):  # to a waiting place, where there is one
            legs += [Leg(point) for point in order.end_via]
        waits = bool(self.waiting[0]) and now < self.until
        if (not self.legs and not self.landed) or self.climbing or self.serving or waits:
            self.legs, self.via = legs, _detour(legs)  # no leg is under way
        else:
            self.legs = self._not_passed(legs)
        if self.landed and self.legs:
            self.until = now + max(ARMING, self.legs[0].wait)
        elif waits and not self.serving:
            self._wait_on(now)

    def _wait_on(self, now: float) -> None:
        """A wait goes on, changes or ends with the list, as in mavlink/mission/waits.py."""
        task, begin = self.waiting
        first = self.legs[0] if self.legs else None
        if first is None or task != self._next_task:
            self.until, self.waiting = now, ('', 0.0)
        elif abs(first.begin - begin) > TOLERANCE:
            self._wait(now)

    @property
    def _next_task(self) -> str:
        """The task that it flies to; '': home."""
        return next((leg.task for leg in self.legs if leg.task), '')

    def _not_passed(self, legs: list[Leg]) -> list[Leg]:
        """A list for a leg under way goes on after the detour points that were passed.

        Where it stands, as it holds, other detour points than before are flown.
        """
        ahead = self.legs[0].point if self.legs else None
        before, self.via = self.via, _detour(legs)
        if self.rate <= 0.0 and self.via != before:
            return legs
        for k, leg in enumerate(legs):
            if leg.point == ahead and not self.landed:
                return legs[k:]
            if leg.task:
                break
        return legs

    def _wait(self, now: float) -> None:
        """Wait at a stop before the next leg begins."""
        wait = self.legs[0].wait if self.legs else 0.0
        self.until = now + (wait if wait >= SHORTEST else 0.0)
        self.waiting = (self._next_task, self.legs[0].begin) if self.until > now else ('', 0.0)

    def _take_off(self, now: float) -> None:
        if self.legs and self.legs[0].task == '' and not any(leg.task for leg in self.legs):
            self.legs = []
        if self.legs and not self.held and now >= self.until:
            self.landed, self.climbing, self.rate = False, True, 0.0

    def _move(self, now: float, dt: float) -> None:
        if self.climbing:
            top = self.home[2] + max(CRUISE, 0.0)
            self.place = (*self.place[:2], min(top, self.place[2] + CLIMB * dt))
            self.climbing = self.place[2] < top
            return
        waits = self.held or now < self.until or not self.legs
        if waits and self.rate <= 0.0:
            return
        leg = self.legs[0] if self.legs else None
        if leg is None:
            self.rate = 0.0
            return
        far = math.dist(self.place, leg.point)
        if far < 1e-6:
            self._reached(leg, now)
            return
        way = tuple((q - p) / far for p, q in zip(self.place, leg.point, strict=True))
        most = 0.0 if waits else min(self._most(way), self._braking(far, way, leg))
        step = ACCELERATION * dt
        self.rate = max(min(self.rate, most + step) - step, min(self.rate + step, most), 0.0)
        moved = min(far, max(self.rate, 0.0 if waits else 0.3) * dt)
        self.place = tuple(p + moved * w for p, w in zip(self.place, way, strict=True))
        if far - moved < 0.5:
            self.place = leg.point
            self._reached(leg, now)

    def _most(self, way: Point) -> float:
        """Largest ground speed [m/s] in a direction."""
        level = math.hypot(way[0], way[1])
        most = math.inf
        if level > 1e-6:
            ux, uy = way[0] / level, way[1] / level
            along = self.wind[0] * ux + self.wind[1] * uy
            across = self.wind[0]**2 + self.wind[1]**2 - along**2
            most = (along + math.sqrt(max(1.0, self.speed**2 - across))) / level
        if abs(way[2]) > 1e-6:
            most = min(most, (CLIMB if way[2] > 0.0 else DESCENT) / abs(way[2]))
        return most

    def _braking(self, far: float, way: Point, leg: Leg) -> float:
        """Speed [m/s] from which it can stop at the end of a leg, where it has to."""
        if not leg.task and not leg.lands and len(self.legs) > 1 and self.legs[1].wait <= 1.0:
            ahead = math.dist(leg.point, self.legs[1].point)
            turn = 1.0 if ahead < 1e-6 else sum(
                w * (q - p) / ahead for w, p, q in zip(way, leg.point, self.legs[1].point,
                                                       strict=True))
            if turn > SHARP:
                return math.inf
        return math.sqrt(2.0 * 0.8 * ACCELERATION * far)

    def _reached(self, leg: Leg, now: float) -> None:
        self.legs.pop(0)
        if leg.lands:
            self.landed, self.rate, self.legs = True, 0.0, []
        elif leg.task:
            self.serving, self.until, self.rate = leg.task, now + leg.service, 0.0
        else:
            self._wait(now)


def _detour(legs: list[Leg]) -> tuple[Point, ...]:
    """The points before the first task."""
    first = next((k for k, leg in enumerate(legs) if leg.task), 0)
    return tuple(leg.point for leg in legs[:first])


@dataclass(frozen=True, slots=True)
class SentList:
    """A list that was flown, and what its UAV had done by then."""

    at: float  # [s]
    tasks: UavList
    done: frozenset[str]


class SamePlan:
    """The lists of a flight, flown again without their heights, waits and holds.

    The UAVs, which fly as they did, may have done less or more by then than they had: a task that
    is not done yet is flown first.
    """

    def __init__(self, crafts: Mapping[str, Craft], lists: list[SentList]) -> None:
        self.crafts, self._lists = crafts, lists
        self._open: dict[str, tuple[ListStop, ...]] = {}  # last sent, by UAV

    def fly(self, now: float, dt: float) -> None:
        """Send the lists that are due, and fly."""
        while self._lists and self._lists[0].at <= now:
            sent = self._lists.pop(0)
            craft = self.crafts[sent.tasks.uav]
            stops = *(stop for stop in self._open.get(craft.name, ()) if stop.task.id in sent.done
                      and stop.task.id not in craft.done), *(
                replace(stop, leg=PlannedLeg((), 0.0), wait=0.0) for stop in sent.tasks.stops)
            self._open[craft.name] = stops
            craft.receive(replace(sent.tasks, stops=stops, end_via=()), now)
        for craft in self.crafts.values():
            if not craft.dead:
                for _ in craft.fly(now, dt):
                    pass

    @property
    def over(self) -> bool:
        """Whether nothing is left to be sent or flown."""
        return not self._lists and all(craft.landed or craft.dead
                                       for craft in self.crafts.values())
