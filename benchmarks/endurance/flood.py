# SPDX-License-Identifier: Apache-2.0
"""Load of the allocator: 10 000 tasks in one second, 1000 states a second from 200 UAVs.

Run in a sourced shell: `python benchmarks/endurance/flood.py`. The node runs with a journal; its
callbacks are timed in the node, all else is measured from outside. The last line is JSON; the
status is 1 where one is missed: p99 of the callbacks 50 ms, states 1 s old, every task
acknowledged or refused.
"""
from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.model import Task
from uav_task_alloc.nodes.allocator import AllocatorNode
from uav_task_alloc.nodes.conversions.messages import (
    INPUT_ANNOUNCEMENTS,
    LATCHED,
    STATES,
    PointMsg,
    announcement,
    from_stamp,
    header,
)
from uav_task_alloc.nodes.ros.run import run

UAVS, RATE, SIDE, TICK = 200, 1000, 10_000.0, 0.02  # states/s, [m], [s]
REST = 5.0  # [s] of states before the flood and after the last task is answered
TIMED = ('on_state', 'on_tasks', 'on_zones', 'on_event', 'on_step', 'on_results',
         'publish_diagnostics')


class TimedAllocator(AllocatorNode):
    """The allocator with every callback timed, and the ages of the states recorded."""

    def __init__(self) -> None:
        self.took: list[tuple[str, float]] = []  # callback, [s]
        self.ages: list[float] = []  # [s]
        for name in TIMED:
            setattr(self, name, self._timed(name, getattr(self, name)))
        super().__init__()

    def _timed(self, name, call):
        def timed(*args):
            if name == 'on_state':
                self.ages.append(time.time() - from_stamp(args[0].header.stamp))
            began = time.monotonic()
            try:
                return call(*args)
            finally:
                self.took.append((name, time.monotonic() - began))
        return timed

    def destroy_node(self) -> None:
        """Write the measurements, too."""
        Path(os.environ['FLOOD_OUT']).write_text(json.dumps(
            {'took': self.took, 'ages': self.ages}))
        super().destroy_node()


def publish_states() -> None:
    """200 UAVs that publish their states 5 times a second, until a signal ends the process."""
    # rclpy would end its context amid a publication, which raises
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    node = rclpy.create_node('uavs')
    publisher = node.create_publisher(m.UavState, 'uav_states', STATES)
    rng, sent, began = random.Random(1), 0, time.monotonic()
    states = [m.UavState(uav_id=f'uav_{k}', battery=1.0, range_remaining=1e5, cruise_speed=15.0,
                         available=True, position=PointMsg(
                             x=rng.uniform(0.0, SIDE), y=rng.uniform(0.0, SIDE), z=50.0))
              for k in range(UAVS)]
    while rclpy.ok():
        while sent < (time.monotonic() - began) * RATE:
            state = states[sent % UAVS]
            state.header = header(time.time())
            publisher.publish(state)
            sent += 1
        time.sleep(TICK)


class Watch:
    """Announces tasks, and receives their statuses."""

    def __init__(self) -> None:
        self.node = rclpy.create_node('flood')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.states: dict[str, int] = {}
        self.received: list[float] = []  # [s] times of the statuses
        self.node.create_subscription(m.TaskStatusArray, 'task_statuses', self.on_statuses,
                                      LATCHED)
        # a writer keeps what is not acknowledged yet, so this one's depth is the whole flood
        self.tasks = self.node.create_publisher(m.TaskAnnouncement, 'task_announcements',
                                                INPUT_ANNOUNCEMENTS)

    def on_statuses(self, msg: m.TaskStatusArray) -> None:
        self.received.append(time.monotonic())
        self.states = {status.task_id: status.state for status in msg.statuses}

    def until(self, condition, limit: float) -> float:
        """How long [s] it took until the condition held, at most `limit`."""
        began = time.monotonic()
        while not condition() and time.monotonic() < began + limit:
            self.executor.spin_once(timeout_sec=0.05)
        return time.monotonic() - began

    def flood(self, count: int, size: int) -> float:
        """`count` tasks within one second, `size` a message; the time it took [s]."""
        rng = random.Random(2)
        tasks = [Task(f't{k}', (rng.uniform(0.0, SIDE), rng.uniform(0.0, SIDE), 50.0))
                 for k in range(count)]
        raw = [serialize_message(announcement(m.TaskAnnouncement.ADD, tasks[k:k + size], 0.0))
               for k in range(0, count, size)]
        began = time.monotonic()
        for k, one in enumerate(raw):
            time.sleep(max(0.0, began + k / len(raw) - time.monotonic()))
            self.tasks.publish(one)
        return time.monotonic() - began


