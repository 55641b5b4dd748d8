# SPDX-License-Identifier: Apache-2.0
"""Random scenes in which UAVs would collide, flown with and without separation, in virtual time.

Run: `python benchmarks/endurance/separation.py --scenes 100 --seed 1 --json`. Allocator, solver
and monitor are the real ones; up to 20 UAVs of one base or several fly their lists with speeds
that are up to 20 % off, in a wind that nobody is given; tasks arrive, and one UAV is lost. Each
scene is flown with 10 m / 5 m, with 30 m / 10 m, and without separation. Losses are judged by true
positions at 10 Hz, by code that shares nothing with the allocator. With `--hold` UAVs stay in the
air after their last tasks, and half of the tasks are for certain UAVs only. The extra flight time
is that against the same lists flown without heights, waits and holds; against the flight without
separation, whose plans soon are others, it is `extra_percent_other_plans`. The last line is JSON;
the status is 1 where separation was lost.
"""
from __future__ import annotations

import argparse
import json
import math
import random
import statistics
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from separation_flight import SPEED, Craft, SamePlan, SentList

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.records import AnnouncementAction, TaskEvent
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.model import Plan, Point, Task
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.solver.solve import plan

RULES = ((10.0, 5.0), (30.0, 10.0))  # [m] horizontally, vertically
DT, PERIOD, LATEST, ROUNDS = 0.1, 0.5, 900.0, 40  # [s], [s], [s], rounds of bees in one solve
ARRIVALS = 120.0  # [s] in which tasks arrive


def solve(*world: object, max_iterations: int | None, **how: object) -> Plan:
    """Solve for a number of iterations, not until a time."""
    return plan(*world, max_iterations=ROUNDS if max_iterations is None else max_iterations,  # type: ignore[arg-type]
                **{**how, 'budget': 60.0})  # type: ignore[arg-type]


@dataclass(slots=True)
class Scene:
    """What happens in a scene, whoever flies it."""

    homes: dict[str, Point] = field(default_factory=dict)
    speeds: dict[str, float] = field(default_factory=dict)  # [m/s] true
    wind: tuple[float, float] = (0.0, 0.0)
    tasks: list[tuple[float, Task]] = field(default_factory=list)  # with the time of arrival
    lost: tuple[float, str] = (math.inf, '')


