# SPDX-License-Identifier: Apache-2.0
"""The true world of `deadlines.py`: UAVs that fly in a wind, and stop at their tasks."""
from __future__ import annotations

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass

from deadline_motion import HEIGHT, SPEED, along, over_ground, travel_seconds

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import TaskEvent, TaskEventKind
from uav_task_alloc.model import Point, Task

SIDE, STEP = 2000.0, 0.5  # [m], [s]
ACCELERATION = 1.5, 4.0  # [m/s2] of all UAVs of a mission: from, to
FINE = 0.05  # [s] step of a flight


@dataclass(slots=True)
class Craft:
    """A simulated UAV: position, task under way and the service that it is busy with."""

    place: Point
    busy: float = 0.0  # [s] left of the stop it is at
    started: str = ''
    velocity: Point = (0.0, 0.0, 0.0)


class TrueFleet:
    """UAVs in a wind, with accelerations, that the allocator is not given.

    Args:
        rng: random numbers of the mission.
        allocator: whose lists are flown.
        now: [s]
    """

    def __init__(self, rng: random.Random, allocator: Allocator, now: float) -> None:
        self.rng, self.allocator, self.world = rng, allocator, allocator.world
        angle, force = rng.uniform(0.0, math.tau), rng.uniform(0.0, SPEED / 3.0)
        self.wind = force * math.cos(angle), force * math.sin(angle)
        self.acceleration = rng.uniform(*ACCELERATION)
        self.crafts = {f'u{k}': Craft(self.spot()) for k in range(rng.randint(3, 5))}
        self.lost: set[str] = set()
        self.done: dict[str, float] = {}  # start of the service, by task
        self.flown_until = now

    def spot(self) -> Point:
        """Return a random place at the height of all flights."""
        return self.rng.uniform(0.0, SIDE), self.rng.uniform(0.0, SIDE), HEIGHT

    def flying(self) -> list[str]:
        """Names of the UAVs that are not lost."""
        return sorted(self.crafts.keys() - self.lost)

    def join(self) -> None:
        """Let another UAV arrive."""
        self.crafts[f'u{len(self.crafts)}'] = Craft(self.spot())

    def starts(self, lists: Mapping[str, UavList], now: float) -> dict[str, float]:
        """When the services of lists will truly start, where their UAVs are not known as lost."""
        starts = {}
        for name, each in lists.items():
            record = self.world.uav_record(name)
            if record is None or record.silent or name in self.lost:
                continue
            craft, clock = self.crafts[name], now
            place, busy, velocity = craft.place, craft.busy, craft.velocity
            for stop in each.stops:
                task = stop.task
                if not self.world.tasks.is_open(task.id):
                    continue
                if task.id in self.done:  # it is being served
                    clock, busy = clock + busy, 0.0
                    continue
                clock += self._seconds(place, task.position, velocity)
                clock, velocity = max(clock, task.earliest), (0.0, 0.0, 0.0)
                starts[task.id], place = clock, task.position
                clock += task.service_time
        return starts

    def _seconds(self, start: Point, end: Point, velocity: Point) -> float:
        """Time of a leg that ends at rest, in the true wind [s]."""
        dx, dy = end[0] - start[0], end[1] - start[1]
        return travel_seconds(math.hypot(dx, dy), over_ground(self.wind, dx, dy),
                              along(velocity, dx, dy), self.acceleration)

    def fly(self, now: float) -> float:
        """Fly all lists for one STEP, and for as long as was planned; returns its end [s]."""
        end = now + STEP
        for name in self.flying():
            self._fly(name, self.crafts[name], now, end)
        self.flown_until = end
        return end

    def _fly(self, name: str, craft: Craft, now: float, end: float) -> None:
        clock = self.flown_until
        while clock < end - 1e-9:
            stops = [stop for stop in self.world.list_of(name).stops
                     if self.world.tasks.is_open(stop.task.id)]
            if not stops:
                craft.velocity = 0.0, 0.0, 0.0
                return
            task = stops[0].task
            if craft.started != task.id:
                craft.started = task.id
                self._event(name, TaskEventKind.STARTED, task.id, clock)
            if task.id not in self.done:
                clock = self._towards(craft, task, clock, end)
                continue
            spent = min(craft.busy, end - clock)
            craft.busy, clock = craft.busy - spent, clock + spent
            if craft.busy <= 1e-9:
                craft.started = ''
                self._event(name, TaskEventKind.COMPLETED, task.id, clock)
                self.allocator.tick(max(clock, now), max(clock, now))

    def _towards(self, craft: Craft, task: Task, clock: float, end: float) -> float:
        """Fly to a task, or wait for its window there; returns the time reached."""
        while clock < end - 1e-9:
            dx, dy = task.position[0] - craft.place[0], task.position[1] - craft.place[1]
            metres, dt = math.hypot(dx, dy), min(FINE, end - clock)
            change = self.acceleration * dt
            speed = min(over_ground(self.wind, dx, dy), along(craft.velocity, dx, dy) + change,
                        max(change, math.sqrt(2.0 * self.acceleration * metres)))
            if metres <= speed * dt:
                craft.place, craft.velocity = task.position, (0.0, 0.0, 0.0)
                clock += metres / speed
                break
            share = speed * dt / metres
            craft.place = craft.place[0] + share * dx, craft.place[1] + share * dy, HEIGHT
            craft.velocity = speed * dx / metres, speed * dy / metres, 0.0
            clock += dt
        if craft.place != task.position or task.earliest > end:
            return end
        self.done[task.id] = start = max(clock, task.earliest)
        craft.busy = task.service_time
        return min(start, end)

    def _event(self, name: str, kind: TaskEventKind, task_id: str, clock: float) -> None:
        """Report progress of a task."""
        self.world.event(TaskEvent(task_id, name, self.world.list_of(name).revision, kind),
                         clock, clock)
