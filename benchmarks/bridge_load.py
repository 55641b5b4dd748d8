# SPDX-License-Identifier: Apache-2.0
"""Load of the bridge: 24 simulated UAVs on one port, 50 items to each at once.

Run after `colcon build`, in a sourced shell: `python benchmarks/bridge_load.py`. It prints CPU of
the bridge, telemetry and heartbeat rates and the time of the uploads, and ends with 1 where one
is missed: 50 % of one core, 5 Hz, 1 Hz and 5 s.
"""
from __future__ import annotations

import multiprocessing
import os
import select
import socket
import subprocess
import sys
import time
from collections import Counter

import rclpy
from ament_index_python.packages import get_package_prefix
from pymavlink.dialects.v20 import ardupilotmega as d
from rclpy.executors import SingleThreadedExecutor
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator.list_records import ListStop
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.model import Leg, Task
from uav_task_alloc.nodes.conversions.messages import LATCHED, STATES, header, planned_task
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.udp_fleet import UdpFleet

UAVS, ITEMS, PORT = 24, 50, 14650
ORIGIN = Origin(47.397742, 8.545594, 488.0)
WATCHED = 10.0  # [s]


def fly() -> None:
    """The fleet, in a process of its own."""
    fleet = UdpFleet([(VehicleConfig(f'uav_{n}', n, ORIGIN, (20.0 * n, 0.0, 0.0), arming_delay=0.0,
                                  floods=False), ('ardupilot', 'px4')[n % 2])
                   for n in range(1, UAVS + 1)], ('127.0.0.1', PORT))
    fleet.spin()


def task_list(n: int) -> m.TaskList:
    """ITEMS tasks for one UAV."""
    tasks = [planned_task(ListStop(Task(f'u{n}_{k}', (20.0 * n, 100.0 + 40.0 * k, 50.0)),
                                   Leg((), 40.0), 0.0)) for k in range(ITEMS)]
    return m.TaskList(header=header(0.0), uav_id=f'uav_{n}', revision=1, tasks=tasks)


def cpu(pid: int) -> float:
    """CPU time [s] of a process so far."""
    with open(f'/proc/{pid}/stat') as stat:
        fields = stat.read().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


class HeartbeatListener:
    """A remote that receives the heartbeats of the bridge."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.codec, self.times = Codec(99, 1), []
        self.send_heartbeat()

    def send_heartbeat(self) -> None:
        self.socket.sendto(self.codec.pack(d.MAVLink_heartbeat_message(
            d.MAV_TYPE_GCS, d.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)), ('127.0.0.1', PORT))

    def receive(self) -> None:
        while select.select([self.socket], [], [], 0.0)[0]:
            messages = self.codec.parse(self.socket.recv(65536))
            self.times += [time.monotonic()] * sum(x.get_type() == 'HEARTBEAT' for x in messages)


class Watch:
    """Receives the states, and the heartbeats by the listener."""

    def __init__(self) -> None:
        self.node = rclpy.create_node('load')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.states: dict[str, m.UavState] = {}
        self.received: Counter[str] = Counter()
        self.node.create_subscription(m.UavState, 'uav_states', self.on_state, STATES)
        self.listener = HeartbeatListener()

    def on_state(self, msg: m.UavState) -> None:
        self.states[msg.uav_id] = msg
        self.received[msg.uav_id] += 1

    def until(self, condition, limit: float) -> float:
        """How long [s] it took until the condition held, at most `limit`."""
        begin = time.monotonic()
        while not condition() and time.monotonic() < begin + limit:
            self.executor.spin_once(timeout_sec=0.02)
            self.listener.receive()
        return time.monotonic() - begin


def measure(watch: Watch, pid: int) -> dict[str, float]:
    """The figures."""
    watch.until(lambda: len(watch.states) == UAVS, 30.0)
    watch.listener.send_heartbeat()
    watch.until(lambda: False, 3.0)
    watch.received.clear()
    before, begin = cpu(pid), time.monotonic()
    watch.until(lambda: False, WATCHED)
    idle, span = cpu(pid) - before, time.monotonic() - begin
    rate = min(watch.received[f'uav_{n}'] for n in range(1, UAVS + 1)) / span
    publishers = [watch.node.create_publisher(m.TaskList, f'uav_{n}/task_list', LATCHED)
                  for n in range(1, UAVS + 1)]
    watch.until(lambda: all(p.get_subscription_count() for p in publishers), 10.0)
    lists = [task_list(n) for n in range(1, UAVS + 1)]
    before = cpu(pid)
    for publisher, tasks in zip(publishers, lists, strict=True):
        publisher.publish(tasks)
    took = watch.until(lambda: all(s.list_revision == 1 for s in watch.states.values()), 60.0)
    gaps = [b - a for a, b in zip(watch.listener.times, watch.listener.times[1:], strict=False)]
    return {'uavs': len(watch.states), 'state_hz_least': rate, 'cpu_percent': 100 * idle / span,
            'upload_s': took, 'upload_cpu_s': cpu(pid) - before,
            'heartbeat_gap_s_most': max(gaps, default=99.0)}


def main() -> int:
    """Measure, print, judge."""
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    fleet = multiprocessing.get_context('spawn').Process(target=fly, daemon=True)
    fleet.start()
    path = os.path.join(get_package_prefix('uav_task_alloc'), 'lib/uav_task_alloc/mavlink_bridge')
    bridge = subprocess.Popen([path, '--ros-args', '-p',
                               f"connections:=['udpin:127.0.0.1:{PORT}']"])
    rclpy.init()
    try:
        figures = measure(Watch(), bridge.pid)
    finally:
        bridge.terminate()
        bridge.wait(10)
        fleet.kill()
    for name, value in figures.items():
        print(f'{name:22} {value:8.2f}')
    return int(not (figures['state_hz_least'] >= 4.75 and figures['cpu_percent'] < 50.0
                    and figures['upload_s'] < 5.0 and figures['heartbeat_gap_s_most'] < 1.3))


if __name__ == '__main__':
    sys.exit(main())
