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
from uav_task_alloc.nodes.ros.clock_watch import steady_clock
from uav_task_alloc.record.bag import Bag

_DISCOVERY_PERIOD = 1.0  # [s] between two checks for new topics; also the shortest flush period
# the period of flushes grows with the age of a recording, as the index of chunks is in memory
_FLUSH_SHARE = 1.0 / 3600.0
_LONGEST_FLUSH = 10.0  # [s]
_DEPTH = 1000  # messages of a topic that wait for the disk
_MOST_HELD = 10_000  # messages before the first /clock; more are written at time 0
_MESSAGES = 'uav_task_alloc_msgs/msg/'
# subscribed at once, as their first messages must not be missed; all others when discovered
_FLEET_TOPICS = {
    'task_announcements': (_MESSAGES + 'TaskAnnouncement', ANNOUNCEMENTS),
    'threat_zones': (_MESSAGES + 'ThreatZoneArray', LATCHED),
    'fleet_origin': (_MESSAGES + 'FleetOrigin', LATCHED),
    'task_statuses': (_MESSAGES + 'TaskStatusArray', LATCHED),
    'allocation': (_MESSAGES + 'Allocation', LATCHED),
    'plan_proposal': (_MESSAGES + 'PlanProposal', LATCHED),
    'separation_alerts': (_MESSAGES + 'SeparationAlert', EVENTS),
    'task_events': (_MESSAGES + 'TaskEvent', EVENTS),
    'uav_states': (_MESSAGES + 'UavState', STATES)}


class BagRecorder:
    """Records from `start` to `stop` the topics of a namespace and those of no namespace.

    A write error ends the recording and is logged; the node goes on.

    Args:
        path: of the file, which must not exist.
        namespace: of the fleet.
        metadata: key -> value, stored with the recording.
        context: of rclpy; None: the default one.
        clock: gives the time that messages get [ns], from another thread; 0: not known yet.
            None: the time of their arrival.

    Raises:
        InvalidValue, OSError: the file cannot be created.
    """

    def __init__(self, path: Path, namespace: str = '/',
                 metadata: Mapping[str, str] | None = None,
                 context: Context | None = None,
                 clock: Callable[[], int] | None = None) -> None:
        self.bag: Bag | None = Bag(path, metadata or {})
        self.path, self.clock = path, clock
        self.held: list[tuple[str, bytes]] = []  # received before there was a time
        self.node = Node('recorder', namespace=namespace, use_global_arguments=False,
                         context=context)
        self.prefix = namespace.rstrip('/') + '/'
        self.known: set[str] = set()  # topics that are recorded, or cannot be
        for name, (type_name, qos) in _FLEET_TOPICS.items():
            self.record(self.prefix + name, type_name, qos)
        self.node.create_timer(_DISCOVERY_PERIOD, self.on_timer, clock=steady_clock())
        self.started_at = self.flushed_at = time.monotonic()
        self.stopping = Event()
        self.thread = Thread(target=self.run, name='recorder', daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self.thread.start()

    def run(self) -> None:
        """In the thread: spin until `stop`."""
        executor = SingleThreadedExecutor(context=self.node.context)
        executor.add_node(self.node)
        while not self.stopping.is_set() and rclpy.ok(context=self.node.context):
            executor.spin_once(timeout_sec=0.1)
        executor.shutdown()

    def stop(self) -> None:
        """End the thread and close the file."""
        self.stopping.set()
        if self.thread.is_alive():
            self.thread.join()
        for topic, data in self.held:
            self._write(lambda bag, t=topic, d=data: bag.add(t, d, 0, 0))  # type: ignore[misc]
        self._write(lambda bag: bag.close())
        self.node.destroy_node()

    def on_timer(self) -> None:
        """Record topics that were discovered, and flush when it is time."""
        for topic, types in self.node.get_topic_names_and_types():
            if (topic not in self.known and self.is_recorded(topic)
                    and self.node.count_publishers(topic)):
                self.record(topic, types[0], self.offered_qos(topic))
        now = time.monotonic()
        if now - self.flushed_at >= min(_LONGEST_FLUSH, _FLUSH_SHARE * (now - self.started_at)):
            self.flushed_at = now
            self._write(lambda bag: bag.flush())

    def is_recorded(self, topic: str) -> bool:
        """Whether a topic is of the fleet, or of no namespace: `/diagnostics`, `/rosout`."""
        return topic.startswith(self.prefix) or topic.count('/') == 1

    def offered_qos(self, topic: str) -> QoSProfile:
        """The strictest profile that is compatible with all publishers of a topic."""
        offers = [info.qos_profile for info in self.node.get_publishers_info_by_topic(topic)]
        reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offers)
        latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offers)
        return QoSProfile(
            depth=_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE)

    def record(self, topic: str, type_name: str, qos: QoSProfile) -> None:
        """Subscribe to a topic; one whose type is not installed is logged and left out.

        Args:
            topic: its full name.
            type_name: `package/msg/Type`.
            qos: reliability and durability of the subscription.
        """
        self.known.add(topic)
        try:
            package, _, name = type_name.split('/')
            msg_type: Any = getattr(import_module(f'{package}.msg'), name)
            text = definition(type_name)
        except (ImportError, AttributeError, ValueError, OSError, PackageNotFoundError) as error:
            self.node.get_logger().warning(f'{topic} is not recorded: {type_name}: {error}')
            return
        self._write(lambda bag: bag.open(topic, type_name, text))

        def on_message(data: bytes, info: Mapping[str, int]) -> None:
            if self.clock is not None:
                return self.add_simulated(topic, data, self.clock())
            now = time.time_ns()
            self._write(lambda bag: bag.add(topic, data, info['received_timestamp'] or now,
                                            info['source_timestamp'] or now))

        self.node.create_subscription(
            msg_type, topic, on_message, QoSProfile(
                depth=_DEPTH, reliability=qos.reliability, durability=qos.durability), raw=True)

    def add_simulated(self, topic: str, data: bytes, now: int) -> None:
        """Write a message received at simulated time `now` [ns]; while that is 0, hold it."""
        self.held.append((topic, data))
        if now or len(self.held) > _MOST_HELD:
            held, self.held = self.held, []
            for each in held:
                self._write(lambda bag, each=each: bag.add(*each, now, now))  # type: ignore[misc]

    def _write(self, write: Callable[[Bag], None]) -> None:
        """Write to the file; the first error ends the recording."""
        if self.bag is None:
            return
        try:
            write(self.bag)
        except OSError as error:
            self.node.get_logger().error(f'recording into {self.path} ends: {error}')
            with suppress(OSError):  # closing writes once more
                self.bag.file.close()
            self.bag = None
