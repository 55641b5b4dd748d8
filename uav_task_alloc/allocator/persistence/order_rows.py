# SPDX-License-Identifier: Apache-2.0
"""Orders, their log, and holds as rows of the journal, and back."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

from uav_task_alloc.allocator.order_records import (
    OperatorHold,
    Order,
    OrderKind,
    OrderLogEntry,
    OrderRows,
)
from uav_task_alloc.allocator.state.orders import Orders
from uav_task_alloc.checks import check_id, check_number, check_ros_name
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.journal import JournalRow

_MAX_TIME = 2.0**31 - 1.0  # [s] of a stamp that a message can hold
_TEXTS = ('operator', 'action', 'before', 'after', 'reason')


def order_rows(orders: Orders) -> list[JournalRow]:
    """Return the rows of what has changed since they were last written.

    Args:
        orders: in force.

    Returns:
        A row without a body deletes one.
    """
    made: dict[str, Callable[[str], Any]] = {
        'order': orders.in_force.get, 'order_log': lambda key: orders.log.get(int(key)),
        'hold': orders.holds.get}
    return [JournalRow(kind, key, _body(made[kind](key)))
            for kind, keys in orders.unsaved.items() for key in sorted(keys)]


def mark_all_orders(orders: Orders) -> None:
    """Mark everything as not written.

    Args:
        orders: whose sets of unsaved ids are changed.
    """
    orders.unsaved['order'].update(orders.in_force)
    orders.unsaved['order_log'].update(map(str, orders.log))
    orders.unsaved['hold'].update(orders.holds)


def _body(value: Any) -> dict[str, Any] | None:
    if value is None:
        return None
    body = asdict(value)
    return {**body, 'kind': value.kind.value} if isinstance(value, Order) else body


def restore_order_row(rows: OrderRows, row: JournalRow) -> None:
    """Add what a row holds.

    Args:
        rows: which are added to.
        row: of the kind `order`, `order_log` or `hold`.

    Raises:
        InvalidValue: a value is out of range.
    """
    body = dict(row.body)
    for name in _TEXTS:
        if not isinstance(body.get(name, ''), str):
            raise InvalidValue(name, body[name], 'a string')
    check_number('stamp', body['stamp'], -_MAX_TIME, _MAX_TIME)
    if row.kind == 'hold':
        hold = OperatorHold(**body)
        if type(hold.hold) is not bool or hold.uav != row.id:
            raise InvalidValue('hold', body, 'true or false, and the UAV of the row')
        check_ros_name('uav', check_id('uav', hold.uav))
        rows.holds.append(hold)
        return
    check_number('number', body['number'], 0, _MAX_TIME)
    if type(body['number']) is not int:
        raise InvalidValue('number', body['number'], 'a whole number')
    if row.kind == 'order_log':
        rows.log.append(OrderLogEntry(**body))
        return
    order = Order(**{**body, 'kind': OrderKind(body['kind'])})
    rows.orders.append(replace(order, tasks=tuple(
        check_ros_name('task', check_id('task', task_id)) for task_id in order.tasks)))
    check_ros_name('uav', check_id('uav', order.uav))
    wanted = {OrderKind.PIN: (1, 1), OrderKind.FORBID: (1, 1), OrderKind.SEQUENCE: (1, 10_000)}
    low, high = wanted.get(order.kind, (0, 0))
    if not low <= len(order.tasks) <= high or type(order.keep_tasks) is not bool:
        rows.orders.pop()
        raise InvalidValue('order', body, f'{low} to {high} tasks, and keep_tasks true or false')
