# SPDX-License-Identifier: Apache-2.0
"""Missions with deadlines, wind, lost UAVs and arrivals over virtual time, judged by an oracle.

Run: `python benchmarks/endurance/deadlines.py --missions 200 --seed 1`. The allocator is the real
one; its UAVs fly in a wind, and accelerate and brake at a rate, that it is not given. The last
line is JSON; the status is 1 where

- a re-plan broke an accepted deadline that the lists before it still kept: both are flown to their
  ends in a copy of the true world, wind and stops included, from where the UAVs were. Where by
  what was known then (reports and measured paces) nothing was broken it is `unforeseen`;
- a late task was reported later than an oracle with the same knowledge (reports and measured
  paces, timed here apart from the allocator's code) would have reported it.
"""
from __future__ import annotations

import argparse
import json
import math
import random
import statistics
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from deadline_motion import HEIGHT, SPEED, along, leg_seconds, over_ground, travel_seconds

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import (
    AnnouncementAction,
    TaskEvent,
    TaskEventKind,
    UavReport,
)
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.model import Plan, Point, Task
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.solver.solve import plan

SIDE, STEP = 2000.0, 0.5  # [m], [s]
ACCELERATION = 1.5, 4.0  # [m/s2] of all UAVs of a mission: from, to
FINE = 0.05  # [s] step of a flight
LENGTH, LATEST = 240.0, 600.0  # [s] of arrivals, and of a mission
ROUNDS = 150  # of bees in one solve
CLEAR = 2.0  # [s] by which the old lists must keep a deadline that counts as keepable
EARLY = 1.0  # [s] by which the oracle may be later than the allocator: one period


@dataclass(slots=True)
class Craft:
    """A simulated UAV: position, task under way and the service that it is busy with."""

    place: Point
    busy: float = 0.0  # [s] left of the stop it is at
    started: str = ''
    velocity: Point = (0.0, 0.0, 0.0)


@dataclass(slots=True)
class Judged:
    """What a mission has shown."""

    broken: list[str] = field(default_factory=list)
    unforeseen: list[str] = field(default_factory=list)  # by what was known nothing was broken
    reported_late: list[str] = field(default_factory=list)
    kept: int = 0
    late: int = 0
    refused: int = 0
    errors: list[float] = field(default_factory=list)  # [s] of starts expected 60 s before


def solve(*world: object, max_iterations: int | None, **how: object) -> Plan:
    """Solve for a number of iterations, not until a time."""
    return plan(*world, max_iterations=ROUNDS if max_iterations is None else max_iterations,
                **{**how, 'budget': 60.0})


