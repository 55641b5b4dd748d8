# SPDX-License-Identifier: Apache-2.0
"""Hours of battery changes on real nodes, with kill -9 of allocator and bridge at random moments.

    python benchmarks/endurance/battery_kills.py [--hours 8] [--kills 50] [--speedup 16] [--json]

Run after `colcon build`, in a sourced shell. fleet_sim flies ArduPilot and PX4 vehicles whose
batteries are changed after each landing at home; tasks arrive at random until the hours of
simulated time are over. A killed node is started again at once. Judged by the ground truth of
fleet_sim: ends with 1 where a battery was emptied in flight, a vehicle was lost or landed away
from home, a UAV was not available within LATEST_BACK of its change, or an acknowledged task was
lost, refused, flown twice or not completed. With `--state DIR` a run keeps its files there; run
again with it the next part goes on from them: vehicles start full at home, nothing else is new.
--json: the last line is one object.
"""
from __future__ import annotations

import argparse
import math
import random
import sys
import time
from collections import Counter
from pathlib import Path

import rclpy
from battery_ledger import Ledger, Truth
from node_run import Nodes, node_run, print_figures
from rclpy.executors import SingleThreadedExecutor
from rosgraph_msgs.msg import Clock
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SubmitTasks

from uav_task_alloc.model import Task
from uav_task_alloc.nodes.conversions.messages import LATCHED, STATES, announcement, from_stamp

TURNAROUND, SIDE = 120.0, 1500.0  # [s], [m]
ARRIVAL, DRAIN = 40.0, 2400.0  # [s] between two tasks on average; [s] without new ones, at most
LATEST_BACK = TURNAROUND + 60.0  # [s], and LAG of wall time, since the change or the last kill
LAG = 10.0  # [s]
ANSWER = 10.0  # [s] for an answer to an announcement
START = 120.0  # [s] until a node has sent its first message
KILLED = ('allocator', 'mavlink_bridge')
SCENARIO = 'route_end: home\ntrips: 2\nuavs:\n' + ''.join(
    f'  - {{id: uav_{n}, system_id: {n}, autopilot: {kind}, position: [{300 * n}, 0, 0],\n'
    f'     range: 6000, endurance: 400, turnaround: {TURNAROUND:g}, climb_speed: 2.5,\n'
    '     descent_speed: 1.5}\n'
    for n, kind in enumerate(('ardupilot', 'px4', 'ardupilot'), 1))


class Soak:
    """The node that announces tasks, receives everything, and kills."""

    def __init__(self, nodes: Nodes, ledger: Ledger, rng: random.Random, speedup: float) -> None:
        self.nodes, self.ledger, self.rng, self.speedup = nodes, ledger, rng, speedup
        self.truth = Truth(nodes.truth, nodes.homes, ledger.visited)
        self.node = rclpy.create_node('battery_kills')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.submit = self.node.create_client(SubmitTasks, 'allocator/submit_tasks')
        subscribe = self.node.create_subscription
        subscribe(Clock, '/clock', self.on_clock, 1)
        subscribe(m.UavState, 'uav_states', self.on_state, STATES)
        subscribe(m.TaskStatusArray, 'task_statuses', self.on_statuses, LATCHED)
        self.now = 0.0  # [s] of /clock
        self.first: set[str] = set()  # nodes that have sent something since their start
        self.up_at = 0.0  # [s] of /clock, when the bridge published again after its last start
        self.back: list[float] = []  # [s] from each change until the UAV was available
        self.late: set[tuple[str, float]] = set()
        self.ages: list[float] = []  # [s] of wall time, of states
        self.refused: list[str] = []
        self.waiting: list[Task] = []  # to be announced
        self.asked_at = -math.inf  # [s] steady clock

    def on_clock(self, msg: Clock) -> None:
        self.now = from_stamp(msg.clock)

    def on_statuses(self, msg: m.TaskStatusArray) -> None:
        if 'allocator' not in self.first:
            self.first.add('allocator')
            return  # may be of the process that was killed
        self.ledger.statuses(msg, self.now)

    def on_state(self, msg: m.UavState) -> None:
        if 'mavlink_bridge' not in self.first:
            self.first.add('mavlink_bridge')
            self.up_at = self.now
        stamp = from_stamp(msg.header.stamp)
        self.ages.append(max(0.0, self.now - stamp) / self.speedup)
        changed = self.truth.changed.get(msg.uav_id)
        if changed is not None and stamp > changed and msg.available and msg.battery > 0.9:
            self.back.append(self.now - changed)
            del self.truth.changed[msg.uav_id]

    def spin(self) -> None:
        """Receive, judge, announce."""
        self.executor.spin_once(timeout_sec=0.02)
        self.truth.read()
        since_kill = self.now - self.up_at if 'mavlink_bridge' in self.first else 0.0
        for uav, changed in self.truth.changed.items():
            if min(self.now - changed, since_kill) > LATEST_BACK + LAG * self.speedup:
                self.late.add((uav, changed))
        if self.waiting and time.monotonic() > self.asked_at + ANSWER and (
                self.submit.service_is_ready()):
            self.announce(self.waiting[0])

    def announce(self, task: Task) -> None:
        """Announce a task until it is acknowledged, over kills."""
        self.asked_at = time.monotonic()

        def answered(future) -> None:
            answer = future.result()
            if task not in self.waiting:
                return
            self.waiting.remove(task)
            self.asked_at = -math.inf
            if answer.accepted:
                self.ledger.accept(task, self.now)
            else:
                self.refused += answer.reasons

        self.submit.call_async(SubmitTasks.Request(announcement=announcement(
            m.TaskAnnouncement.ADD, [task], self.now))).add_done_callback(answered)

    def until(self, condition, seconds: float) -> bool:
        end = time.monotonic() + seconds
        while not condition() and time.monotonic() < end:
            self.spin()
        return bool(condition())

    def new_task(self) -> None:
        self.ledger.number += 1
        self.waiting.append(Task(f't{self.ledger.number}', (
            self.rng.uniform(0.0, SIDE), self.rng.uniform(0.0, SIDE), 40.0), service_time=3.0))

    def restart(self, name: str) -> None:
        """Kill a node and start it again."""
        self.nodes.kill(name)
        self.first.discard(name)
        self.nodes.start(name)


