# SPDX-License-Identifier: Apache-2.0
"""Finds other nodes that fly the task lists of a bridge's UAVs, too, as of a second fleet."""
from __future__ import annotations

import math
from collections.abc import Iterable

from rclpy.node import Node

from uav_task_alloc.errors import first_of
from uav_task_alloc.nodes.ros.topic_names import TASK_LIST

_UNKNOWN = '_NODE_NAME_UNKNOWN_'  # of an endpoint that was found before its node
_PERIOD = 5.0  # [s] between two searches
_PATIENCE = 30.0  # [s] that a bridge that was killed may still be found


class OtherBridges:
    """Warns where another node reports a UAV of the bridge, and takes its list.

    It would fly another vehicle along the same way: two fleets in one ROS system without
    namespaces.

    Args:
        node: the bridge, which publishes `uav_states`.
        patience: [s] that another node has to be there before it is reported.
    """

    def __init__(self, node: Node, patience: float = _PATIENCE) -> None:
        self._node, self.patience = node, patience
        self._searched = -math.inf  # [s] steady time
        self._since: dict[str, float] = {}  # [s] steady time, by UAV

    def warning(self, uav_ids: Iterable[str], now: float) -> str:
        """Return which UAVs another node flies, too.

        Args:
            uav_ids: whose lists the bridge has subscribed to.
            now: steady time [s].

        Returns:
            '' where none is, or not for long.
        """
        if now - self._searched >= _PERIOD:
            self._searched = now
            self._since = {uav_id: self._since.get(uav_id, now)
                           for uav_id in self._shared(uav_ids)}
        shared = [uav_id for uav_id, since in self._since.items() if now - since >= self.patience]
        return (f'{first_of(shared)}: another node reports and flies UAVs of these ids, too, so '
                'that two vehicles may fly one list: expected a namespace or ROS_DOMAIN_ID for '
                'each fleet, or another uav_id_pattern') if shared else ''

    def _shared(self, uav_ids: Iterable[str]) -> list[str]:
        """The UAVs whose lists several publishers of `uav_states` subscribe to."""
        node = self._node
        if node.count_publishers(node.resolve_topic_name('uav_states')) < 2:
            return []
        reporters = {(each.node_namespace, each.node_name)
                     for each in node.get_publishers_info_by_topic('uav_states')
                     if each.node_name != _UNKNOWN}
        return [uav_id for uav_id in uav_ids if sum(
            (each.node_namespace, each.node_name) in reporters
            for each in node.get_subscriptions_info_by_topic(TASK_LIST.format(uav_id))) > 1]