class Mission:
    """One mission: the true world, the allocator, and the oracle that judges both."""

    def __init__(self, seed: int, objective: str) -> None:
        self.rng, self.seed = random.Random(seed), seed
        angle, force = self.rng.uniform(0.0, math.tau), self.rng.uniform(0.0, SPEED / 3.0)
        self.wind = force * math.cos(angle), force * math.sin(angle)
        self.acceleration = self.rng.uniform(*ACCELERATION)
        self.now, self.judged = 1000.0, Judged()
        self.flown_until = self.now
        self.allocator = Allocator(AllocatorParams(
            objective=objective, route_end='hold', uav_timeout=3.0, settle=0.05, seed=seed % 2**31,
            default_cruise_speed=SPEED, background_period=4.0), self.now)
        self.allocator.set_kernels_ready()
        self.world = self.allocator.world
        self.crafts = {f'u{k}': Craft(self._spot(0.0)) for k in range(self.rng.randint(3, 5))}
        self.lost: set[str] = set()
        self.number = 0
        self.done: dict[str, float] = {}  # start of the service, by task
        self.flown: dict[str, UavList] = {}
        self.reached: dict[str, tuple[str, float]] = {}  # by UAV: task, and since when
        self.late_since: dict[str, float] = {}  # oracle: begin of the present stretch
        self.reported_since: dict[str, float] = {}
        self.predicted: dict[str, tuple[float, float]] = {}  # when, and the start expected then
        self.events = sorted(self._events())

    def _spot(self, height: float = HEIGHT) -> Point:
        return self.rng.uniform(0.0, SIDE), self.rng.uniform(0.0, SIDE), HEIGHT or height

    def _events(self) -> Iterator[tuple[float, str]]:
        yield 0.0, 'first'
        for _ in range(self.rng.randint(4, 12)):
            yield self.rng.uniform(10.0, LENGTH), 'task'
        for _ in range(self.rng.randint(0, 2)):
            yield self.rng.uniform(20.0, LENGTH), 'loss'
        for _ in range(self.rng.randint(0, 1)):
            yield self.rng.uniform(20.0, LENGTH), 'arrival'

    def task(self) -> Task:
        """A random task; two of three have a deadline, some a window."""
        self.number += 1
        kind, latest, earliest = self.rng.random(), math.inf, -math.inf
        if kind < 0.67:
            latest = self.now + self.rng.uniform(40.0, 300.0)
        if kind < 0.2:
            earliest = latest - self.rng.uniform(20.0, 60.0)
        return Task(f't{self.number}', self._spot(), float(self.rng.randint(1, 9)),
                    self.rng.choice((0.0, 3.0, 8.0)), earliest=earliest, latest=latest)

    def announce(self, count: int) -> None:
        """Announce random tasks."""
        verdicts = self.world.announce(AnnouncementAction.ADD,
                                       [self.task() for _ in range(count)], self.now, self.now)
        self.judged.refused += sum(not verdict.accepted for verdict in verdicts)

    def happen(self, kind: str) -> None:
        """Let an event of the mission happen."""
        alive = sorted(self.crafts.keys() - self.lost)
        if kind in ('first', 'task'):
            self.announce(self.rng.randint(8, 14) if kind == 'first' else 1)
        elif kind == 'loss' and len(alive) > 2:
            self.lost.add(self.rng.choice(alive))
        elif kind == 'arrival':
            self.crafts[f'u{len(self.crafts)}'] = Craft(self._spot())

    def run(self) -> Judged:
        """Fly the mission to its end; returns what it has shown."""
        began = self.now
        self.report()
        while self.now - began < LATEST:
            while self.events and self.now - began >= self.events[0][0]:
                self.happen(self.events.pop(0)[1])
            self.report()
            self.plan()
            self.fly()
            self.observe()
            if not self.events and not any(
                    record.state.name in ('PENDING', 'ASSIGNED', 'ACTIVE')
                    for record in self.world.tasks.open()):
                break
        self.judge()
        return self.judged

    def report(self) -> None:
        """All UAVs that are not lost report."""
        for name, craft in self.crafts.items():
            if name not in self.lost:
                self.reach(name, craft.place)
                self.world.update_uav(UavReport(
                    name, craft.place, cruise_speed=SPEED, active_task=craft.started,
                    velocity=craft.velocity), self.now, self.now)

    def reach(self, name: str, place: Point) -> None:
        """Note since when a UAV is at the first stop of its list, as its reports show it."""
        stops = self.world.list_of(name).stops
        if not stops or math.dist(place, stops[0].task.position) > 3.0:
            self.reached.pop(name, None)
        elif self.reached.get(name, ('', 0.0))[0] != stops[0].task.id:
            self.reached[name] = stops[0].task.id, self.now

    def plan(self) -> None:
        """Solve what is due; each change of lists is judged."""
        for wait in (0.0, 0.06, 0.0):
            self.now += wait
            before = dict(self.world.lists_in_force())
            self.allocator.tick(self.now, self.now)
            problem = self.allocator.due(self.now, self.now)
            if problem is not None:
                self.allocator.adopt(planning.solve_problem(
                    solve, problem, self.world.params, lambda: False), self.now, self.now)
            self.allocator.collect()
            self.compare(before, self.world.lists_in_force())

    def compare(self, before: Mapping[str, UavList], after: Mapping[str, UavList]) -> None:
        """A deadline that the lists before would truly keep, and those after do not, is broken."""
        if {u: each.task_ids for u, each in before.items()} == {
                u: each.task_ids for u, each in after.items()}:
            return
        old, new = self.true_starts(before), self.true_starts(after)
        known, then = self.oracle_starts(before), self.oracle_starts(after)
        for name, start in old.items():
            latest = self.world.task_records()[name].task.latest
            if start > latest - CLEAR or new.get(name, math.inf) <= latest:
                continue
            foreseen = known.get(name, math.inf) <= latest < then.get(name, math.inf)
            (self.judged.broken if foreseen else self.judged.unforeseen).append(
                f'mission {self.seed}: {name} at {self.now:.1f}: start {start:.1f} -> '
                f'{new.get(name, math.inf):.1f}, latest {latest:.1f}; by what was known '
                f'{known.get(name, math.inf):.1f} -> {then.get(name, math.inf):.1f}')

    def true_starts(self, lists: Mapping[str, UavList]) -> dict[str, float]:
        """When the services of lists will truly start, where their UAVs are not known as lost."""
        starts = {}
        for name, each in lists.items():
            record = self.world.uav_record(name)
            if record is None or record.silent or name in self.lost:
                continue
            craft, clock = self.crafts[name], self.now
            place, busy, velocity = craft.place, craft.busy, craft.velocity
            for stop in each.stops:
                task = stop.task
                if not self.world.tasks.is_open(task.id):
                    continue
                if task.id in self.done:  # it is being served
                    clock, busy = clock + busy, 0.0
                    continue
                clock += self.true_seconds(place, task.position, velocity)
                clock, velocity = max(clock, task.earliest), (0.0, 0.0, 0.0)
                starts[task.id], place = clock, task.position
                clock += task.service_time
        return starts

    def true_seconds(self, start: Point, end: Point, velocity: Point) -> float:
        """Time of a leg that ends at rest, in the true wind [s]."""
        dx, dy = end[0] - start[0], end[1] - start[1]
        return travel_seconds(math.hypot(dx, dy), over_ground(self.wind, dx, dy),
                              along(velocity, dx, dy), self.acceleration)

    def fly(self) -> None:
        """Let all UAVs fly their lists for one STEP, and for as long as was planned."""
        end = self.now + STEP
        for name in sorted(self.crafts.keys() - self.lost):
            self._fly(name, self.crafts[name], end)
        self.now = self.flown_until = end

    def _fly(self, name: str, craft: Craft, end: float) -> None:
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
                self.event(name, TaskEventKind.STARTED, task.id, clock)
            if task.id not in self.done:
                clock = self._towards(craft, task, clock, end)
                continue
            spent = min(craft.busy, end - clock)
            craft.busy, clock = craft.busy - spent, clock + spent
            if craft.busy <= 1e-9:
                craft.started = ''
                self.event(name, TaskEventKind.COMPLETED, task.id, clock)
                self.allocator.tick(max(clock, self.now), max(clock, self.now))

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

    def event(self, name: str, kind: TaskEventKind, task_id: str, clock: float) -> None:
        """Report progress of a task."""
        self.world.event(TaskEvent(task_id, name, self.world.list_of(name).revision, kind),
                         clock, clock)

    def observe(self) -> None:
        """Note which deadlines the oracle, and which the allocator, sees as missed now."""
        expected = self.oracle_starts(self.world.lists_in_force())
        for task_id, record in self.world.task_records().items():
            task = record.task
            if math.isinf(task.latest) or task_id in self.done or not record.open:
                continue
            late = expected.get(task_id, math.inf) > task.latest + EARLY
            reported = (task_id in self.world.deadlines.texts
                    or (record.state.name in ('UNASSIGNED', 'PENDING') and bool(record.reason)))
            for seen, since in ((late, self.late_since), (reported, self.reported_since)):
                if not seen:
                    since.pop(task_id, None)
                else:
                    since.setdefault(task_id, self.now)
        for task_id, start in self.world.deadlines.expected.items():
            if start - self.now <= 60.0 and task_id not in self.done:
                self.predicted.setdefault(task_id, (self.now, start))

    def oracle_starts(self, lists: Mapping[str, UavList]) -> dict[str, float]:
        """Starts of lists by what was reported and measured, timed apart."""
        starts = {}
        for name, each in lists.items():
            record = self.world.uav_record(name)
            if record is None or not self.world.usable(name):
                continue
            pace, place, clock = self.world.flights.pace(name), record.report.position, self.now
            for k, stop in enumerate(each.stops):
                task, reached = stop.task, self.reached.get(name)
                if k == 0 and reached is not None and reached[0] == task.id:
                    starts[task.id] = max(reached[1], task.earliest)
                    clock = max(clock - task.service_time, starts[task.id])
                else:
                    clock += leg_seconds(pace, place, task.position,
                                         record.report.velocity if k == 0 else None)
                    clock = starts[task.id] = max(clock, task.earliest)
                clock, place = clock + task.service_time, task.position
        return starts

    def judge(self) -> None:
        """Judge the ends of all tasks with a deadline."""
        for task_id, record in self.world.task_records().items():
            latest, start = record.task.latest, self.done.get(task_id, math.inf)
            if task_id in self.predicted and task_id in self.done:
                when, expected = self.predicted[task_id]
                if expected - when >= 50.0:
                    self.judged.errors.append(abs(expected - start))
            if math.isinf(latest):
                continue
            if start <= latest + EARLY:
                self.judged.kept += 1
                continue
            self.judged.late += 1
            known = self.late_since.get(task_id)
            reported = self.reported_since.get(task_id, math.inf)
            if known is not None and reported > known + EARLY + STEP:
                self.judged.reported_late.append(
                    f'mission {self.seed}: {task_id}: oracle {known:.1f}, '
                    f'reported {reported:.1f}, latest {latest:.1f}, start {start:.1f}')


def main() -> int:
    """Fly the missions; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n')[0])
    parser.add_argument('--missions', type=int, default=20)
    parser.add_argument('--seed', type=int, default=1, help='of the first mission')
    parser.add_argument('--objective', default=AllocatorParams.objective)
    args = parser.parse_args()
    found = []
    for seed in range(args.seed, args.seed + args.missions):
        found.append(Mission(seed, args.objective).run())
        for kind in ('broken', 'reported_late', 'unforeseen'):
            for line in getattr(found[-1], kind):
                print(f'{kind}: {line}', flush=True)
    errors = [error for each in found for error in each.errors]
    totals = {'missions': len(found), 'kept': sum(each.kept for each in found),
              'late': sum(each.late for each in found),
              'refused': sum(each.refused for each in found),
              'broken': sum(len(each.broken) for each in found),
              'unforeseen': sum(len(each.unforeseen) for each in found),
              'reported_late': sum(len(each.reported_late) for each in found),
              'error_60s_median': statistics.median(errors) if errors else None,
              'error_60s_p90': sorted(errors)[9 * len(errors) // 10] if errors else None}
    print(json.dumps(totals))
    return int(bool(totals['broken'] or totals['reported_late']))


if __name__ == '__main__':
    sys.exit(main())
