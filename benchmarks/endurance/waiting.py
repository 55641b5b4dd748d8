# SPDX-License-Identifier: Apache-2.0
"""Waiting places in the allocator against staying: paired runs over virtual time.

Run: `python benchmarks/endurance/waiting.py --runs 20 --json`. Allocator, solver, journal and
separation are the real ones, only their clock is virtual; a solve counts CPU time. The UAVs fly
straight from point to point, hold where the separation says so, use their battery in the air,
return at the last moment, and get another one at their base. Tasks arrive around three hot spots;
both runs of a pair have the same. With `--against changes` idle UAVs of the other run go
home for batteries, too, but wait where they are. The last line is one JSON object; the status is 1
where a task was lost.
"""
from __future__ import annotations

import argparse
import functools
import json
import math
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.persistence.persistence import Persistence
from uav_task_alloc.allocator.records import (
    AnnouncementAction,
    TaskEvent,
    TaskEventKind,
    UavReport,
)
from uav_task_alloc.allocator.replan_records import FleetOutlook
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.allocator.replanning.waiting_places import WaitingPlaces
from uav_task_alloc.model import Point, Task
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.separation.monitor import SeparationHold
from uav_task_alloc.solver import solve

SIDE, HEIGHT = 10_000.0, 60.0  # [m] of the area; of tasks
SPEED, CLIMB = 15.0, 3.0  # [m/s]
SPOTS, SPREAD, BACKGROUND = 3, 800.0, 0.1  # hot spots, [m], share of uniform tasks
SERVICE = 30.0, 90.0  # [s] shortest and longest
FULL, TURNAROUND = 40_000.0, 120.0  # [m] of a battery, hovering uses as much; [s] of a change
DRAIN, BUDGET = 1800.0, 0.02  # [s] after the last arrival; [s] of a solve
plan = functools.partial(solve.plan, clock=time.process_time)  # on a busy machine, too
FIRST_SEED = 9000  # of the runs that are reported; others were flown while this was written


class Flight:
    """One UAV: flies its list, holds, and changes its battery at its base."""

    def __init__(self, name: str, base: Point, step: float) -> None:
        self.name, self.base, self.place, self.step = name, base, base, step
        self.list, self.passed = UavList(name, 0), 0  # and points passed on the leg under way
        self.in_air, self.battery = False, FULL  # [m] left
        self.busy_until = self.ready_at = 0.0  # [s] end of the service, and of a battery change
        self.started, self.hold_until, self.served = '', 0.0, False
        self.waiting = self.flown = self.busy = 0.0  # [m] to waiting places, [m], [s]

    def assign(self, new: UavList) -> None:
        """Fly another list; the leg under way goes on where it is the same."""
        if self._line(self.list) != self._line(new):
            self.passed, self.served = 0, False
        self.list = new

    @staticmethod
    def _line(each: UavList) -> tuple[object, tuple[Point, ...]]:
        stop = each.stops[0] if each.stops else None
        return (stop.task.id, stop.line) if stop else ('', each.end_via)

    def report(self) -> UavReport:
        """What its bridge would publish."""
        flies = bool(self.list.stops or self.list.end_via)
        mode = ('STANDBY' if not self.in_air else 'RETURNING' if self.list.returns
                and not self.list.stops else 'ON_MISSION' if flies else 'HOLD')
        return UavReport(
            self.name, self.place, home=self.base, range=self.battery, full_range=FULL,
            cruise_speed=SPEED, climb_speed=CLIMB, battery=self.battery / FULL,
            available=self.in_air or self.ready_at == 0.0, turnaround=TURNAROUND,
            active_task=self.started, list_revision=self.list.revision, mode=mode,
            standby=not self.in_air, authority='HELD', takeoff_height=HEIGHT)

    def fly(self, now: float) -> list[TaskEvent]:
        """Fly for one step; returns the events of tasks."""
        if not self.in_air:
            if self.ready_at and now >= self.ready_at:
                self.battery, self.ready_at = FULL, 0.0
            if not self.list.stops or self.ready_at:
                return []
            self.in_air = True
        self.battery = max(0.0, self.battery - SPEED * self.step)
        stop = self.list.stops[0] if self.list.stops else None
        if stop is not None:
            self.busy += self.step
        if now < self.hold_until:
            return []
        if stop is None:
            self._fly_without_task(now)
            return []
        events = []
        if self.started != stop.task.id:
            self.started, self.served = stop.task.id, False
            events.append(TaskEvent(self.started, self.name, self.list.revision,
                                    TaskEventKind.STARTED))
        if not self.served and self._along(stop.line):
            self.served, self.busy_until = True, now + stop.task.service_time
        if self.served and now >= self.busy_until:
            events.append(TaskEvent(self.started, self.name, self.list.revision,
                                    TaskEventKind.COMPLETED))
            self.started = ''
        return events

    def _fly_without_task(self, now: float) -> None:
        """Fly home or to its waiting place, or stay."""
        self.started = ''
        if not self.list.returns:
            before = self.flown
            self._along(self.list.end_via)
            self.waiting += self.flown - before
        elif self._along((*self.list.end_via, self.base)):
            self.in_air, self.ready_at = False, now + TURNAROUND

    def _along(self, line: tuple[Point, ...]) -> bool:
        """Fly on along points; whether it is at their end."""
        left = SPEED * self.step
        while self.passed < len(line) and left > 0.0:
            goal = line[self.passed]
            far = math.dist(self.place, goal)
            share = min(1.0, left / far) if far else 1.0
            self.place = tuple(a + share * (b - a)  # type: ignore[assignment]
                               for a, b in zip(self.place, goal, strict=True))
            self.flown += share * far
            if share < 1.0:
                return False
            left -= far
            self.passed += 1
        return self.passed >= len(line)


