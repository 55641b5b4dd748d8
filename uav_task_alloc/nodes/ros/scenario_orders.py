# SPDX-License-Identifier: Apache-2.0
"""Gives the orders of a scenario to an allocator, one after the other."""
from __future__ import annotations

import time
from typing import Any

from rclpy.node import Node
from rclpy.task import Future
from uav_task_alloc_msgs import msg as m, srv

from uav_task_alloc.nodes.conversions.messages import LATCHED
from uav_task_alloc.scenario import TimedOrder

_SERVICES: dict[str, tuple[Any, str]] = {
    'pin': (srv.PinTask, 'allocator/pin_task'),
    'forbid': (srv.ForbidTask, 'allocator/forbid_task'),
    'next': (srv.OrderTasks, 'allocator/order_tasks')}
_LONGEST = 60.0  # [s] for an answer


class ScenarioOrders:
    """Gives each of `waiting` once the allocator knows its UAV and has planned its tasks.

    Args:
        node: which gives them.
    """

    def __init__(self, node: Node) -> None:
        self.waiting: list[TimedOrder] = []  # to be given, in this order
        self._node = node
        self._clients = {word: node.create_client(kind, name)
                         for word, (kind, name) in _SERVICES.items()}
        self._asked: Future[Any] | None = None  # the answer to the order that was given last
        self._until = 0.0  # [s] of the steady clock, when no answer is expected any more
        self._uavs: set[str] = set()  # that the allocator knows
        self._planned: set[str] = set()  # tasks
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
        if self.waiting and self._is_known(self.waiting[0]):
            self._give(self.waiting.pop(0))

    def _is_known(self, order: TimedOrder) -> bool:
        return (order.uav in self._uavs and self._planned.issuperset(order.tasks)
                and self._clients[order.order].service_is_ready())

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
