# SPDX-License-Identifier: Apache-2.0
"""Hours of service over virtual time: tasks arrive, UAVs are lost and return, zones come and go.

Run: `python benchmarks/endurance/soak.py --hours 8`. The allocator is the real one with solver and
journal, only its clock is virtual; the UAVs fly straight and without faults. The last line is
JSON; the status is 1 where memory grew by more than 5 % (second half against first, after the
warm-up), a task has neither end nor reason, or a list changed back within 10 s without an event.
"""
from __future__ import annotations

import argparse
import gc
import json
import math
import random
import sys
import tempfile
import time
from pathlib import Path

import psutil

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
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.model import Plan, Task, ThreatZone
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.solver.solve import plan

UAVS, SIDE, SPEED, STEP = 6, 4000.0, 15.0, 0.5  # [m], [m/s], [s]
ARRIVAL, LOSS, SILENCE, ZONE = 12.0, 600.0, 120.0, 300.0  # [s] between two, on average
MOST_ZONES, KEEP, ROUNDS = 5, 300, 200  # ended tasks kept, rounds of bees in one solve
FLAP = 10.0  # [s]
DRAIN = 3600.0  # [s] without new tasks at the end


def solve(*world, max_iterations: int | None, **how) -> Plan:
    """Solve for a number of iterations, not until a time."""
    return plan(*world, max_iterations=ROUNDS if max_iterations is None else max_iterations,
                **{**how, 'budget': 60.0})


class Flight:
    """One UAV: flies its last list, straight from point to point, and publishes events."""

    def __init__(self, name: str, place: tuple[float, float, float]) -> None:
        self.name, self.place, self.home = name, place, place
        self.list = UavList(name, 0)
        self.silent_until, self.busy_until = 0.0, 0.0  # [s]
        self.via = 0  # detour points passed on the first leg
        self.started = ''

    def assign(self, new: UavList) -> None:
        """Take a new list; the first leg continues where its path is the same."""
        old, self.list = self.list, new
        if [s.leg.via for s in old.stops[:1]] != [s.leg.via for s in new.stops[:1]]:
            self.via = 0

    def fly(self, now: float) -> list[TaskEvent]:
        """Fly for one STEP; returns the events of tasks."""
        if not self.list.stops:
            self._towards(self.home)
            return []
        stop, events = self.list.stops[0], []
        if self.started != stop.task.id:
            self.started, self.busy_until = stop.task.id, 0.0
            events.append(self._event(TaskEventKind.STARTED, stop.task.id))
        points = (*stop.leg.via, stop.task.position)
        if self._towards(points[min(self.via, len(points) - 1)]):
            if self.via < len(stop.leg.via):
                self.via += 1
            elif not self.busy_until:
                self.busy_until = now + stop.task.service_time
            elif now >= self.busy_until:
                self.via = 0
                events.append(self._event(TaskEventKind.COMPLETED, stop.task.id))
        return events

    def _event(self, kind: TaskEventKind, task_id: str) -> TaskEvent:
        return TaskEvent(task_id, self.name, self.list.revision, kind)

    def _towards(self, goal: tuple[float, float, float]) -> bool:
        left, step = math.dist(self.place, goal), SPEED * STEP
        if left <= step:
            self.place = goal
            return True
        x, y, z = (p + (g - p) * step / left for p, g in zip(self.place, goal, strict=True))
        self.place = (x, y, z)
        return False