class NoPlaces(WaitingPlaces):
    """Sends no UAV to a place, and no plan counts where the next tasks are expected."""

    def chosen(self, now: float, stamp: float) -> dict[str, UavList]:
        """No list."""
        return {}

    def outlook(self, stamp: float) -> FleetOutlook | None:
        """None."""


class Run:
    """A fleet, its allocator and the tasks of a seed; `figures` are the result."""

    def __init__(self, folder: str, args: argparse.Namespace, seed: int, anticipate: str) -> None:
        self.args, rng = args, np.random.default_rng(seed)
        self.params = AllocatorParams(
            route_end='hold', objective='response', locked_tasks=args.locked,
            anticipate='learnt' if anticipate == 'changes' else anticipate,
            anticipate_area=(0.0, 0.0, SIDE, SIDE), trips=1,
            separation__horizontal=args.separation, background_budget=0.0,
            solve_budget=BUDGET,
            default_climb_speed=CLIMB)
        self.persistence = Persistence(folder, print)
        self.core = Allocator(self.params, 0.0)
        if anticipate == 'changes':
            self.core.waiting = NoPlaces(self.core.world)
        self.core.set_kernels_ready()
        self.world = self.core.world
        self.fleet = {f'uav_{k}': Flight(f'uav_{k}', (
            SIDE / 2.0 + 60.0 * (k - args.uavs / 2.0), SIDE / 2.0, 0.0), args.step)
            for k in range(args.uavs)}
        count = int(rng.poisson(args.rate * 60.0 * args.minutes))
        self.announced = np.sort(rng.uniform(0.0, 60.0 * args.minutes, count))
        self.tasks = [Task(f't{k}', place, service_time=float(rng.uniform(*SERVICE)))
                      for k, place in enumerate(self._places(rng, count))]
        self.began: dict[str, float] = {}  # [s] start of the service
        self.nearest = math.inf  # [m] of two UAVs in the air that are not apart vertically
        self.emptied: set[str] = set()

    def _places(self, rng: np.random.Generator, count: int) -> list[Point]:
        """Places of the tasks [m]."""
        spots = rng.uniform(SPREAD, SIDE - SPREAD, (SPOTS, 2))
        xy = np.clip(rng.normal(spots[rng.integers(SPOTS, size=count)], SPREAD), 0.0, SIDE)
        uniform = (rng.random(count) < BACKGROUND) | (self.args.kind == 'uniform')
        xy[uniform] = rng.uniform(0.0, SIDE, (int(uniform.sum()), 2))
        return [(float(x), float(y), HEIGHT) for x, y in xy]

    def fly(self) -> dict[str, Any]:
        """Fly all of it; returns the figures."""
        end, k, now = 60.0 * self.args.minutes, 0, 0.0
        while now < end + DRAIN and (now < end or len(self.began) < len(self.tasks)):
            while k < len(self.tasks) and self.announced[k] <= now:
                self.world.announce(AnnouncementAction.ADD, [self.tasks[k]], now, now)
                k += 1
            for each in self.fleet.values():
                self._fly(each, now)
            self._watch()
            self._allocate(now)
            now += self.args.step
        self.persistence.close()
        response = [self.began[task.id] - at for task, at in zip(
            self.tasks, self.announced, strict=True) if task.id in self.began]
        able = len(self.fleet) * end * SPEED
        return {'response_s': float(np.mean(response)), 'tasks': len(self.tasks),
                'lost': len(self.tasks) - len(response), 'emptied': len(self.emptied),
                'waiting_percent': 100.0 * sum(
                    each.waiting for each in self.fleet.values()) / able,
                'flown_percent': 100.0 * sum(each.flown for each in self.fleet.values()) / able,
                'busy_percent': 100.0 * sum(each.busy for each in self.fleet.values()) / (
                    len(self.fleet) * now),
                'nearest_m': self.nearest}

    def _fly(self, each: Flight, now: float) -> None:
        was_served = each.served
        for event in each.fly(now):
            self.world.event(event, now, now)
        if each.served and not was_served and each.started:
            self.began.setdefault(each.started, now)
        if each.battery <= 0.0:
            self.emptied.add(each.name)
        self.world.update_uav(each.report(), now, now)

    def _watch(self) -> None:
        """Note how near two UAVs in the air come, away from their bases."""
        flying = [each.place for each in self.fleet.values() if each.in_air and (
            math.dist(each.place[:2], (SIDE / 2.0, SIDE / 2.0)) > 600.0)]
        for k, one in enumerate(flying):
            for other in flying[:k]:
                if abs(one[2] - other[2]) < self.params.separation__vertical:
                    self.nearest = min(self.nearest, math.dist(one[:2], other[:2]))

    def _allocate(self, now: float) -> None:
        """What the node does in some steps, with the solve at once."""
        self.core.tick(now, now)
        problem = self.core.due(now, now)
        if problem is not None:
            self.core.adopt(planning.solve_problem(
                plan, problem, self.params, lambda: False), now, now)
        for hold in self.core.separate(now, now).holds:
            self._hold(hold, now)
        self.persistence.save(self.core, now)
        for uav_id, each in self.core.collect().lists.items():
            self.fleet[uav_id].assign(each)

    def _hold(self, hold: SeparationHold, now: float) -> None:
        self.fleet[hold.uav].hold_until = hold.expires if hold.hold else now


