# SPDX-License-Identifier: Apache-2.0
"""Tells the origin of a node on `fleet_origin`; those of all nodes of a fleet must agree."""
from __future__ import annotations

import math
import time
from collections.abc import Callable

from rclpy.node import Node
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.nodes.conversions.messages import LATCHED

TOPIC = 'fleet_origin'
_SAME = 0.01  # [m] that origins of the same place may differ
MOST = 10  # differing origins that are remembered
PATIENCE = 3.0  # [s] for the origin of a node that is known but was not heard


class OriginReports:
    """Compares the origins of other nodes with one's own; no ROS in it."""

    def __init__(self, own: Origin) -> None:
        self.own = own
        self._differing: list[Origin] = []
        self._before: list[Origin] = []  # heard before somebody left, until all are heard again
        self._again_until = -math.inf  # [s]

    def hear(self, other: Origin) -> None:
        """Another node, or oneself, has told its origin."""
        apart = self._apart(other)
        if apart > _SAME and other not in self._differing and len(self._differing) < MOST:
            self._differing.append(other)

    def left(self, now: float) -> None:
        """Some node is gone: who is still there tells its origin again within PATIENCE."""
        self._before = self._differing or self._before
        self._differing, self._again_until = [], now + PATIENCE

    def conflict(self, now: float) -> str:
        """Why this node must not fly; '' where all agree."""
        found = self._differing or (self._before if now < self._again_until else [])
        if not found:
            return ''
        return (f'fleet_origin of another node is {_shown(found[0])}, '
                f'{self._apart(found[0]):.6g} m from origin.* = {_shown(self.own)} of this one: '
                'expected the same')

    def _apart(self, other: Origin) -> float:
        return math.hypot(*to_enu(self.own, other.latitude, other.longitude,
                                  other.altitude_amsl))


def _shown(origin: Origin) -> str:
    return f'({origin.latitude:.7f}, {origin.longitude:.7f}, {origin.altitude_amsl:g} m)'


class OriginCheck:
    """The topic of one node; `check` is to be called about once a second."""

    def __init__(self, node: Node, origin: Origin, complain: Callable[[str], object]) -> None:
        self._node, self._complain = node, complain
        self._origins = OriginReports(origin)
        self._others: set[bytes] = set()  # who publishes, as seen last
        self._heard = 0  # messages since the last subscription
        self._asked = time.monotonic()  # since when they are waited for
        self._publisher = node.create_publisher(m.FleetOrigin, TOPIC, LATCHED)
        self._publisher.publish(m.FleetOrigin(
            latitude=origin.latitude, longitude=origin.longitude,
            altitude_amsl=origin.altitude_amsl))
        self._subscribe()

    def conflict(self) -> str:
        """Why this node must not fly; '' where all agree."""
        return self._origins.conflict(time.monotonic())

    def settled(self) -> bool:
        """Whether all who publish an origin were heard, or waited for long enough."""
        now, there = time.monotonic(), self._publishers()
        if there - self._others:
            self._others |= there
            self._asked = now
        return self._heard >= len(there) or now > self._asked + PATIENCE

    def check(self) -> None:
        """Where a node is gone, hear the rest again: a latched origin outlives its publisher."""
        there = self._publishers()
        if self._others - there:
            self._node.destroy_subscription(self._subscription)
            self._origins.left(time.monotonic())
            self._heard, self._asked = 0, time.monotonic()
            self._subscribe()
        self._others = there

    def _subscribe(self) -> None:
        self._subscription = self._node.create_subscription(
            m.FleetOrigin, TOPIC, self._on_origin, LATCHED)

    def _on_origin(self, msg: m.FleetOrigin) -> None:
        self._heard += 1
        try:
            self._origins.hear(Origin(msg.latitude, msg.longitude, msg.altitude_amsl))
        except InvalidValue as error:
            self._complain(str(error))

    def _publishers(self) -> set[bytes]:
        return {bytes(each.endpoint_gid)
                for each in self._node.get_publishers_info_by_topic(TOPIC)}
