# SPDX-License-Identifier: Apache-2.0
"""Crash test: the allocator is killed at random moments of a busy run; nothing may be lost.

    python benchmarks/endurance/crash.py [--kills 200] [--seed 1] [--json]

Run after `colcon build`, in a sourced shell. A fleet without vehicles flies the lists, submits
tasks by service and by topic, withdraws some, switches UAVs off; kill -9 ends the allocator, one
kill in eight while it still starts. Each restart must restore all that was acknowledged.
--json: the last line is one object, with `kills`, `tasks_lost`, `tasks_done_twice` and
`recovery_s_p99`, from the start of the process to its first list or allocation. Ends with 1
where something was lost or p99 is 2 s or more.
"""
from __future__ import annotations

import argparse
import json
import math
import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import rclpy
from ament_index_python.packages import get_package_prefix
from crash_fleet import HEIGHT, Flyer, Ledger
from geometry_msgs.msg import Point
from node_run import own_network
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SetAvailability, SubmitTasks

from uav_task_alloc.nodes.conversions.messages import EVENTS, LATCHED, STATES

UAVS, SIDE = 5, 400.0  # number, [m]
MOST_OPEN = 30  # tasks at once
STARTING = 1.0 / 8.0  # share of kills before the allocator is up
LIMIT = 90.0  # [s] for a restart: a machine may be busy with other work
# only the last message is replayed to a new allocator: it must have the rest on disk
LAST_ONLY = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                       durability=DurabilityPolicy.TRANSIENT_LOCAL)
S, A = m.TaskStatus, m.TaskAnnouncement