def fly(args: argparse.Namespace, seed: int, anticipate: str) -> dict[str, Any]:
    """The figures of one run."""
    with tempfile.TemporaryDirectory() as folder:
        return Run(folder, args, seed, anticipate).fly()


def summary(pairs: list[tuple[dict[str, Any], dict[str, Any]]]) -> dict[str, Any]:
    """What waiting changes: means over all pairs, with a 95 % interval of the reduction."""
    def mean(side: int, name: str) -> float:
        return round(float(np.mean([pair[side][name] for pair in pairs])), 2)

    off = np.array([pair[0]['response_s'] for pair in pairs])
    saved = off - np.array([pair[1]['response_s'] for pair in pairs])
    half = 1.96 * float(saved.std(ddof=1)) / math.sqrt(len(pairs)) if len(pairs) > 1 else math.inf
    share = 100.0 / float(off.mean())
    return {'runs': len(pairs), 'response_off_s': mean(0, 'response_s'),
            'response_s': mean(1, 'response_s'),
            'reduction_percent': round(share * float(saved.mean()), 2),
            'ci95': [round(share * (float(saved.mean()) + k * half), 2) for k in (-1, 1)],
            'waiting_percent': mean(1, 'waiting_percent'),
            'flight_added_percent': round(mean(1, 'flown_percent') - mean(0, 'flown_percent'), 2),
            'busy_off_percent': mean(0, 'busy_percent'),
            'lost': sum(each['lost'] for pair in pairs for each in pair),
            'emptied': sum(each['emptied'] for pair in pairs for each in pair),
            'nearest_off_m': round(min(pair[0]['nearest_m'] for pair in pairs), 1),
            'nearest_m': round(min(pair[1]['nearest_m'] for pair in pairs), 1)}


def main(log: Callable[[str], object] = print) -> int:
    """Fly, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=20)
    parser.add_argument('--seed', type=int, default=FIRST_SEED)
    parser.add_argument('--uavs', type=int, default=8)
    parser.add_argument('--minutes', type=float, default=120.0, help='of arrivals')
    parser.add_argument('--rate', type=float, default=0.022, help='tasks a second')
    parser.add_argument('--kind', choices=('hot', 'uniform'), default='hot')
    parser.add_argument('--locked', type=int, default=0, help='parameter locked_tasks')
    parser.add_argument('--separation', type=float, default=30.0, help='[m]; 0: off')
    parser.add_argument('--step', type=float, default=1.0, help='[s] of the simulation')
    parser.add_argument('--anticipate', choices=('even', 'learnt'), default='learnt')
    parser.add_argument('--against', choices=('off', 'changes'), default='off')
    parser.add_argument('--json', action='store_true', help='the last line alone')
    args = parser.parse_args()
    began, pairs = time.process_time(), []
    for k in range(args.runs):
        pairs.append((fly(args, args.seed + k, args.against),
                      fly(args, args.seed + k, args.anticipate)))
        if not args.json:
            log(f'seed {args.seed + k}: {json.dumps(pairs[-1])}')
    figures = {**summary(pairs), 'cpu_s': round(time.process_time() - began, 1)}
    log(json.dumps(figures))
    return int(figures['lost'] > 0 or figures['emptied'] > 0)


if __name__ == '__main__':
    sys.exit(main())
