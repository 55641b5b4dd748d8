# SPDX-License-Identifier: Apache-2.0
"""Gives the orders of a scenario to an allocator, one at a time; one that waits stops no other."""
from __future__ import annotations

import math
import time
from typing import Any

from rclpy.node import Node
from rclpy.task import Future
from uav_task_alloc_msgs import msg as m, srv

from uav_task_alloc.errors import first_of
from uav_task_alloc.nodes.conversions.messages import LATCHED
from uav_task_alloc.scenario import TimedOrder

_SERVICES: dict[str, tuple[Any, str]] = {
    'pin': (srv.PinTask, 'allocator/pin_task'),
    'forbid': (srv.ForbidTask, 'allocator/forbid_task'),
    'next': (srv.OrderTasks, 'allocator/order_tasks')}
_LONGEST = 60.0  # [s] for an answer
_SAID_AFTER = 5.0  # [s] for which an order has waited


class ScenarioOrders:
    """Gives each of `waiting` once the allocator knows its UAV and has planned its tasks.

    Orders that share a UAV or a task are given in the order of the scenario; others are not
    delayed by one that waits.

    Args:
        node: which gives them.
    """

    def __init__(self, node: Node) -> None:
        self.waiting: list[TimedOrder] = []  # to be given, in the order of the scenario
        self._node = node
        self._clients = {word: node.create_client(kind, name)
                         for word, (kind, name) in _SERVICES.items()}
        self._asked: Future[Any] | None = None  # the answer to the order that was given last
        self._until = 0.0  # [s] of the steady clock, when no answer is expected any more
        self._uavs: set[str] = set()  # that the allocator knows
        self._planned: set[str] = set()  # tasks
        self._since: dict[TimedOrder, float] = {}  # [s] of the steady clock, infinite: it is said
        node.create_subscription(m.Allocation, 'allocation', self._on_allocation, LATCHED)
        node.create_subscription(m.TaskStatusArray, 'task_statuses', self._on_statuses, LATCHED)

    def step(self) -> None:
        """Give the next order where its time has come."""
        if self._asked is not None:
            if time.monotonic() < self._until:
                return
            self._node.get_logger().error(
                f'order: no answer within {_LONGEST:g} s: it may be in force or not')
            self._asked = None
        held: set[str] = set()  # UAVs and tasks of orders that wait
        for order in self.waiting:
            missing = self._missing(order)
            if not missing and held.isdisjoint((order.uav, *order.tasks)):
                self.waiting.remove(order)
                self._give(order)
                return
            if missing:
                self._say(order, missing)
            held |= {order.uav, *order.tasks}

    def _missing(self, order: TimedOrder) -> str:
        """What an order waits for; '' for nothing."""
        if not self._clients[order.order].service_is_ready():
            return 'there is no allocator'
        if order.uav not in self._uavs:
            return f'the allocator does not know {order.uav}'
        unplanned = [task for task in order.tasks if task not in self._planned]
        return f'not planned yet: {first_of(unplanned)}' if unplanned else ''

    def _say(self, order: TimedOrder, missing: str) -> None:
        """Log once what an order waits for."""
        now = time.monotonic()
        if now - self._since.setdefault(order, now) >= _SAID_AFTER:
            self._since[order] = math.inf
            self._node.get_logger().warning(f'order {order.text} waits: {missing}')

    def _give(self, order: TimedOrder) -> None:
        kind, _ = _SERVICES[order.order]
        tasks = ({'task_ids': list(order.tasks)} if order.order == 'next'
                 else {'task_id': order.tasks[0]})
        asked = self._clients[order.order].call_async(
            kind.Request(uav_id=order.uav, operator_name=self._node.get_name(), **tasks))
        self._asked, self._until = asked, time.monotonic() + _LONGEST

        def on_response(future: Future[Any]) -> None:
            if self._asked is asked:
                self._asked = None
            response = future.result()
            if response is not None and response.success:
                self._node.get_logger().info(response.message)
            else:
                self._node.get_logger().error(f'order {order.text}: ' + (
                    response.message if response else 'no response'))

        asked.add_done_callback(on_response)

    def _on_allocation(self, msg: m.Allocation) -> None:
        self._uavs.update(tasks.uav_id for tasks in msg.lists)

    def _on_statuses(self, msg: m.TaskStatusArray) -> None:
        self._planned = {status.task_id for status in msg.statuses
                         if status.state != m.TaskStatus.PENDING}