def measure(watch: Watch, count: int, size: int) -> dict[str, object]:
    """The figures measured from outside."""
    watch.until(watch.tasks.get_subscription_count, 30.0)
    watch.until(lambda: False, REST)
    watch.received.clear()
    spent = watch.flood(count, size)
    answered = spent + watch.until(lambda: len(watch.states) >= count, 60.0)
    planned = answered + watch.until(
        lambda: m.TaskStatus.PENDING not in watch.states.values(), 60.0)
    watch.until(lambda: False, REST)
    states = Counter(watch.states.values())
    gaps = [b - a for a, b in zip(watch.received, watch.received[1:], strict=False)]
    return {'tasks': count, 'tasks_a_message': size, 'flood_s': spent,
            'answered_s': answered, 'planned_s': planned,
            'unanswered': count - len(watch.states),
            'assigned': states[m.TaskStatus.ASSIGNED] + states[m.TaskStatus.ACTIVE],
            'unassigned': states[m.TaskStatus.UNASSIGNED],
            'pending': states[m.TaskStatus.PENDING],
            'rejected': states[m.TaskStatus.REJECTED], 'statuses_gap_s_most': max(gaps)}


def from_node(path: Path) -> dict[str, object]:
    """The figures measured in the node."""
    measured = json.loads(path.read_text())
    times = sorted(seconds for _, seconds in measured['took'])
    calls: dict[str, list[float]] = {}
    for name, seconds in measured['took']:
        calls.setdefault(name, []).append(seconds)
    worst = {name: {'calls': len(each), 'total_s': round(sum(each), 2),
                    'worst_ms': round(1e3 * max(each), 1)} for name, each in calls.items()}
    ages = sorted(measured['ages'])
    return {'callbacks': len(times), 'callback_ms_p99': 1e3 * times[int(0.99 * len(times))],
            'by_callback': worst, 'states': len(ages),
            'state_age_s_p99': ages[int(0.99 * len(ages))], 'state_age_s_max': ages[-1]}


def start(role: str, *more: str) -> subprocess.Popen:
    """Run this file in another process, in a role."""
    return subprocess.Popen([sys.executable, __file__, '--role', role, *more])


def main() -> int:
    """Measure, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--tasks', type=int, default=10_000)
    parser.add_argument('--size', type=int, default=1, help='tasks in one announcement')
    parser.add_argument('--role', choices=('node', 'uavs'), help=argparse.SUPPRESS)
    args, rest = parser.parse_known_args()
    if args.role:
        return (run(TimedAllocator, [sys.argv[0], *rest]) if args.role == 'node'
                else publish_states()) or 0
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    with tempfile.TemporaryDirectory() as folder:
        os.environ['FLOOD_OUT'] = f'{folder}/seen.json'
        node = start('node', '--ros-args', '--log-level', 'warn', '-p',
                     f'state_dir:={folder}/state')
        uavs = start('uavs')
        rclpy.init()
        try:
            figures = measure(Watch(), args.tasks, args.size)
        finally:
            uavs.terminate()
            uavs.wait(30)
            node.send_signal(signal.SIGTERM)
            status = node.wait(30)
        figures |= {'status': status, **from_node(Path(os.environ['FLOOD_OUT']))}
    print(json.dumps(figures))
    return int(not (figures['callback_ms_p99'] < 50.0 and figures['state_age_s_max'] < 1.0
                    and figures['unanswered'] == 0 and status == 0))


if __name__ == '__main__':
    sys.exit(main())
