# SPDX-License-Identifier: Apache-2.0
"""Tells lists, statuses and the allocation: a slice at a time, so that nobody is kept waiting."""
from __future__ import annotations

import time
from collections.abc import Iterable

from rclpy.node import Node
from rclpy.publisher import Publisher
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator.records import Allocation, Outbox, UavList
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.allocator.status import status_of
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.nodes.conversions import allocation_messages as told
from uav_task_alloc.nodes.conversions.messages import LATCHED
from uav_task_alloc.nodes.ros.topic_names import TASK_LIST, check_topic

SLICE = 0.02  # [s] of lists at once
_REST = 5.0  # times as long as a whole picture took none follows: a sixth of a core at most


class AllocationPublisher:
    """What is out of date waits here, the newest of each kind; `tell` publishes some of it."""

    def __init__(self, node: Node, world: World) -> None:
        self.node, self.world = node, world
        self.publishers: dict[str, Publisher] = {}
        self.unnamed: set[str] = set()  # UAVs of a journal that no topic can be named after here
        self.statuses = node.create_publisher(m.TaskStatusArray, 'task_statuses', LATCHED)
        self.allocation = node.create_publisher(m.Allocation, 'allocation', LATCHED)
        self.lists: dict[str, UavList] = {}  # not told yet, as the two below
        self.stale = False
        self.plan: Allocation | None = None
        self.rested = 0.0  # [s] steady clock
        # messages as made last, and what they were made from: most are as they were
        self._lists: dict[str, tuple[UavList, m.TaskList]] = {}
        self._statuses: dict[str, tuple[object, m.TaskStatus]] = {}

    def prepare(self, uav_ids: Iterable[str]) -> None:
        """Lists of these UAVs follow: whoever wants to hear them may come."""
        for uav_id in uav_ids:
            self._publisher(uav_id)

    def close(self) -> None:
        """Publish nothing any more; what was published is not told to later listeners."""
        for made in (*self.publishers.values(), self.statuses, self.allocation):
            self.node.destroy_publisher(made)

    def is_heard(self) -> bool:
        """Nobody is missing who might want to hear the lists that follow."""
        return all(made.get_subscription_count() for made in self.publishers.values())

    def take(self, out: Outbox) -> None:
        """All of this is to be told."""
        for uav_id in out.forgotten:
            self.forget(uav_id)
        self.lists.update(out.lists)
        self.stale |= out.statuses
        self.plan = out.allocation or self.plan

    def forget(self, uav_id: str) -> None:
        """Nobody will hear lists by that id."""
        self.lists.pop(uav_id, None)
        self._lists.pop(uav_id, None)
        if uav_id in self.publishers:
            self.node.destroy_publisher(self.publishers.pop(uav_id))

    def tell(self, stamp: float) -> bool:
        """Lists first, as many as a slice has time for; returns whether some are left."""
        until = time.monotonic() + SLICE
        while self.lists and time.monotonic() < until:
            uav_id = next(iter(self.lists))
            uav_list = self.lists.pop(uav_id)
            if publisher := self._publisher(uav_id):
                publisher.publish(self._list(uav_list))
        if time.monotonic() >= self.rested:
            self._tell_all(stamp)
        return bool(self.lists)

    def _tell_all(self, stamp: float) -> None:
        """The whole picture, and the plan when all its lists are out."""
        began = time.monotonic()
        if self.stale:
            self.stale = False
            self.statuses.publish(told.from_statuses(self._all_statuses(), stamp))
        if self.plan is not None and not self.lists:
            plan, self.plan = self.plan, None
            lists = [self._list(each) for each in plan.lists]
            self.allocation.publish(told.from_allocation(plan, lists, self._all_statuses()))
        now = time.monotonic()
        self.rested = now + _REST * (now - began)

    def _publisher(self, uav_id: str) -> Publisher | None:
        """None, and a word why, where there can be no such topic."""
        if uav_id in self.unnamed:
            return None
        if uav_id not in self.publishers:
            try:
                topic = check_topic(self.node, TASK_LIST, uav_id)
            except InvalidValue as error:
                self.unnamed.add(uav_id)
                self.node.get_logger().error(f'its task list is not published: {error}')
                return None
            self.publishers[uav_id] = self.node.create_publisher(m.TaskList, topic, LATCHED)
        return self.publishers[uav_id]

    def _list(self, uav_list: UavList) -> m.TaskList:
        source, message = self._lists.get(uav_list.uav, (None, None))
        if source is not uav_list:
            message = told.from_list(uav_list)
            self._lists[uav_list.uav] = (uav_list, message)
        return message

    def _all_statuses(self) -> list[m.TaskStatus]:
        before, self._statuses = self._statuses, {}
        for task_id, known in {**self.world.tasks.records, **self.world.tasks.rejected}.items():
            source, message = before.get(task_id, (None, None))
            if source is not known:
                message = told.from_task_status(status_of(task_id, known))
            self._statuses[task_id] = (known, message)
        return [message for _, message in self._statuses.values()]