def fly(soak: Soak, hours: float, kills: int) -> Counter[str]:
    """All hours and the drain; returns the kills by node."""
    rng, nodes, done = soak.rng, soak.nodes, Counter[str]()
    for name in ('fleet_sim', *KILLED):
        nodes.start(name)
    if not soak.until(lambda: soak.now and len(soak.first) == len(KILLED), START):
        sys.exit(f'the nodes do not start: only {sorted(soak.first)} publish')
    began, began_wall, end = soak.now, time.monotonic(), soak.now + 3600.0 * hours
    moments = sorted(rng.uniform(began, end) for _ in range(kills))
    arrival, shown = began, 0.0
    while soak.now < end or (soak.ledger.open() and soak.now < end + DRAIN):
        soak.spin()
        if soak.now >= arrival and arrival < end:
            arrival += rng.expovariate(1.0 / ARRIVAL)
            soak.new_task()
        if moments and soak.now >= moments[0] and len(soak.first) == len(KILLED):
            moments.pop(0)
            name = rng.choice(KILLED)
            done[name] += 1
            soak.restart(name)
        if nodes.dead():
            sys.exit('; '.join(nodes.dead()))
        if time.monotonic() > shown + 5.0:
            shown = time.monotonic()
            print(f'\r{(soak.now - began) / 3600.0:.2f} h, {shown - began_wall:.0f} s, '
                  f'{sum(done.values())} kills, {len(soak.ledger.tasks)} tasks, '
                  f'{len(soak.ledger.open())} open, {soak.truth.figures["changes"]} changes, '
                  f'{faults(soak)} ', end='', file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return done


def faults(soak: Soak) -> dict[str, object]:
    """What must be empty or zero."""
    truth, ledger = soak.truth, soak.ledger
    found = {'emptied': truth.figures['emptied'], 'away': truth.figures['away'],
             'died': truth.figures['died'], 'late': sorted(soak.late),
             'lost': sorted(ledger.lost), 'refused': soak.refused,
             'flown_twice': ledger.flown_twice(),
             'reopened': sorted(ledger.reopened)}
    return {name: value for name, value in found.items() if value}


def run(args: argparse.Namespace, folder: Path) -> int:
    """One part, its figures and the verdict."""
    ledger = Ledger.load(folder / 'ledger.json')
    nodes = Nodes(folder, args.speedup, SCENARIO)
    soak = Soak(nodes, ledger, random.Random(args.seed + ledger.number), args.speedup)
    began, open_before = time.monotonic(), len(ledger.open())
    try:
        kills = fly(soak, args.hours, args.kills)
        cpu = nodes.cpu()
    finally:
        nodes.stop()
    ledger.save(folder / 'ledger.json')
    ages, back = sorted(soak.ages), sorted(soak.back)
    found = faults(soak)
    figures = {
        'hours': args.hours, 'seed': args.seed, 'speedup': args.speedup,
        'wall_s': round(time.monotonic() - began), 'kills': dict(kills),
        'tasks': len(ledger.tasks), 'open_before': open_before, 'open': len(ledger.open()),
        'completed': ledger.count(m.TaskStatus.COMPLETED), **soak.truth.figures,
        'back': len(back), 'back_median_s': round(back[len(back) // 2], 1) if back else None,
        'back_longest_s': round(back[-1], 1) if back else None,
        'least_battery': round(soak.truth.least, 3),
        'state_age_p99_s': round(ages[int(0.99 * len(ages))], 3), 'last_cpu_s': cpu,
        'faults': found}
    print_figures(figures, args.json)
    return int(bool(found or ledger.open()))


def main() -> int:
    """Command line."""
    return node_run(__doc__, run, {'hours': 8.0, 'kills': 50, 'speedup': 16.0})


if __name__ == '__main__':
    sys.exit(main())
