# SPDX-License-Identifier: Apache-2.0
"""Records every topic of a fleet into an MCAP file, in a thread of its own."""
from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from threading import Event, Thread
from typing import Any

import rclpy
from ament_index_python.packages import PackageNotFoundError
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from uav_task_alloc.nodes.conversions.message_definitions import definition
from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS, EVENTS, LATCHED, STATES
from uav_task_alloc.record.bag import Bag

_LOOK = 1.0  # [s] between two looks for new topics, and at first between two chunks on disk
RARER = 1.0 / 3600.0  # of its age a recording waits for a chunk, as their index is in memory
RAREST = 10.0  # [s] between two chunks, however old it is
DEPTH = 1000  # messages that wait for the disk, a topic
_OURS = 'uav_task_alloc_msgs/msg/'
# those whose first message must not be missed; all others as they turn up
_KNOWN = {'task_announcements': (_OURS + 'TaskAnnouncement', ANNOUNCEMENTS),
         'threat_zones': (_OURS + 'ThreatZoneArray', LATCHED),
         'fleet_origin': (_OURS + 'FleetOrigin', LATCHED),
         'task_statuses': (_OURS + 'TaskStatusArray', LATCHED),
         'allocation': (_OURS + 'Allocation', LATCHED),
         'task_events': (_OURS + 'TaskEvent', EVENTS),
         'uav_states': (_OURS + 'UavState', STATES)}


class BagRecorder:
    """Records from `start` to `stop` the topics under a namespace and those outside of every.

    A disk that fails ends the recording and nothing else. Raises InvalidValue or OSError where
    the file cannot be begun.
    """

    def __init__(self, path: Path, namespace: str = '/',
                 about: Mapping[str, str] | None = None,
                 context: Context | None = None) -> None:
        self.bag: Bag | None = Bag(path, about or {})
        self.path = path
        self.node = Node('recorder', namespace=namespace, use_global_arguments=False,
                         context=context)
        self.within = namespace.rstrip('/') + '/'
        self.known: set[str] = set()  # topics that are recorded, or cannot be
        for name, (type_name, qos) in _KNOWN.items():
            self.record(self.within + name, type_name, qos)
        self.node.create_timer(_LOOK, self.on_look)
        self.began = self.flushed = time.monotonic()
        self.ending = Event()
        self.thread = Thread(target=self.run, name='recorder', daemon=True)

    def start(self) -> None:
        """Begin to listen."""
        self.thread.start()

    def run(self) -> None:
        """In the thread: until `stop`."""
        executor = SingleThreadedExecutor(context=self.node.context)
        executor.add_node(self.node)
        while not self.ending.is_set() and rclpy.ok(context=self.node.context):
            executor.spin_once(timeout_sec=0.1)
        executor.shutdown()

    def stop(self) -> None:
        """Write the end of the file."""
        self.ending.set()
        if self.thread.is_alive():
            self.thread.join()
        self.guard(lambda bag: bag.close())
        self.node.destroy_node()

    def on_look(self) -> None:
        """Record what has turned up, and put on disk what came."""
        for topic, types in self.node.get_topic_names_and_types():
            if (topic not in self.known and self.is_ours(topic)
                    and self.node.count_publishers(topic)):
                self.record(topic, types[0], self.offered(topic))
        now = time.monotonic()
        if now - self.flushed >= min(RAREST, RARER * (now - self.began)):
            self.flushed = now
            self.guard(lambda bag: bag.flush())

    def is_ours(self, topic: str) -> bool:
        """Of the fleet, or of all: `/diagnostics`, `/rosout`."""
        return topic.startswith(self.within) or topic.count('/') == 1

    def offered(self, topic: str) -> QoSProfile:
        """The best that all its publishers have."""
        offers = [each.qos_profile for each in self.node.get_publishers_info_by_topic(topic)]
        reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offers)
        latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offers)
        return QoSProfile(
            depth=DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE)

    def record(self, topic: str, type_name: str, qos: QoSProfile) -> None:
        """From now on; a type that is not installed here is named and left out."""
        self.known.add(topic)
        try:
            package, _, kind = type_name.split('/')
            message: Any = getattr(import_module(f'{package}.msg'), kind)
            text = definition(type_name)
        except (ImportError, AttributeError, ValueError, OSError, PackageNotFoundError) as error:
            self.node.get_logger().warning(f'{topic} is not recorded: {type_name}: {error}')
            return
        self.guard(lambda bag: bag.open(topic, type_name, text))

        def take(data: bytes, info: Mapping[str, int]) -> None:
            now = time.time_ns()
            self.guard(lambda bag: bag.add(topic, data, info['received_timestamp'] or now,
                                           info['source_timestamp'] or now))

        self.node.create_subscription(
            message, topic, take, QoSProfile(
                depth=DEPTH, reliability=qos.reliability, durability=qos.durability), raw=True)

    def guard(self, write: Callable[[Bag], None]) -> None:
        """Write, and give up for good where that fails."""
        if self.bag is None:
            return
        try:
            write(self.bag)
        except OSError as error:
            self.node.get_logger().error(f'recording into {self.path} ends: {error}')
            with suppress(OSError):  # it tries to write once more
                self.bag.file.close()
            self.bag = None