class World:
    """The node around the fleet and the ledger: topics, services, and random demands."""

    def __init__(self, rng: random.Random) -> None:
        self.rng, self.ledger = rng, Ledger()
        self.published_at, self.has_statuses = 0.0, False  # of this run of the allocator
        self.node = rclpy.create_node('crash')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        make = self.node.create_publisher
        self.states, self.events = make(m.UavState, 'uav_states', STATES), make(
            m.TaskEvent, 'task_events', EVENTS)
        self.tasks = make(A, 'task_announcements', LAST_ONLY)
        self.zones = make(m.ThreatZoneArray, 'threat_zones', LATCHED)
        subscribe = self.node.create_subscription
        subscribe(m.TaskStatusArray, 'task_statuses', self.on_statuses, LATCHED)
        subscribe(m.Allocation, 'allocation', self.on_allocation, LATCHED)
        self.submit = self.node.create_client(SubmitTasks, 'allocator/submit_tasks')
        self.switch = self.node.create_client(SetAvailability, 'allocator/set_availability')
        self.flyers = {f'u{k}': Flyer(f'u{k}', (SIDE / UAVS * k, 0.0), self.events.publish,
                                      self.ledger, rng) for k in range(UAVS)}
        for uav_id in self.flyers:
            subscribe(m.TaskList, f'{uav_id}/task_list', self.on_list, LATCHED)
        self.announced, self._next, self.demanding = 0, dict.fromkeys('sda', 0.0), True
        self.switched: Counter[str] = Counter()  # times that a UAV was switched

    def on_statuses(self, msg: m.TaskStatusArray) -> None:
        self.has_statuses = True
        self.ledger.statuses(msg)

    def on_allocation(self, msg: m.Allocation) -> None:
        self.published_at = self.published_at or time.monotonic()
        self.ledger.rises('allocation', msg.revision)

    def on_list(self, msg: m.TaskList) -> None:
        self.published_at = self.published_at or time.monotonic()
        self.ledger.listed(msg)
        self.flyers[msg.uav_id].assign(msg, time.monotonic())

    def due(self, what: str, period: float, now: float) -> bool:
        if now < self._next[what]:
            return False
        self._next[what] = now + period
        return True

    def spin(self) -> None:
        """One step of the run."""
        self.executor.spin_once(timeout_sec=0.01)
        now = time.monotonic()
        for flyer in self.flyers.values():
            flyer.step(now)
        if self.due('s', 0.1, now):
            for flyer in self.flyers.values():
                self.states.publish(flyer.state())
        if self.demanding and self.due('d', 0.2, now):
            self.demand()
        if self.due('a', 1.0, now):
            self.set_available(self.rng.choice(sorted(self.flyers)),
                               not self.demanding or self.rng.random() < 0.7)

    def demand(self) -> None:
        """One random announcement: a withdrawal, a zone, or tasks."""
        waiting = sorted(self.ledger.accepted - set(self.ledger.ended))
        choice = self.rng.random()
        if choice < 0.1 and waiting:
            self.announce(A(action=A.CANCEL, tasks=[m.Task(task_id=self.rng.choice(waiting))]))
        elif choice < 0.15:
            self.zones.publish(m.ThreatZoneArray(zones=[m.ThreatZone(
                zone_id='z', center=Point(x=self.rng.uniform(0.0, SIDE), y=0.5 * SIDE),
                radius=60.0)]))
        elif len(waiting) < MOST_OPEN:
            tasks = [self.task() for _ in range(self.rng.randint(1, 3))]
            self.announce(A(action=A.ADD, tasks=tasks))

    def task(self) -> m.Task:
        self.announced += 1
        x, y = self.rng.uniform(0.0, SIDE), self.rng.uniform(0.0, SIDE)
        return m.Task(task_id=f't{self.announced}', value=1.0, acceptance_radius=math.nan,
                      position=Point(x=x, y=y, z=HEIGHT + 100.0))

    def announce(self, announcement: A) -> None:
        """Announce by topic or by service."""
        if self.rng.random() < 0.5 or not self.submit.service_is_ready():
            self.tasks.publish(announcement)
            return
        def answered(future) -> None:
            if announcement.action == A.ADD:
                self.ledger.accepted.update(future.result().accepted)
            else:
                self.ledger.ended.update(
                    (t, (S.CANCELLED, time.time())) for t in future.result().accepted)
        self.submit.call_async(SubmitTasks.Request(announcement=announcement)).add_done_callback(
            answered)

    def set_available(self, uav_id: str, available: bool) -> None:
        """Set operator availability; unknown to the ledger until the service responds."""
        if not self.switch.service_is_ready():
            return
        self.ledger.off.pop(uav_id, None)
        self.switched[uav_id] += 1
        number = self.switched[uav_id]
        def answered(future) -> None:
            if future.result().success and not available and number == self.switched[uav_id]:
                self.ledger.switched_off(uav_id)
        self.switch.call_async(SetAvailability.Request(
            uav_id=uav_id, available=available)).add_done_callback(answered)

    def until(self, condition, limit: float) -> bool:
        end = time.monotonic() + limit
        while not condition() and time.monotonic() < end:
            self.spin()
        return bool(condition())


