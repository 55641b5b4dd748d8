# SPDX-License-Identifier: Apache-2.0
"""Finds other nodes that report the UAVs of a bridge: that of a second fleet, or a recording."""
from __future__ import annotations

import math
import threading
import time
from collections import Counter, deque

from rclpy.node import Node
from rclpy.subscription import Subscription
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.errors import first_of
from uav_task_alloc.nodes.conversions.messages import STATES

_TOPIC = 'uav_states'
_SEARCH_PERIOD = 0.25  # [s]
# [s] from the start in which other nodes are found: Fast DDS announces a node each 3 s, or 0.2 s
SETTLING_TIME = 8.0
_RECENT = 5.0  # [s] since the last report of another node
_SEVERAL = 3  # reports of a UAV by another node after which one in flight holds
_PLAYER = 'rosbag2_player'  # the node of `ros2 bag play`
_RECORDED = 'a recording that is played reports'
_OWN_REPORTS = 500  # of the bridge, to tell them from others; its queue is shorter


class OtherBridges:
    """Finds whether another node reports UAVs of the bridge, too.

    It would fly another vehicle along the same lists: two fleets in one ROS system without
    namespaces. A recording that is played has the same effect: the allocator believes its states,
    and its lists are received, too. States are subscribed to only while another node publishes
    some.

    Arguments of methods:
        now: steady time [s].

    Args:
        node: the bridge, which publishes `uav_states`.
    """

    def __init__(self, node: Node) -> None:
        self._node, self._began, self._searched = node, time.monotonic(), -math.inf
        self._subscription: Subscription[m.UavState] | None = None
        self._lock = threading.Lock()  # of the next three: the bridge publishes in another thread
        self._own: deque[tuple[str, int, int]] = deque(maxlen=_OWN_REPORTS)  # UAV, stamp
        self._ids: set[str] = set()  # of UAVs that the bridge has reported
        # how often in a row, and [s] steady time of the last, by UAV
        self._reported: dict[str, tuple[int, float]] = {}
        self._publishers: tuple[str, ...] = ()  # names of all nodes that publish states
        self._recording = False  # all of them but the bridge play a recording

    def note_own(self, msg: m.UavState) -> None:
        """Remember a state of the bridge.

        Args:
            msg: about to be published.
        """
        with self._lock:
            self._ids.add(msg.uav_id)
            self._own.append(_key(msg))

    def search(self, now: float) -> None:
        """Subscribe while another node publishes states."""
        if now - self._searched < _SEARCH_PERIOD:
            return
        self._searched, node = now, self._node
        topic = node.resolve_topic_name(_TOPIC)
        others = node.count_publishers(topic) > 1
        found = node.get_publishers_info_by_topic(topic) if others else []
        self._publishers = tuple(sorted(
            f'{each.node_namespace.rstrip("/")}/{each.node_name}' for each in found))
        nodes = Counter(each.node_name for each in found) - Counter([node.get_name()])
        self._recording = nodes.keys() == {_PLAYER}
        if others and self._subscription is None:
            self._subscription = node.create_subscription(
                m.UavState, _TOPIC, self._on_state, STATES)
        elif not others and self._subscription is not None:
            node.destroy_subscription(self._subscription)
            self._subscription = None

    def settling(self, now: float) -> str:
        """Return what a first take-off waits for: others to be found; '' once they would be."""
        return '' if now - self._began >= SETTLING_TIME else 'the search for other bridges'

    def grounded(self, now: float) -> str:
        """Return what a take-off waits for; '' where it waits for nothing."""
        if not self._shared(now):
            return ''
        return (f'ids of its own: {_RECORDED} UAVs of this bridge, too' if self._recording else
                'ids of its own: another node reports UAVs of this bridge, too')

    def shared(self, uav_id: str, now: float) -> str:
        """Return that another node reports a UAV, too, and which nodes; '' where none does.

        Args:
            uav_id: of the bridge.
            now: see the class.
        """
        with self._lock:
            count, at = self._reported.get(uav_id, (0, 0.0))
        if count < _SEVERAL or now - at > _RECENT:
            return ''
        source = _RECORDED if self._recording else 'another node reports'
        return f'{source} {uav_id}, too{self._names()}'

    def warning(self, now: float) -> str:
        """Return which UAVs another node reports, too; '' where it reports none."""
        shared = self._shared(now)
        if shared and self._recording:
            return (f'{first_of(shared)}: {_RECORDED} UAVs of these ids, too{self._names()}, as '
                    'if they were elsewhere, and perhaps lists for them; none takes off, and '
                    'those in flight hold: expected the end of `ros2 bag play`, or a '
                    'ROS_DOMAIN_ID of its own for it')
        return (f'{first_of(shared)}: another node reports UAVs of these ids, too{self._names()}, '
                'so that two vehicles may fly one list; none takes off, and those in flight hold: '
                'expected a namespace or ROS_DOMAIN_ID for each fleet, or another uav_id_pattern'
                ) if shared else ''

    def _names(self) -> str:
        """The nodes that publish states, where they are known."""
        names = self._publishers
        return f' (states are published by {" and ".join(names)})' if names else ''

    def _on_state(self, msg: m.UavState) -> None:
        now = time.monotonic()
        with self._lock:
            if msg.uav_id in self._ids and _key(msg) not in self._own:
                count, at = self._reported.get(msg.uav_id, (0, -math.inf))
                self._reported[msg.uav_id] = (count if now - at <= _RECENT else 0) + 1, now

    def _shared(self, now: float) -> list[str]:
        """The UAVs that another node has reported lately."""
        with self._lock:
            return sorted(uav_id for uav_id, (_, at) in self._reported.items()
                          if now - at <= _RECENT)


def _key(msg: m.UavState) -> tuple[str, int, int]:
    return msg.uav_id, msg.header.stamp.sec, msg.header.stamp.nanosec