class Soak:
    """The world around an allocator, and its figures."""

    def __init__(self, folder: str, seed: int) -> None:
        self.rng = random.Random(seed)
        self.params = AllocatorParams(route_end='home', keep_ended=KEEP, background_period=60.0)
        self.persistence = Persistence(folder, print)
        self.core = Allocator(self.params, 0.0)
        self.core.set_kernels_ready()
        self.world = self.core.world
        self.fleet = [Flight(f'uav_{k}', (SIDE * k / UAVS, 0.0, 50.0)) for k in range(UAVS)]
        self.open: set[str] = set()  # accepted, and not ended yet
        self.events = 0.0  # [s] of the last event that may change lists
        self.before: dict[str, list[tuple[tuple[str, ...], float]]] = {}
        self.memory: list[tuple[float, int]] = []  # [s], bytes
        self.figures = dict.fromkeys(('tasks', 'completed', 'losses', 'zones', 'lists', 'solves',
                                      'flaps'), 0)

    def happens(self, mean: float) -> bool:
        """Whether an event with a mean interval of `mean` [s] happens in this step."""
        return self.rng.random() < STEP / mean

    def place(self) -> tuple[float, float, float]:
        return self.rng.uniform(0.0, SIDE), self.rng.uniform(0.0, SIDE), 50.0

    def step(self, now: float, arrivals: bool) -> None:
        """Step the world by STEP."""
        if arrivals and self.happens(ARRIVAL):
            self.figures['tasks'] += 1
            task = Task(f't{self.figures["tasks"]}', self.place(), service_time=2.0)
            verdict, = self.world.announce(AnnouncementAction.ADD, [task], now, now)
            assert verdict.accepted, verdict
            self.open.add(task.id)
            self.events = now
        if self.happens(ZONE):
            self.change_zones(now)
        if self.happens(LOSS):
            self.rng.choice(self.fleet).silent_until = now + self.rng.expovariate(1.0 / SILENCE)
            self.figures['losses'] += 1
        for uav in self.fleet:
            if now >= uav.silent_until:
                self.fly(uav, now)
        self.allocate(now)

    def change_zones(self, now: float) -> None:
        """Add or remove one zone."""
        zones = list(self.world.airspace.zones.values())
        self.figures['zones'] += 1
        if len(zones) >= MOST_ZONES or (zones and self.rng.random() < 0.5):
            zones.pop(self.rng.randrange(len(zones)))
        else:
            zones.append(ThreatZone.hemisphere(f'z{self.figures["zones"]}', self.place()[:2] + (
                0.0,), self.rng.uniform(80.0, 300.0)))
        self.world.set_zones(zones, (), now)
        self.events = now

    def fly(self, uav: Flight, now: float) -> None:
        """Let one UAV fly, and report its events and its state."""
        known = self.world.fleet.records.get(uav.name)
        if known is None or known.silent:
            self.events = now
        for event in uav.fly(now):
            refused = self.world.event(event, now, now)
            self.events = now
            if event.kind is TaskEventKind.COMPLETED and not refused:
                self.figures['completed'] += 1
                self.open.discard(event.task_id)
        self.world.update_uav(UavReport(uav.name, uav.place, home=uav.home, cruise_speed=SPEED,
                                  active_task=uav.started if uav.list.stops else '',
                                  list_revision=uav.list.revision), now, now)

    def allocate(self, now: float) -> None:
        """What the node does in a tick, with the solve at once."""
        silent = [record.silent for record in self.world.fleet.records.values()]
        self.core.tick(now, now)
        if silent != [record.silent for record in self.world.fleet.records.values()]:
            self.events = now
        problem = self.core.due(now, now)
        if problem is not None:
            self.figures['solves'] += 1
            self.core.adopt(
                planning.solve_problem(solve, problem, self.params, lambda: False), now, now
            )
        self.persistence.save(self.core, now)
        for uav_list in self.core.collect().lists.values():
            self.publish(uav_list, now)

    def publish(self, uav_list: UavList, now: float) -> None:
        """Deliver a list; it flaps where it returns to a recent one without an event."""
        self.figures['lists'] += 1
        past = self.before.setdefault(uav_list.uav, [])
        ids = uav_list.task_ids
        self.figures['flaps'] += (len(past) == 2 and past[0][0] == ids != past[1][0]
                                  and self.events < past[0][1] and now - past[0][1] < FLAP)
        self.before[uav_list.uav] = [*past, (ids, now)][-2:]
        for uav in self.fleet:
            if uav.name == uav_list.uav:
                uav.assign(uav_list)

    def without_end_or_reason(self) -> list[str]:
        """Tasks without an end, a UAV or a reason."""
        records = self.world.tasks.records
        return [task_id for task_id in sorted(self.open)
                if task_id not in records or not (records[task_id].uav or records[task_id].reason)]


def main() -> int:
    """Soak, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--hours', type=float, default=8.0)
    parser.add_argument('--seed', type=int, default=1)
    args = parser.parse_args()
    end, warm = 3600.0 * args.hours, 0.25 * 3600.0 * args.hours
    began, process = time.process_time(), psutil.Process()
    with tempfile.TemporaryDirectory() as folder:
        soak = Soak(folder, args.seed)
        for k in range(int((end + DRAIN) / STEP)):
            soak.step(k * STEP, arrivals=k * STEP < end)
            if k * STEP % 60.0 == 0.0 and warm <= k * STEP < end:
                gc.collect()
                soak.memory.append((k * STEP, process.memory_info().rss))
        soak.persistence.close()
    middle = len(soak.memory) // 2
    first, second = (sum(rss for _, rss in part) / len(part) / 2**20
                     for part in (soak.memory[:middle], soak.memory[middle:]))
    lost = soak.without_end_or_reason()
    figures = {'hours': args.hours, 'seed': args.seed, **soak.figures,
               'still_open': len(soak.open),
               'without_end_or_reason': len(lost), 'memory_mb_first_half': round(first, 1),
               'memory_mb_second_half': round(second, 1),
               'memory_growth_percent': round(100.0 * (second / first - 1.0), 2),
               'cpu_s': round(time.process_time() - began, 1)}
    print(json.dumps(figures))
    return int(figures['memory_growth_percent'] > 5.0 or bool(lost) or soak.figures['flaps'] > 0)


if __name__ == '__main__':
    sys.exit(main())