class Process:
    """The allocator process, which is killed and restarted."""

    def __init__(self, folder: str, more: tuple[str, ...] = ()) -> None:
        path = Path(get_package_prefix('uav_task_alloc'), 'lib/uav_task_alloc/allocator')
        self._command = [str(path), '--ros-args']
        for name, value in (('state_dir', folder), ('uav_timeout', 3.0), ('solve_budget', 0.05)):
            self._command += ['-p', f'{name}:={value}']
        self._command += more
        self.folder = folder  # of the journal
        self.log = Path(folder, 'allocator.log')
        self._popen: subprocess.Popen[bytes] | None = None

    def start(self) -> float:
        """Returns when [s]."""
        began = time.monotonic()
        with self.log.open('a') as out:
            self._popen = subprocess.Popen(self._command, stdout=out, stderr=subprocess.STDOUT)
        return began

    def cpu(self) -> float:
        """CPU time [s] so far."""
        with open(f'/proc/{self._popen.pid}/stat') as stat:
            fields = stat.read().rpartition(')')[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')

    def kill(self) -> None:
        if self._popen is not None:
            self._popen.kill()
            self._popen.wait()


def run_once(world: World, process: Process, rng: random.Random,
             last: bool) -> tuple[float, float] | None:
    """Start the allocator, keep it busy, kill it.

    Returns:
        Time and CPU time [s] until the first list, None where it was killed before.
    """
    world.published_at, world.has_statuses, cpu = 0.0, False, math.nan
    began = process.start()
    if not last and rng.random() < STARTING:
        world.until(lambda: False, rng.uniform(0.0, 1.0))
    else:
        if world.until(lambda: world.published_at, LIMIT):
            cpu = process.cpu()
        if not world.until(lambda: world.published_at and world.has_statuses, LIMIT):
            sys.exit(f'no message in {LIMIT:g} s:\n{process.log.read_text()[-2000:]}')
        world.until(lambda: False, 0.0 if last else rng.uniform(0.02, 2.5))
    if not last:
        world.ledger.killed()
        process.kill()
    return (world.published_at - began, cpu) if cpu == cpu else None


def crash(kills: int, seed: int, process: Process) -> dict[str, object]:
    """All runs and the figures."""
    rng, recoveries = random.Random(seed), []
    world, began = World(rng), time.monotonic()
    for k in range(kills):
        took = run_once(world, process, rng, last=False)
        recoveries += [] if took is None or k == 0 else [took]
        spent = time.monotonic() - began
        print(f'\r{k + 1}/{kills} kills, {len(world.ledger.accepted)} tasks, '
              f'{spent * (kills - k - 1) / (k + 1):.0f} s to go  ', end='', file=sys.stderr)
    recoveries += filter(None, [run_once(world, process, rng, last=True)])
    world.demanding = False
    over = world.until(lambda: world.ledger.accepted <= set(world.ledger.ended), 60.0)
    print(file=sys.stderr)
    return figures(world, kills, recoveries, seed, over)


def figures(world: World, kills: int, recoveries: list[tuple[float, float]], seed: int,
            over: bool) -> dict[str, object]:
    """The last line."""
    def share(least: float, which: int) -> float:
        ordered = sorted(each[which] for each in recoveries)
        return round(ordered[math.ceil(least * len(ordered)) - 1], 3)

    ledger = world.ledger
    states = Counter(state for state, _ in ledger.ended.values())
    return {
        'kills': kills, 'tasks_lost': len(set(ledger.faults['lost'])),
        'tasks_done_twice': len(ledger.done_twice()),
        'recovery_s_p99': share(0.99, 0), 'recovery_s_median': share(0.5, 0),
        'recovery_cpu_s_p99': share(0.99, 1), 'recovery_cpu_s_median': share(0.5, 1),
        'recoveries': len(recoveries),
        'revisions_fallen': len(ledger.faults['revisions']),
        'availability_lost': len(ledger.faults['off']),
        'tasks_acknowledged': len(ledger.accepted),
        'tasks_never_acknowledged': world.announced - len(ledger.accepted),
        'tasks_completed': states[S.COMPLETED], 'tasks_cancelled': states[S.CANCELLED],
        'tasks_failed': states[S.FAILED], 'all_ended': over, 'seed': seed,
        'faults': {name: sorted(set(ids))[:5] for name, ids in ledger.faults.items() if ids},
    }


def measured(text: str | None, measure: Callable[[int, int, Process], dict[str, object]],
             parameters: tuple[str, ...] = ()) -> dict[str, object]:
    """Read the command line, kill an allocator in a network of its own, print the figures.

    text: of `--help`.
    measure: takes the kills, the seed and the process to kill.
    parameters: of the allocator, as ROS arguments.
    """
    parser = argparse.ArgumentParser(description=(text or '').partition('\n')[0])
    parser.add_argument('--kills', type=int, default=200)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--json', action='store_true')
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, own_network(folder):
        process = Process(folder, parameters)
        try:
            result = measure(args.kills, args.seed, process)
        finally:
            process.kill()
    for name, value in result.items():
        print(f'{name:26} {value}', file=sys.stderr if args.json else sys.stdout)
    if args.json:
        print(json.dumps(result))
    return result


def main() -> int:
    """Measure, print, judge."""
    result = measured(__doc__, crash)
    wrong = ('tasks_lost', 'tasks_done_twice', 'revisions_fallen', 'availability_lost')
    return int(any(result[name] for name in wrong) or result['recovery_s_p99'] >= 2.0)


if __name__ == '__main__':
    sys.exit(main())
