# SPDX-License-Identifier: Apache-2.0
"""Finds the other allocators of a fleet on /diagnostics, and decides which one leads."""
from __future__ import annotations

import time
import uuid

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from uav_task_alloc.allocator import leader
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.nodes.ros.batched_subscription import subscribe_batched

# volatile: nothing of allocators that have exited
_DIAGNOSTICS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)


class LeaderElection:
    """The role of this allocator, from diagnostics and the publishers of `allocation`.

    Args:
        node: the allocator's.
        lists: what was published to the UAVs, also in the previous run.
        refused: why it must not lead; '' where it may.
    """

    def __init__(self, node: Node, lists: PublishedLists, refused: str = '') -> None:
        self.node, self.topic = node, node.resolve_topic_name('allocation')
        now = time.monotonic()
        instance = leader.AllocatorInstance(time.time_ns(), uuid.uuid4().hex[:12],
                                            node.get_fully_qualified_name())
        self.leader = leader.Leader(instance, now, bool(lists.lists))
        self.lists = lists
        if refused:
            self.leader.refuse(refused, now)
        subscribe_batched(node, DiagnosticArray, '/diagnostics', self.on_diagnostics, _DIAGNOSTICS)

    def on_diagnostics(self, msg: DiagnosticArray) -> None:
        """Take the reports of others while `allocation` has another publisher.

        Without one the diagnostics are those of a replayed log.
        """
        for status in msg.status:
            report = self._read(status)
            if report is not None and self._other_publishers() > 0:
                self.leader.update(*report, time.monotonic())

    def _read(self, status: DiagnosticStatus) -> tuple[leader.AllocatorInstance,
                                                       leader.Role] | None:
        """What another allocator of this fleet reports; None for any other status."""
        values = {pair.key: pair.value for pair in status.values}
        try:
            return leader.parse_status(status.name.partition(':')[0], values, self.topic)
        except InvalidValue as error:
            self.node.get_logger().warning(f'/diagnostics: {error}: ignored', once=True)
            return None

    def _other_publishers(self) -> int:
        """How many other publishers of `allocation` were discovered."""
        own = self.leader.role is not leader.Role.PASSIVE
        return self.node.count_publishers(self.topic) - own

    def role(self) -> leader.Role:
        """The role of this allocator now."""
        now, before = time.monotonic(), self.leader.reported
        if before in (leader.Role.STARTING, leader.Role.RESTARTING) or (
                before is leader.Role.LEADING and self.lists.foreign):
            self.leader.tick(self._other_publishers(), now, self.lists.foreign)
            if self.leader.reported is not before and self.leader.silent_others:
                self.node.get_logger().warning(
                    f'{self.topic} has another publisher, which does not report what it is: '
                    'a replay, or an older allocator? Only one may lead a fleet')
        return self.leader.role

    def trouble(self) -> str:
        """Why this allocator publishes nothing; '' where it does."""
        return self.leader.error(time.monotonic())

    def facts(self) -> dict[str, object]:
        """What other allocators have to know, for /diagnostics."""
        return leader.status_values(self.leader.me, self.leader.reported, self.topic)