def draw(seed: int, hold: bool = False) -> Scene:
    """Draw a scene; half of its tasks are for a third of the UAVs only where these `hold`."""
    rng = random.Random(seed)
    scene, count = Scene(), rng.randint(3, 20)
    side, bases = rng.uniform(400.0, 1500.0), rng.choice((1, 1, 2, 4))
    places = [(rng.uniform(0.0, side), rng.uniform(0.0, side)) for _ in range(bases)]
    gap = rng.uniform(6.0, 40.0)  # [m] between pads
    for k in range(count):
        x, y = places[k % bases]
        row, column = divmod(k // bases, 5)
        name = f'u{k:02}'
        scene.homes[name] = (x + gap * column, y + gap * row, 0.0)
        scene.speeds[name] = SPEED * rng.uniform(0.8, 1.2)
    force, angle = rng.uniform(0.0, 5.0), rng.uniform(0.0, math.tau)
    scene.wind = force * math.cos(angle), force * math.sin(angle)
    total = round(count * rng.uniform(2.0, 4.0))
    for k in range(total):
        at = 0.0 if rng.random() < 0.7 else rng.uniform(5.0, ARRIVALS)
        scene.tasks.append((at, Task(
            f't{k:03}', (rng.uniform(0.0, side), rng.uniform(0.0, side), rng.uniform(30.0, 60.0)),
            service_time=rng.choice((0.0, 3.0, 8.0)))))
    scene.tasks.sort(key=lambda row: row[0])
    scene.lost = rng.uniform(20.0, 90.0), rng.choice(sorted(scene.homes))
    if hold:
        names, few = sorted(scene.homes), (count + 2) // 3
        scene.tasks = [(at, replace(task, allowed_uavs=frozenset(rng.sample(names, few))))
                       if rng.random() < 0.5 else (at, task) for at, task in scene.tasks]
    return scene


class Judge:
    """Least distances and losses, by the true positions."""

    def __init__(self, horizontal: float, vertical: float) -> None:
        self.horizontal, self.vertical = horizontal, vertical
        self.least, self.losses, self.now_lost = math.inf, 0, set[tuple[str, str]]()
        self.texts: list[str] = []

    def look(self, now: float, crafts: Mapping[str, Craft]) -> None:
        """Judge the positions of one moment."""
        flying = sorted((c.name, c.place, c.home) for c in crafts.values()
                        if not c.landed and not c.dead)
        lost = set()
        for i, (one, a, pad_a) in enumerate(flying):
            for other, b, pad_b in flying[i + 1:]:
                dx, dy, dz = abs(a[0] - b[0]), abs(a[1] - b[1]), abs(a[2] - b[2])
                if dx > 100.0 or dy > 100.0:
                    continue
                if self.on_pad(a, pad_a) and self.on_pad(b, pad_b):
                    continue
                apart = math.hypot(dx, dy)
                self.least = min(self.least, math.hypot(apart, dz))
                if apart < self.horizontal and dz < self.vertical:
                    lost.add((one, other))
                    if (one, other) not in self.now_lost:
                        self.texts.append(f'{one} and {other} at {now:.1f} s: {apart:.1f} m, '
                                          f'{dz:.1f} m at {a} {b}')
        self.losses += len(lost - self.now_lost)
        self.now_lost = lost

    def on_pad(self, place: Point, pad: Point) -> bool:
        """Whether a UAV is low over its own pad: pads may be nearer than the rule."""
        return (math.dist(place[:2], pad[:2]) < 0.5 * self.horizontal
                and place[2] - pad[2] < self.vertical)


def crafts_of(scene: Scene) -> dict[str, Craft]:
    """The UAVs of a scene on their pads, by name."""
    return {name: Craft(name, home, scene.speeds[name], scene.wind, home)
            for name, home in scene.homes.items()}


def same_plan_seconds(scene: Scene, flight: Flight) -> float:
    """Flight time of all UAVs [s] where they fly the lists of a flight without separation."""
    again = SamePlan(crafts_of(scene), list(flight.sent))
    lost_at, lost = scene.lost
    for k in range(round(LATEST / DT)):
        again.crafts[lost].dead = k * DT >= lost_at
        again.fly(k * DT, DT)
        if again.over:
            break
    return sum(craft.airborne_for for craft in again.crafts.values())


class Flight:
    """One flight of a scene."""

    def __init__(self, scene: Scene, seed: int, rule: tuple[float, float] | None,
                 hold: bool = False) -> None:
        self.scene, self.now, self.hold = scene, 0.0, hold
        self.crafts, self.sent = crafts_of(scene), list[SentList]()
        horizontal, vertical = rule or (0.0, 5.0)
        self.core = Allocator(AllocatorParams(
            route_end='hold' if hold else 'home', seed=seed % 2**31, background_period=5.0,
            uav_timeout=3.0, default_cruise_speed=SPEED,
            separation__horizontal=horizontal, separation__vertical=vertical), self.stamp)
        self.core.set_kernels_ready()
        self.judges = [Judge(*each) for each in ((rule,) if rule else RULES)]
        self.left = list(scene.tasks)
        self.holds = self.unresolved = 0

    @property
    def stamp(self) -> float:
        """The published and the steady clock [s]."""
        return 1000.0 + self.now

    def run(self) -> Flight:
        """Fly until all have landed."""
        steps = round(LATEST / DT)
        for k in range(steps):
            self.now = k * DT
            if k % round(PERIOD / DT) == 0:
                self.allocate()
            for craft in self.crafts.values():
                if craft.dead:
                    continue
                for kind, task_id in craft.fly(self.now, DT):
                    self.core.world.event(TaskEvent(task_id, craft.name, craft.revision, kind),
                                          self.stamp, self.stamp)
            for judge in self.judges:
                judge.look(self.now, self.crafts)
            if not self.left and k % 100 == 99 and self.over():
                break
        return self

    def over(self) -> bool:
        """Whether all are on the ground, or stay, and no task is being flown."""
        return all(craft.landed or craft.dead or self.hold for craft in self.crafts.values()
                   ) and not any(record.uav for record in self.core.world.tasks.open())

    def allocate(self) -> None:
        """What the allocator does in a tick, with the solve at once."""
        world, lost_at, lost = self.core.world, *self.scene.lost
        if self.now >= lost_at:
            self.crafts[lost].dead = True
        while self.left and self.left[0][0] <= self.now:
            world.announce(AnnouncementAction.ADD, [self.left.pop(0)[1]], self.stamp, self.stamp)
        for craft in self.crafts.values():
            if not craft.dead:
                world.update_uav(craft.report(), self.stamp, self.stamp)
        self.core.tick(self.stamp, self.stamp)
        problem = self.core.due(self.stamp, self.stamp)
        if problem is not None:
            self.core.adopt(planning.solve_problem(solve, problem, world.params, lambda: False),
                            self.stamp, self.stamp)
        step = self.core.separate(self.stamp, self.stamp)
        for hold in step.holds:
            self.crafts[hold.uav].receive(hold.hold, self.now)
        self.holds += sum(hold.hold for hold in step.holds)
        self.unresolved += len(step.unresolved)
        for each in self.core.collect().lists.values():
            craft = self.crafts[each.uav]
            craft.receive(each, self.now)
            self.sent.append(SentList(self.now, each, frozenset(craft.done)))

    @property
    def seconds(self) -> float:
        """Flight time of all UAVs [s]."""
        return sum(craft.airborne_for for craft in self.crafts.values())

    @property
    def done(self) -> int:
        """Number of completed tasks."""
        return len(set().union(*(craft.done for craft in self.crafts.values())))


def fly(seed: int, verbose: bool, hold: bool) -> dict[str, object]:
    """Fly a scene three times; its figures."""
    scene = draw(seed, hold)
    without = Flight(scene, seed, None, hold).run()
    found = {'seed': seed, 'uavs': len(scene.homes), 'tasks': len(scene.tasks),
             'losses_without': sum(judge.losses for judge in without.judges),
             'losses': 0, 'least': [], 'extra': [], 'extra_other': [],
             'holds': 0, 'undone': 0, 'unresolved': 0,
             'late': int(not without.over())}
    for rule in RULES:
        flight = Flight(scene, seed, rule, hold).run()
        judge = flight.judges[0]
        found['losses'] += judge.losses
        found['least'].append(round(judge.least, 2))
        for key, seconds in () if hold else (('extra', same_plan_seconds(scene, flight)),
                                             ('extra_other', without.seconds)):
            found[key].append(round(100.0 * (flight.seconds / seconds - 1.0), 2))
        found['holds'] += flight.holds
        found['unresolved'] += flight.unresolved
        found['undone'] += without.done - flight.done
        found['late'] += int(not flight.over())
        for text in judge.texts if verbose else ():
            print(f'seed {seed}, {rule}: {text}', file=sys.stderr)
    return found


def main() -> int:
    """Fly the scenes; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n')[0])
    parser.add_argument('--scenes', type=int, default=20)
    parser.add_argument('--seed', type=int, default=1, help='of the first scene')
    parser.add_argument('--hold', action='store_true', help='UAVs stay after their last tasks')
    parser.add_argument('--json', action='store_true', help='only the last line')
    args = parser.parse_args()
    rows = []
    for seed in range(args.seed, args.seed + args.scenes):
        rows.append(fly(seed, not args.json, args.hold))
        if not args.json:
            print(json.dumps(rows[-1]), flush=True)
    extra, other = ([share for row in rows for share in row[key]] or [math.nan]
                    for key in ('extra', 'extra_other'))
    totals = {'scenes': len(rows), 'losses': sum(row['losses'] for row in rows),
              'losses_without': sum(row['losses_without'] for row in rows),
              'separation_min_m': min((least for row in rows for least in row['least']
                                       if least < math.inf), default=math.nan),
              'extra_percent_median': round(statistics.median(extra), 2),
              'extra_percent_max': max(extra),
              'extra_percent_other_plans_median': round(statistics.median(other), 2),
              'extra_percent_other_plans_max': max(other),
              'holds': sum(row['holds'] for row in rows),
              'unresolved': sum(row['unresolved'] for row in rows),
              'tasks_less': sum(row['undone'] for row in rows),
              'not_over': sum(row['late'] for row in rows)}
    # in the air to the end of the flight, UAVs that hold have no flight time to compare
    print(json.dumps({key: value for key, value in totals.items() if value == value}))
    return int(bool(totals['losses']))


if __name__ == '__main__':
    sys.exit(main())
