# SPDX-License-Identifier: Apache-2.0
"""Publishes a node's ENU origin on `fleet_origin` and compares it with those of other nodes."""
from __future__ import annotations

import math
import time
from collections.abc import Callable

from rclpy.node import Node
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.nodes.conversions.messages import LATCHED

_TOPIC = 'fleet_origin'
_TOLERANCE = 0.01  # [m] between origins of the same place
MOST_ORIGINS = 10  # differing origins that are remembered
ORIGIN_TIMEOUT = 3.0  # [s] for the origin of a node that was discovered but has not published


class OriginReports:
    """Compares the origins of other nodes with one's own; no ROS in it."""

    def __init__(self, own: Origin) -> None:
        self.own = own
        self._differing: list[Origin] = []
        self._previous: list[Origin] = []  # before a node left, until all have published again
        self._republished_by = -math.inf  # [s]

    def add(self, origin: Origin) -> None:
        """Take the origin that a node, possibly this one, has published."""
        differs = self._distance(origin) > _TOLERANCE
        if differs and origin not in self._differing and len(self._differing) < MOST_ORIGINS:
            self._differing.append(origin)

    def on_node_left(self, now: float) -> None:
        """Start again: the nodes that remain publish their origins within ORIGIN_TIMEOUT."""
        self._previous = self._differing or self._previous
        self._differing, self._republished_by = [], now + ORIGIN_TIMEOUT

    def conflict(self, now: float) -> str:
        """Why this node must not fly; '' where all origins agree.

        Args:
            now: steady clock [s].
        """
        differing = self._differing or (self._previous if now < self._republished_by else [])
        if not differing:
            return ''
        return (f'fleet_origin of another node is {_text(differing[0])}, '
                f'{self._distance(differing[0]):.6g} m from origin.* = {_text(self.own)} of this '
                'one: expected the same')

    def _distance(self, other: Origin) -> float:
        return math.hypot(*to_enu(self.own, other.latitude, other.longitude,
                                  other.altitude_amsl))


def _text(origin: Origin) -> str:
    return f'({origin.latitude:.7f}, {origin.longitude:.7f}, {origin.altitude_amsl:g} m)'


class OriginCheck:
    """The topic `fleet_origin` of one node; `check` is to be called about once a second.

    Args:
        node: which publishes and subscribes.
        origin: its own.
        log_refusal: called with the reason why a received origin is invalid.
    """

    def __init__(self, node: Node, origin: Origin, log_refusal: Callable[[str], object]) -> None:
        self._node, self._log_refusal = node, log_refusal
        self._reports = OriginReports(origin)
        node.get_logger().info(f'origin of the ENU frame: {_text(origin)}')
        self._known_publishers: set[bytes] = set()  # endpoint ids
        self._received, self._asked_at = 0, 0.0  # messages since the last subscription, at [s]
        self._waiting_since = time.monotonic()  # for origins of the publishers
        self._publisher = node.create_publisher(m.FleetOrigin, _TOPIC, LATCHED)
        self._publisher.publish(m.FleetOrigin(
            latitude=origin.latitude, longitude=origin.longitude,
            altitude_amsl=origin.altitude_amsl))
        self._subscribe()

    def conflict(self) -> str:
        """Why this node must not fly; '' where all origins agree."""
        return self._reports.conflict(time.monotonic())

    def settled(self) -> bool:
        """Whether every publisher's origin was received, or ORIGIN_TIMEOUT is over."""
        now, publishers = time.monotonic(), self._publishers()
        if publishers - self._known_publishers:
            self._known_publishers |= publishers
            self._waiting_since = now
        return (self._received >= len(publishers)
                or now > self._waiting_since + ORIGIN_TIMEOUT)

    def check(self) -> None:
        """Subscribe again after a node has left, or while an origin has not been received.

        A latched origin outlives its publisher; and one may be lost while nodes are discovered.
        """
        now, publishers = time.monotonic(), self._publishers()
        if publishers - self._known_publishers:
            self._waiting_since = now
        left = self._known_publishers - publishers
        if left:
            self._reports.on_node_left(now)
            self._waiting_since = now
        if left or (self._received < len(publishers)
                    and now > max(self._waiting_since, self._asked_at) + ORIGIN_TIMEOUT):
            self._node.destroy_subscription(self._subscription)
            self._subscribe()
        self._known_publishers = publishers

    def _subscribe(self) -> None:
        self._received, self._asked_at = 0, time.monotonic()
        self._subscription = self._node.create_subscription(
            m.FleetOrigin, _TOPIC, self._on_origin, LATCHED)

    def _on_origin(self, msg: m.FleetOrigin) -> None:
        self._received += 1
        try:
            self._reports.add(Origin(msg.latitude, msg.longitude, msg.altitude_amsl))
        except InvalidValue as error:
            self._log_refusal(str(error))

    def _publishers(self) -> set[bytes]:
        return {bytes(info.endpoint_gid)
                for info in self._node.get_publishers_info_by_topic(_TOPIC)}
