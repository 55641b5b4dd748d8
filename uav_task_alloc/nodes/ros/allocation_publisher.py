# SPDX-License-Identifier: Apache-2.0
"""Publishes lists, statuses and the allocation in time slices, so that callbacks are not delayed.
"""
from __future__ import annotations

import time
from collections.abc import Iterable

from rclpy.node import Node
from rclpy.publisher import Publisher
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import Allocation, Outbox, TaskRecord
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.allocator.status import TaskStatus, status_of, status_of_work
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.nodes.conversions import allocation_messages
from uav_task_alloc.nodes.conversions.messages import LATCHED
from uav_task_alloc.nodes.ros.topic_names import TASK_LIST, check_topic

_SLICE = 0.02  # [s] of lists per call
_PAUSE_FACTOR = 5.0  # times the duration of the large messages: a sixth of a core at most
_StatusSource = TaskRecord | TaskStatus | tuple[str, float]  # what a status is made from


class AllocationPublisher:
    """A queue that holds the newest message of each kind; `publish_some` publishes from it.

    Publishes:
        `<uav_id>/task_list` (TaskList), `task_statuses` (TaskStatusArray),
        `allocation` (Allocation); all latched.

    Args:
        node: publishes, and logs ids that are too long for a topic.
        world: statuses and lists are read from it.

    Arguments of methods:
        uav_id, uav_ids: of UAVs.
        outbox: what the allocator wants published.
    """

    def __init__(self, node: Node, world: World) -> None:
        self.node, self.world = node, world
        self.publishers: dict[str, Publisher[m.TaskList]] = {}
        self.unpublishable: set[str] = set()  # UAVs whose ids are too long for a topic name
        self.statuses = node.create_publisher(m.TaskStatusArray, 'task_statuses', LATCHED)
        self.allocation = node.create_publisher(m.Allocation, 'allocation', LATCHED)
        self.pending_lists: dict[str, UavList] = {}
        self.statuses_pending = False
        self.pending_allocation: Allocation | None = None
        self.pause_until = 0.0  # [s] steady clock
        # messages as converted last, with their sources: most have not changed
        self._list_messages: dict[str, tuple[UavList, m.TaskList]] = {}
        self._status_messages: dict[str, tuple[_StatusSource, float, m.TaskStatus]] = {}

    def prepare(self, uav_ids: Iterable[str]) -> None:
        """Create the publishers of these UAVs, so that subscribers are matched early."""
        for uav_id in uav_ids:
            self._publisher(uav_id)

    def close(self) -> None:
        """Destroy all publishers; late subscribers receive nothing of what was latched."""
        for publisher in self.publishers.values():
            self.node.destroy_publisher(publisher)
        self.node.destroy_publisher(self.statuses)
        self.node.destroy_publisher(self.allocation)

    def all_subscribed(self) -> bool:
        """Whether every list topic has a subscriber."""
        return all(each.get_subscription_count() for each in self.publishers.values())

    def enqueue(self, outbox: Outbox) -> None:
        """Queue everything of an outbox; it replaces what is queued already."""
        for uav_id in outbox.forgotten:
            self.remove(uav_id)
        self.pending_lists.update(outbox.lists)
        self.statuses_pending |= outbox.statuses
        self.pending_allocation = outbox.allocation or self.pending_allocation

    def remove(self, uav_id: str) -> None:
        """Drop the list and the topic of a UAV."""
        self.pending_lists.pop(uav_id, None)
        self._list_messages.pop(uav_id, None)
        if uav_id in self.publishers:
            self.node.destroy_publisher(self.publishers.pop(uav_id))

    def publish_some(self, stamp: float) -> bool:
        """Publish queued lists for one time slice, then what is due of the rest.

        Args:
            stamp: the published clock [s].

        Returns:
            Whether lists are still queued.
        """
        end = time.monotonic() + _SLICE
        while self.pending_lists and time.monotonic() < end:
            uav_id = next(iter(self.pending_lists))
            uav_list = self.pending_lists.pop(uav_id)
            if publisher := self._publisher(uav_id):
                publisher.publish(self._list_message(uav_list))
        if time.monotonic() >= self.pause_until:
            self._publish_large(stamp)
        return bool(self.pending_lists)

    def _publish_large(self, stamp: float) -> None:
        """Publish all statuses, and the allocation once all its lists are published."""
        start = time.monotonic()
        if self.statuses_pending:
            self.statuses_pending = False
            self.statuses.publish(
                allocation_messages.from_statuses(self._statuses(), stamp))
        if self.pending_allocation is not None and not self.pending_lists:
            plan, self.pending_allocation = self.pending_allocation, None
            lists = [self._list_message(uav_list) for uav_list in plan.lists]
            self.allocation.publish(
                allocation_messages.from_allocation(plan, lists, self._statuses()))
        now = time.monotonic()
        self.pause_until = now + _PAUSE_FACTOR * (now - start)

    def _publisher(self, uav_id: str) -> Publisher[m.TaskList] | None:
        """The publisher of a UAV; None, logged once, where its topic name is too long."""
        if uav_id in self.unpublishable:
            return None
        if uav_id not in self.publishers:
            try:
                topic = check_topic(self.node, TASK_LIST, uav_id)
            except InvalidValue as error:
                self.unpublishable.add(uav_id)
                self.node.get_logger().error(f'its task list is not published: {error}')
                return None
            self.publishers[uav_id] = self.node.create_publisher(m.TaskList, topic, LATCHED)
        return self.publishers[uav_id]

    def _list_message(self, uav_list: UavList) -> m.TaskList:
        cached = self._list_messages.get(uav_list.uav)
        if cached is None or cached[0] is not uav_list:
            cached = uav_list, allocation_messages.from_list(uav_list)
            self._list_messages[uav_list.uav] = cached
        return cached[1]

    def _statuses(self) -> list[m.TaskStatus]:
        """A message for every task; converts only those that have changed. O(tasks)."""
        cache, self._status_messages = self._status_messages, {}
        expected, works = self.world.deadlines.expected, self.world.works
        sources: dict[str, _StatusSource] = {  # the whole before its pieces
            **{task_id: status_of_work(works, work, expected)
               for task_id, work in works.records.items()},
            **self.world.task_records(), **self.world.tasks.rejected}
        for task_id, source in sources.items():
            start, cached = expected.get(task_id, 0.0), cache.get(task_id)
            if cached is None or not _same(cached[0], source) or cached[1] != start:
                status = source if isinstance(source, TaskStatus) else status_of(
                    task_id, source, start)
                cached = source, start, allocation_messages.from_task_status(status)
            self._status_messages[task_id] = cached
        return [message for _, _, message in self._status_messages.values()]


def _same(one: _StatusSource, other: _StatusSource) -> bool:
    """Whether two sources make the same status; records are compared by identity, in O(1)."""
    return one is other or (isinstance(other, TaskStatus) and one == other)
