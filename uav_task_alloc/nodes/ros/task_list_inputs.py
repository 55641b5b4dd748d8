# SPDX-License-Identifier: Apache-2.0
"""Subscriptions to the task lists of a bridge's UAVs; valid lists wait until they may be flown."""
from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from rclpy.subscription import Subscription
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.nodes.conversions.messages import LATCHED
from uav_task_alloc.nodes.ros.leveled_log import LeveledLog
from uav_task_alloc.nodes.ros.topic_names import TASK_LIST, check_topic


class TaskListInputs:
    """The topics `<uav_id>/task_list`, and the newest valid list of each UAV.

    Args:
        node: which subscribes.
        log: of refused lists.
        convert: makes the list of a message for a UAV; raises InvalidValue.
        on_change: called after each message.
    """

    def __init__(self, node: Node, log: LeveledLog,
                 convert: Callable[[m.TaskList, str], TaskList],
                 on_change: Callable[[], None]) -> None:
        self._node, self._log = node, log
        self._convert, self._on_change = convert, on_change
        self.known: set[str] = set()  # UAVs
        self.pending: dict[str, TaskList] = {}
        self._subscriptions: dict[str, Subscription[m.TaskList]] = {}
        self._kept_back: set[str] = set()  # UAVs whose waiting list may be of another fleet

    def subscribe(self, uav_id: str) -> None:
        """Subscribe to the lists of a UAV, once; an id that is too long for a topic is logged.

        Args:
            uav_id: a ROS name.
        """
        if uav_id in self.known:
            return
        self.known.add(uav_id)
        try:
            check_topic(self._node, TASK_LIST, uav_id)
        except InvalidValue as error:
            self._log.write('error', f'it gets no task lists: {error}')
            return
        self._listen(uav_id)

    def _listen(self, uav_id: str) -> None:
        """Subscribe to the lists of a UAV; the latest of each publisher follows."""

        def on_message(msg: m.TaskList) -> None:
            self.on_list(uav_id, msg)

        self._subscriptions[uav_id] = self._node.create_subscription(
            m.TaskList, check_topic(self._node, TASK_LIST, uav_id), on_message, LATCHED)

    def on_list(self, uav_id: str, msg: m.TaskList) -> None:
        """Take the newest list of a UAV; an invalid one is logged and changes nothing."""
        try:
            self.pending[uav_id] = self._convert(msg, uav_id)
        except InvalidValue as error:
            self._log.write('warning', f'{uav_id}/task_list: {error}: ignored')
        self._on_change()

    def keep_back(self, shared: Callable[[str], object]) -> None:
        """Let lists of UAVs that another node reports, too, wait; drop them once it does not.

        They may be of another fleet, or of a recording that was played: who still publishes a
        list sends it again.

        Args:
            shared: whether another node reports a UAV, too.
        """
        waiting = {uav_id for uav_id in self.pending if shared(uav_id)}
        for uav_id in self._kept_back - waiting:
            del self.pending[uav_id]
            self._node.destroy_subscription(self._subscriptions[uav_id])
            self._listen(uav_id)
        self._kept_back = waiting

    def take(self) -> dict[str, TaskList]:
        """Return the waiting lists by UAV that are not kept back, and forget them."""
        taken = {uav_id: each for uav_id, each in self.pending.items()
                 if uav_id not in self._kept_back}
        self.pending = {uav_id: self.pending[uav_id] for uav_id in self._kept_back}
        return taken
