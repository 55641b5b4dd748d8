# SPDX-License-Identifier: Apache-2.0
"""Flies a scenario in virtual time with processes that stall at random, as on a loaded machine.

Run: `python benchmarks/endurance/scenario_flights.py --flights 20 --seed 1 --json`, where ROS is
sourced. Allocator, solver, ground station, simulated vehicles and messages are the real ones; only
their clocks and their transport are virtual. Allocator, bridge and simulator each stall, every
0.6 s of wall time on average, for `--load` times 0.12 s on average, and the messages to them wait.
The judge is that of `report`, by the simulator's log. The last line is JSON; the status is 1 where
a task was lost, one was flown twice, a zone was entered, separation was lost, or a flight did not
end.
"""
from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import random
import sys
import time
from collections import Counter, deque
from dataclasses import asdict, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from scenario_processes import EPOCH, AllocatorProcess, Bridge, Fleet, Process
from uav_task_alloc_msgs import msg as m

from uav_task_alloc import scenario
from uav_task_alloc.cli.report import run_summary
from uav_task_alloc.nodes.conversions import messages
from uav_task_alloc.params import AllocatorParams, BridgeParams, LiveViewParams
from uav_task_alloc.record import message_records
from uav_task_alloc.record.progress import run_is_over
from uav_task_alloc.record.run_state import RunState
from uav_task_alloc.sim.separation_judge import Loss

SCENARIO = Path(__file__).resolve().parents[2] / 'config/scenarios/survey.yaml'
TICK, STEP, INSTANT = 0.02, 0.025, 0.005  # [s] of simulator and links, of the allocator, of all
LIMIT = 1500.0  # [s] of the scenario
FAULTS = ('tasks_lost', 'tasks_flown_twice', 'zone_violations', 'separation_losses', 'not_over')


class Run:
    """One flight of a scenario; `fly` returns its summary."""

    def __init__(self, played: scenario.Scenario, seed: int, load: float) -> None:
        self.played, self.load, self.rng = played, load, random.Random(seed)
        self.wall = self.vehicle_time = 0.0
        self.started_at: float | None = None  # [s] of vehicle time
        self.moments = deque(scenario.timeline(played))
        self.parts = {name: Process(random.Random(self.rng.random()), load)
                      for name in ('fleet', 'bridge', 'allocator')}
        given = scenario.simulation_parameters(played, SCENARIO, 14550)
        self.fleet = Fleet(self)
        self.bridge = Bridge(self, params_of(BridgeParams, given['mavlink_bridge']))
        self.allocator = AllocatorProcess(self, params_of(AllocatorParams, {
            **given['allocator'], 'seed': seed}))
        self.state = RunState()
        self.record({'kind': 'run', 'speedup': played.speedup, 'simulated': True})
        self.record({'kind': 'origin', **asdict(played.origin)})

    @property
    def stamp(self) -> float:
        """The published clock [s]."""
        return EPOCH + self.vehicle_time

    def record(self, body: dict[str, Any]) -> None:
        self.state.apply({'wall': self.stamp, **body})

    # links and topics

    def to_bridge(self, n: int, frame: bytes) -> None:
        self.parts['bridge'].post(self.wall, partial(self.bridge.receive, n, frame))

    def to_vehicle(self, n: int, frame: bytes) -> None:
        self.parts['fleet'].post(self.wall, partial(self.fleet.receive, n, frame))

    def on_event(self, msg: m.TaskEvent) -> None:
        self.parts['allocator'].post(self.wall, partial(self.allocator.on_event, msg))

    def on_state(self, msg: m.UavState) -> None:
        self.parts['allocator'].post(self.wall, partial(self.allocator.on_state, msg))
        self.record(message_records.state_record(msg))

    def on_list(self, msg: m.TaskList) -> None:
        self.parts['bridge'].post(self.wall, partial(self.bridge.on_list, msg))
        self.record(message_records.task_list_record(msg))

    def on_hold(self, msg: m.UavHold) -> None:
        self.parts['bridge'].post(self.wall, partial(self.bridge.on_hold, msg))

    # the scenario

    def play(self) -> None:
        """Announce what is due; the scenario begins once all vehicles are there."""
        if self.started_at is None:
            if len(self.allocator.world.fleet.records) < len(self.played.uavs):
                return
            self.started_at = self.vehicle_time
        while self.moments and self.moments[0].at <= self.vehicle_time - self.started_at:
            moment = self.moments.popleft()
            if moment.zones is not None:
                zones = messages.from_zones(moment.zones, self.stamp)
                for name, part in (('bridge', self.bridge), ('allocator', self.allocator)):
                    self.parts[name].post(self.wall, partial(part.on_zones, zones))
                self.record(message_records.zones_record(zones))
            if moment.works:
                works = [replace(work, task=scenario.from_zero(
                    work.task, EPOCH + self.started_at)) for work in moment.works]
                msg = messages.announcement(m.TaskAnnouncement.ADD, works, self.stamp)
                self.parts['allocator'].post(self.wall, partial(self.allocator.on_tasks, msg))
                self.record(message_records.announcement_record(msg, self.played.origin))
            for uav in moment.deaths:
                self.fleet.kill(uav)

    def fly(self) -> dict[str, Any]:
        """Fly until the scenario is over; its figures and faults."""
        over_since = math.inf
        due = dict.fromkeys(self.parts, 0.0)
        steps = {'fleet': (self.fleet.step, TICK), 'bridge': (self.bridge.step, TICK),
                 'allocator': (self.allocator.step, STEP)}
        for k in count():
            self.wall = k * INSTANT
            if self.parts['fleet'].runs(self.wall):
                self.vehicle_time = self.wall * self.played.speedup
            for name, (step, period) in steps.items():
                if self.parts[name].runs(self.wall):
                    if self.wall >= due[name]:
                        due[name] = self.wall + period
                        step()
                    self.parts[name].take(self.wall)
            self.play()
            now = self.vehicle_time - (self.started_at or 0.0)
            if k % 20 == 0:
                over = not self.moments and run_is_over(self.state, self.played, now)
                over_since = min(over_since, now) if over else math.inf
            if now >= min(over_since + LiveViewParams.settle, LIMIT):
                break
        self.fleet.log_losses('least_distance', [
            Loss(pair, nearest, nearest.t) for pair, nearest in self.fleet.judge.least.items()])
        return {**run_summary(self.state, self.fleet.truth), 'not_over': int(now >= LIMIT)}


