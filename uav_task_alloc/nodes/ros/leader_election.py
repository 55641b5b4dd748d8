# SPDX-License-Identifier: Apache-2.0
"""Hears and tells on /diagnostics which allocators there are for this fleet."""
from __future__ import annotations

import time
import uuid

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from uav_task_alloc.allocator.leader import AllocatorInstance, Leader, Role, heard, told
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.nodes.ros.batched_subscription import subscribe_batched

HEALTH = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)  # nothing of the dead


class LeaderElection:
    """The role of this allocator, by what the others say and by who publishes `allocation`."""

    def __init__(self, node: Node, lists: PublishedLists, refused: str = '') -> None:
        """refused: why it must not lead, '' where it may."""
        self.node, self.topic = node, node.resolve_topic_name('allocation')
        now = time.monotonic()
        self.leader = Leader(AllocatorInstance(time.time_ns(), uuid.uuid4().hex[:12],
                                      node.get_fully_qualified_name()), now, bool(lists.lists))
        self.lists = lists
        if refused:
            self.leader.refuse(refused, now)
        subscribe_batched(node, DiagnosticArray, '/diagnostics', self.on_health, HEALTH)

    def on_health(self, msg: DiagnosticArray) -> None:
        """A leader counts where somebody else publishes `allocation`, not in a replayed log."""
        for status in msg.status:
            other = self.read(status)
            if other is not None and self.others() > 0:
                self.leader.hear(*other, time.monotonic())

    def read(self, status: DiagnosticStatus) -> tuple[AllocatorInstance, Role] | None:
        """What another allocator of this fleet says of itself."""
        values = {pair.key: pair.value for pair in status.values}
        try:
            return heard(status.name.partition(':')[0], values, self.topic)
        except InvalidValue as error:
            self.node.get_logger().warning(f'/diagnostics: {error}: ignored', once=True)
            return None

    def others(self) -> int:
        """How many other publishers of `allocation` are known."""
        mine = self.leader.role is not Role.PASSIVE
        return self.node.count_publishers(self.topic) - mine

    def role(self) -> Role:
        """What this allocator is to do now."""
        now, before = time.monotonic(), self.leader.role
        if before is Role.STARTING or (before is Role.LEADING and self.lists.strange):
            self.leader.tick(self.others(), now, self.lists.strange)
            if self.leader.role is not before and self.leader.silent_others:
                self.node.get_logger().warning(
                    f'{self.topic} has another publisher, which does not say what it is: '
                    'a replay, or an older allocator? Only one may lead a fleet')
        return self.leader.role

    def trouble(self) -> str:
        """Why this allocator publishes nothing, '' where it does."""
        return self.leader.trouble(time.monotonic())

    def facts(self) -> dict[str, object]:
        """What the others have to know."""
        return told(self.leader.me, self.leader.role, self.topic)
