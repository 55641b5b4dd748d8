# SPDX-License-Identifier: Apache-2.0
"""Finds other nodes that report the UAVs of a bridge, as the bridge of a second fleet."""
from __future__ import annotations

import math
import threading
import time
from collections import deque

from rclpy.node import Node
from rclpy.subscription import Subscription
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.errors import first_of
from uav_task_alloc.nodes.conversions.messages import STATES

_TOPIC = 'uav_states'
_SEARCH_PERIOD = 1.0  # [s]
# [s] from the start in which other nodes are found: Fast DDS announces a node each 3 s, or 0.2 s
SETTLING_TIME = 8.0
_RECENT = 5.0  # [s] since the last report of another node
_OWN_REPORTS = 500  # of the bridge, to tell them from others; its queue is shorter


class OtherBridges:
    """Finds whether another node reports UAVs of the bridge, too.

    It would fly another vehicle along the same lists: two fleets in one ROS system without
    namespaces. States are subscribed to only while another node publishes some.

    Args:
        node: the bridge, which publishes `uav_states`.
    """

    def __init__(self, node: Node) -> None:
        self._node, self._began, self._searched = node, time.monotonic(), -math.inf
        self._subscription: Subscription[m.UavState] | None = None
        self._lock = threading.Lock()  # of the next three: the bridge publishes in another thread
        self._own: deque[tuple[str, int, int]] = deque(maxlen=_OWN_REPORTS)  # UAV, stamp
        self._ids: set[str] = set()  # of UAVs that the bridge has reported
        self._reported: dict[str, float] = {}  # [s] steady time, by UAV

    def note_own(self, msg: m.UavState) -> None:
        """Remember a state of the bridge.

        Args:
            msg: about to be published.
        """
        with self._lock:
            self._ids.add(msg.uav_id)
            self._own.append(_key(msg))

    def search(self, now: float) -> None:
        """Subscribe while another node publishes states; `now` is the steady time [s]."""
        if now - self._searched < _SEARCH_PERIOD:
            return
        self._searched, node = now, self._node
        others = node.count_publishers(node.resolve_topic_name(_TOPIC)) > 1
        if others and self._subscription is None:
            self._subscription = node.create_subscription(
                m.UavState, _TOPIC, self._on_state, STATES)
        elif not others and self._subscription is not None:
            node.destroy_subscription(self._subscription)
            self._subscription = None

    def settling(self, now: float) -> str:
        """Return what a first take-off waits for: others to be found; '' once they would be.

        Args:
            now: steady time [s].
        """
        return '' if now - self._began >= SETTLING_TIME else 'the search for other bridges'

    def grounded(self, now: float) -> str:
        """Return what a take-off waits for; '' where it waits for nothing.

        Args:
            now: steady time [s].
        """
        return ('ids of its own: another node reports UAVs of this bridge, too'
                if self._shared(now) else '')

    def warning(self, now: float) -> str:
        """Return which UAVs another node reports, too; '' where it reports none.

        Args:
            now: steady time [s].
        """
        shared = self._shared(now)
        return (f'{first_of(shared)}: another node reports UAVs of these ids, too, so that two '
                'vehicles may fly one list; none takes off: expected a namespace or '
                'ROS_DOMAIN_ID for each fleet, or another uav_id_pattern') if shared else ''

    def _on_state(self, msg: m.UavState) -> None:
        with self._lock:
            if msg.uav_id in self._ids and _key(msg) not in self._own:
                self._reported[msg.uav_id] = time.monotonic()

    def _shared(self, now: float) -> list[str]:
        """The UAVs that another node has reported lately."""
        with self._lock:
            return sorted(uav_id for uav_id, at in self._reported.items() if now - at <= _RECENT)


def _key(msg: m.UavState) -> tuple[str, int, int]:
    return msg.uav_id, msg.header.stamp.sec, msg.header.stamp.nanosec