def params_of(kind: type[Any], given: dict[str, Any]) -> Any:
    """The parameters of a node from those by ROS name."""
    rows = {key.replace('.', '__'): tuple(value) if isinstance(value, list) else value
            for key, value in given.items()}
    return kind(**{key: value for key, value in rows.items()
                   if key in kind.__dataclass_fields__})


def fly(path: Path, load: float, seed: int) -> dict[str, Any]:
    """Fly a scenario once; its figures."""
    return Run(scenario.load(path), seed, load).fly()


def main() -> int:
    """Fly, print, judge."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n')[0])
    parser.add_argument('--scenario', type=Path, default=SCENARIO)
    parser.add_argument('--flights', type=int, default=10)
    parser.add_argument('--seed', type=int, default=1, help='of the first flight')
    parser.add_argument('--load', type=float, default=1.0, help='0: no stalls')
    parser.add_argument('--workers', type=int, default=2)
    parser.add_argument('--json', action='store_true', help='only the last line')
    args = parser.parse_args()
    began, totals, least = time.monotonic(), Counter[str](), math.inf
    seeds = range(args.seed, args.seed + args.flights)
    with multiprocessing.get_context('spawn').Pool(args.workers) as pool:
        for seed, found in zip(seeds, pool.imap(partial(fly, args.scenario, args.load), seeds),
                               strict=True):
            totals.update({name: int(found[name]) for name in (
                *FAULTS, 'tasks_announced', 'tasks_completed', 'tasks_unassigned', 'uploads')})
            least = min(least, found['separation_min_m'] or math.inf)
            if not args.json:
                named = {name: found[name] for name in (*FAULTS, 'lost', 'flown_twice', 'entries',
                                                        'losses') if found[name]}
                print(f'{seed}: {found["tasks_completed"]} of {found["tasks_announced"]}, '
                      f'{found["finish_s"]:.0f} s, {found["metres_flown"]:.0f} m, '
                      f'{found["uploads"]} uploads, {found["separation_min_m"]} m {named or ""}',
                      flush=True)
    print(json.dumps({'flights': args.flights, 'load': args.load, 'seed': args.seed, **totals,
                      'separation_min_m': least, 'wall_s': round(time.monotonic() - began)}))
    return int(any(totals[name] for name in FAULTS))


if __name__ == '__main__':
    sys.exit(main())
