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

from deadline_fleet import STEP, TrueFleet
from deadline_motion import SPEED, leg_seconds

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import AnnouncementAction, UavReport
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.model import Plan, Point, Task
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.solver.solve import plan

LENGTH, LATEST = 240.0, 600.0  # [s] of arrivals, and of a mission
ROUNDS = 150  # of bees in one solve
CLEAR = 2.0  # [s] by which the old lists must keep a deadline that counts as keepable
EARLY = 1.0  # [s] by which the oracle may be later than the allocator: one period


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
        self.now, self.judged = 1000.0, Judged()
        self.allocator = Allocator(AllocatorParams(
            objective=objective, route_end='hold', uav_timeout=3.0, settle=0.05, seed=seed % 2**31,
            default_cruise_speed=SPEED, background_period=4.0), self.now)
        self.allocator.set_kernels_ready()
        self.world = self.allocator.world
        self.fleet = TrueFleet(self.rng, self.allocator, self.now)
        self.number = 0
        self.reached: dict[str, tuple[str, float]] = {}  # by UAV: task, and since when
        self.late_since: dict[str, float] = {}  # oracle: begin of the present stretch
        self.reported_since: dict[str, float] = {}
        self.predicted: dict[str, tuple[float, float]] = {}  # when, and the start expected then
        self.events = sorted(self._events())

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
        return Task(f't{self.number}', self.fleet.spot(), float(self.rng.randint(1, 9)),
                    self.rng.choice((0.0, 3.0, 8.0)), earliest=earliest, latest=latest)

    def announce(self, count: int) -> None:
        """Announce random tasks."""
        verdicts = self.world.announce(AnnouncementAction.ADD,
                                       [self.task() for _ in range(count)], self.now, self.now)
        self.judged.refused += sum(not verdict.accepted for verdict in verdicts)

    def happen(self, kind: str) -> None:
        """Let an event of the mission happen."""
        alive = self.fleet.flying()
        if kind in ('first', 'task'):
            self.announce(self.rng.randint(8, 14) if kind == 'first' else 1)
        elif kind == 'loss' and len(alive) > 2:
            self.fleet.lost.add(self.rng.choice(alive))
        elif kind == 'arrival':
            self.fleet.join()

    def run(self) -> Judged:
        """Fly the mission to its end; returns what it has shown."""
        began = self.now
        self.report()
        while self.now - began < LATEST:
            while self.events and self.now - began >= self.events[0][0]:
                self.happen(self.events.pop(0)[1])
            self.report()
            self.plan()
            self.now = self.fleet.fly(self.now)
            self.observe()
            if not self.events and not any(
                    record.state.name in ('PENDING', 'ASSIGNED', 'ACTIVE')
                    for record in self.world.tasks.open()):
                break
        self.judge()
        return self.judged

    def report(self) -> None:
        """All UAVs that are not lost report."""
        for name, craft in self.fleet.crafts.items():
            if name not in self.fleet.lost:
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
        old, new = self.fleet.starts(before, self.now), self.fleet.starts(after, self.now)
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

    def observe(self) -> None:
        """Note which deadlines the oracle, and which the allocator, sees as missed now."""
        expected = self.oracle_starts(self.world.lists_in_force())
        for task_id, record in self.world.task_records().items():
            task = record.task
            if math.isinf(task.latest) or task_id in self.fleet.done or not record.open:
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
            if start - self.now <= 60.0 and task_id not in self.fleet.done:
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
            latest, start = record.task.latest, self.fleet.done.get(task_id, math.inf)
            if task_id in self.predicted and task_id in self.fleet.done:
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
