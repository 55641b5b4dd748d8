# SPDX-License-Identifier: Apache-2.0
"""Two machines and a wire: the allocator in one network namespace, UAV and tasks in another.

Run as root in a sourced shell: `python benchmarks/endurance/cut.py --seconds 30`. The wire is cut
for so long while tasks are announced; the last line is JSON, the status 1 where a task announced
before or during the cut is not in the UAV's list after it. Without permission to create
namespaces the result is `skipped`.
"""
from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time

import rclpy
from ament_index_python.packages import get_package_prefix
from geometry_msgs.msg import Point
from rclpy.executors import SingleThreadedExecutor
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.model import Task
from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS, LATCHED, STATES, announcement

LIMIT = 60.0  # [s]
DOMAIN = '97'  # used on this wire only
PLACES = ('allocator', 'field')


def ip(*words: str) -> None:
    """Run `ip`; raise CalledProcessError with its output."""
    subprocess.run(['ip', *words], check=True, capture_output=True, text=True)


class Wire:
    """Two namespaces, one for each place, and a veth pair between them."""

    def __init__(self) -> None:
        self.spaces = {place: f'uta_{place}_{os.getpid()}' for place in PLACES}

    def __enter__(self) -> Wire:
        for space in self.spaces.values():
            ip('netns', 'add', space)
        ends = [f'uta{k}_{os.getpid()}' for k in range(2)]
        ip('link', 'add', ends[0], 'type', 'veth', 'peer', 'name', ends[1])
        for k, (space, end) in enumerate(zip(self.spaces.values(), ends, strict=True)):
            ip('link', 'set', end, 'netns', space)
            ip('-n', space, 'link', 'set', end, 'name', 'wire')
            ip('-n', space, 'addr', 'add', f'10.231.7.{k + 1}/24', 'dev', 'wire')
            ip('-n', space, 'link', 'set', 'lo', 'up')
            plug(space)
        return self

    def __exit__(self, *_: object) -> None:
        for space in self.spaces.values():
            subprocess.run(['ip', 'netns', 'del', space], capture_output=True)

    def start(self, place: str, *command: str, **more) -> subprocess.Popen:
        """Start a process in a namespace, which reaches the other one only by the wire."""
        env = {**os.environ, 'ROS_DOMAIN_ID': DOMAIN, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET',
               'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}  # no shared memory, as between machines
        env.pop('FASTRTPS_DEFAULT_PROFILES_FILE', None)
        return subprocess.Popen(['ip', 'netns', 'exec', self.spaces[place], sys.executable,
                                 *command], env=env, **more)


def plug(space: str) -> None:
    """Connect the wire."""
    ip('-n', space, 'link', 'set', 'wire', 'up')
    ip('-n', space, 'route', 'replace', '224.0.0.0/4', 'dev', 'wire')


def unplug(space: str) -> None:
    """Cut the wire."""
    ip('-n', space, 'link', 'set', 'wire', 'down')


class Field:
    """A UAV that publishes its state, and a source of tasks."""

    def __init__(self) -> None:
        rclpy.init()
        self.node = rclpy.create_node('field')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.tasks = self.node.create_publisher(m.TaskAnnouncement, 'task_announcements',
                                                ANNOUNCEMENTS)
        self.states = self.node.create_publisher(m.UavState, 'uav_states', STATES)
        self.list = m.TaskList()
        self.node.create_subscription(m.TaskList, 'uav/task_list', self.on_list, LATCHED)
        self.node.create_timer(0.2, self.publish_state)

    def on_list(self, msg: m.TaskList) -> None:
        self.list = msg

    def publish_state(self) -> None:
        self.states.publish(m.UavState(
            uav_id='uav', position=Point(z=50.0), home=Point(x=math.nan), battery=1.0,
            range_remaining=math.nan, cruise_speed=math.nan, available=True,
            list_revision=self.list.revision))

    def add(self, *names: str) -> None:
        self.tasks.publish(announcement(m.TaskAnnouncement.ADD, [
            Task(name, (100.0 * len(name), 10.0 * k, 50.0)) for k, name in enumerate(names)], 0.0))

    def until(self, condition, limit: float = LIMIT) -> float:
        """How long [s] it took until the condition held, at most `limit`."""
        began = time.monotonic()
        while not condition() and time.monotonic() < began + limit:
            self.executor.spin_once(timeout_sec=0.05)
        return time.monotonic() - began

    def has(self, *names: str) -> bool:
        return set(names) <= {planned.task.task_id for planned in self.list.tasks}


def in_the_field(space: str, seconds: float) -> dict[str, object]:
    """Wait for the allocator, cut the wire, announce tasks, reconnect it."""
    field = Field()
    field.add('before')
    met = field.until(lambda: field.has('before'))
    revision = field.list.revision
    unplug(space)
    field.until(lambda: False, seconds / 2)
    field.add('amid_1', 'amid_2')
    listed = field.list.revision > revision
    field.until(lambda: False, seconds / 2)
    plug(space)
    back = field.until(lambda: field.has('before', 'amid_1', 'amid_2'))
    field.add('after')
    then = field.until(lambda: field.has('after'))
    return {'cut_s': seconds, 'met_s': round(met, 2), 'received_during_cut': listed,
            'back_s': round(back, 2), 'next_task_s': round(then, 2),
            'revisions': [revision, field.list.revision],
            'all_tasks': field.has('before', 'amid_1', 'amid_2', 'after')}


def measure(seconds: float) -> dict[str, object]:
    """The figures, or why there are none."""
    prefix = get_package_prefix('uav_task_alloc')
    if shutil.which('ip') is None:
        return {'skipped': 'no `ip` command here'}
    try:
        with Wire() as wire:
            node = wire.start('allocator', f'{prefix}/lib/uav_task_alloc/allocator',
                              stdout=sys.stderr)
            field = wire.start('field', __file__, '--space', wire.spaces['field'], '--seconds',
                               str(seconds), stdout=subprocess.PIPE, text=True)
            try:
                output, _ = field.communicate(timeout=3 * LIMIT + seconds)
            finally:
                field.kill()
                node.send_signal(signal.SIGTERM)
                status = node.wait(30)
    except subprocess.CalledProcessError as error:
        return {'skipped': f'no network namespaces here: {error.stderr.strip()}'}
    return {**json.loads(output.splitlines()[-1]), 'allocator_status': status}


def main() -> int:
    """Measure, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=30.0, help='how long the wire is cut')
    parser.add_argument('--space', help=argparse.SUPPRESS)
    args = parser.parse_args()
    figures = in_the_field(args.space, args.seconds) if args.space else measure(args.seconds)
    print(json.dumps(figures))
    return int('skipped' not in figures and not figures['all_tasks'])


if __name__ == '__main__':
    sys.exit(main())
