# SPDX-License-Identifier: Apache-2.0
"""Publishes simulated time on /clock, by which nodes with use_sim_time live."""
from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from uav_task_alloc.nodes.conversions.messages import to_stamp
from uav_task_alloc.nodes.ros.clock_watch import steady_clock

_TOPIC = '/clock'
_PERIOD = 0.02  # [s] of the steady clock


class ClockPublisher:
    """Publishes /clock 50 times a second; not while another node publishes it, too.

    Args:
        node: that publishes.
        now: gives simulated time [unix s].
        yields: whether another publisher of /clock is left alone; a log line says so.
    """

    def __init__(self, node: Node, now: Callable[[], float], yields: bool = False) -> None:
        self.node, self.now, self.yields = node, now, yields
        self.silent = False  # another one publishes
        self.publisher = node.create_publisher(
            Clock, _TOPIC, QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE))
        node.create_timer(_PERIOD, self.on_timer, clock=steady_clock())

    def on_timer(self) -> None:
        """Publish the present time."""
        others = self.yields and self.node.count_publishers(_TOPIC) > 1
        if others and not self.silent:
            self.node.get_logger().warning('another node publishes /clock: this one does not')
        self.silent = others
        if not others:
            self.publisher.publish(Clock(clock=to_stamp(self.now())))
