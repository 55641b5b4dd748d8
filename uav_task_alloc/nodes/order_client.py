# SPDX-License-Identifier: Apache-2.0
"""Calls a service of an allocator for orders, for the command `order`."""
from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from uav_task_alloc_msgs import srv

from uav_task_alloc.errors import InvalidValue

_SERVICES: dict[str, Any] = {
    'pin_task': srv.PinTask, 'forbid_task': srv.ForbidTask, 'order_tasks': srv.OrderTasks,
    'pause_uav': srv.PauseUav, 'resume_uav': srv.ResumeUav, 'return_uav': srv.ReturnUav,
    'undo_order': srv.UndoOrder, 'approve_plan': srv.ApprovePlan}
_SETTLE = 0.3  # [s]: a server just discovered may not know this client yet


def call(allocator: str, service: str, fields: Mapping[str, object],
         timeout: float) -> tuple[bool, str]:
    """Call a service once, and wait for the answer.

    Args:
        allocator: full name of the node.
        service: name below it.
        fields: of the request.
        timeout: [s] for the allocator to be found, and again for its answer.

    Returns:
        Whether it was done, and a text with the price where there is one.

    Raises:
        InvalidValue: that is no name of a node.
    """
    kind = _SERVICES[service]
    name = f'{allocator.rstrip("/")}/{service}'
    rclpy.init(args=[])
    executor = SingleThreadedExecutor()
    node = Node('order', use_global_arguments=False)
    executor.add_node(node)
    try:
        try:
            client = node.create_client(kind, name)
        except NameValidationException:
            raise InvalidValue('--allocator', allocator, 'the full name of a node, such as '
                               '/allocator') from None
        if not _spin_until(executor, client.service_is_ready, timeout):
            return False, f'{name}: no such service in {timeout:g} s: does the allocator run?'
        _spin_until(executor, lambda: False, _SETTLE)
        future = client.call_async(kind.Request(**fields))
        if not _spin_until(executor, future.done, timeout):
            return False, f'{name}: no answer within {timeout:g} s: it may be in force or not'
        answer: Any = future.result()
        return answer.success, answer.message
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()


def _spin_until(executor: SingleThreadedExecutor, condition: Callable[[], bool],
                timeout: float) -> bool:
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > end:
            return False
        executor.spin_once(timeout_sec=0.05)
    return True
