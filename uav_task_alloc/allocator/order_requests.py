# SPDX-License-Identifier: Apache-2.0
"""Requests of operators, their answers, and the check of a request: the change it asks for."""
from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from uav_task_alloc.allocator.order_records import Order, OrderKind
from uav_task_alloc.allocator.replanning.what_if import OrderChange
from uav_task_alloc.allocator.state.fleet import may_fly
from uav_task_alloc.allocator.state.orders import MAX_ORDERS
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.errors import first_of

_MOST_ORDERED = 100  # tasks of one sequence
_UNKNOWN = math.nan  # a price that cannot be known


class OrderAction(Enum):
    """What an operator asks for; the value is its word in texts."""

    PIN = 'pin'
    FORBID = 'forbid'
    ORDER = 'order'
    PAUSE = 'pause'
    RESUME = 'resume'
    RETURN = 'return'
    UNDO = 'undo'


ORDER_KINDS = {OrderAction.PIN: OrderKind.PIN, OrderAction.FORBID: OrderKind.FORBID,
          OrderAction.ORDER: OrderKind.SEQUENCE, OrderAction.PAUSE: OrderKind.PAUSE,
          OrderAction.RETURN: OrderKind.RETURN}


@dataclass(frozen=True, slots=True)
class OrderRequest:
    """What an operator asks for, as received."""

    action: OrderAction  # what is asked for
    uav: str = ''  # id; of RETURN: '' for all
    tasks: tuple[str, ...] = ()  # of PIN and FORBID one; of ORDER: none ends the order
    clear: bool = False  # of PIN and FORBID: ends the order instead
    keep_tasks: bool = False  # of PAUSE: its tasks wait for the UAV
    order_id: str = ''  # of UNDO; several are separated by commas
    operator: str = 'unnamed'  # for the log
    dry_run: bool = False  # only the price is asked for
    revision: int = 0  # of the allocation that the operator saw; 0: any


@dataclass(frozen=True, slots=True)
class OrderAnswer:
    """What became of a request."""

    success: bool  # it is in force; of a dry run: it could be
    message: str  # what was done, or why it was refused
    order_id: str = ''  # several are separated by commas
    distance: float = _UNKNOWN  # [m] that all routes get longer
    finish: float = _UNKNOWN  # [s] that the last route ends later
    late: tuple[str, ...] = ()  # task ids


class RequestCheck:
    """Checks requests of operators.

    Args:
        world: whose tasks, UAVs and orders in force a request must fit.
    """

    def __init__(self, world: World) -> None:
        self._world = world

    def change_of(self, request: OrderRequest) -> OrderChange | OrderAnswer:
        """The change that a request asks for, or its refusal.

        Args:
            request: of an operator.
        """
        world, revision = self._world, request.revision
        if revision and not world.plan_revision <= revision <= world.revision:
            return refused(f'revision = {revision}: expected 0 or {world.revision}, '
                            'that of the allocation in force')
        if request.action is OrderAction.UNDO:
            return self._undone(request)
        if why := self._unknown_uav(request):
            return refused(why)
        if request.action is OrderAction.RESUME:
            gone = tuple(order for order in world.orders.in_force.values()
                         if order.uav == request.uav
                         and order.kind in (OrderKind.PAUSE, OrderKind.RETURN))
            return OrderChange(f'resume {request.uav}', remove=gone)
        if request.clear or (request.action is OrderAction.ORDER and not request.tasks):
            return self._cleared(request)
        return self._added(request)

    def _unknown_uav(self, request: OrderRequest) -> str:
        world, uav_id = self._world, request.uav
        if uav_id in world.fleet.records or uav_id in world.lists.lists or (
                request.clear and uav_id):
            return ''
        if request.action is OrderAction.RETURN and not uav_id:
            return '' if world.fleet.records else 'no UAV is known'
        known = first_of(sorted(world.fleet.records)) or 'none is known yet'
        return f'uav_id = {uav_id!r}: expected a known UAV ({known})'

    def _undone(self, request: OrderRequest) -> OrderChange | OrderAnswer:
        orders, found = self._world.orders, []
        for order_id in dict.fromkeys(filter(None, request.order_id.split(','))):
            if order_id not in orders.in_force:
                known = orders.history(order_id)
                return refused(f'order_id = {order_id!r}: ' + (
                    f'it is not in force any more ({known})' if known else
                    'expected an order in force'))
            found.append(orders.in_force[order_id])
        if not found:
            return refused("order_id = '': expected an order in force")
        return OrderChange(f'undo {first_of(order.id for order in found)}', remove=tuple(found))

    def _cleared(self, request: OrderRequest) -> OrderChange | OrderAnswer:
        """The end of the order that says what a request says."""
        kind = ORDER_KINDS[request.action]
        gone = tuple(order for order in self._world.orders.in_force.values()
                     if order.kind is kind and order.uav == request.uav
                     and (kind is OrderKind.SEQUENCE or order.tasks == request.tasks))
        what = f'{request.action.value} of {" ".join((*request.tasks, request.uav))}'
        if not gone:
            return refused(f'no {what} is in force')
        return OrderChange(f'clear {what}', remove=gone)

    def _added(self, request: OrderRequest) -> OrderChange | OrderAnswer:
        orders, kind = self._world.orders, ORDER_KINDS[request.action]
        uavs, without = self._commanded(request)
        if not uavs:
            return refused(without)
        keep = request.keep_tasks if kind is OrderKind.PAUSE else True
        add = [Order(kind, uav_id, request.tasks, request.operator, keep_tasks=keep)
               for uav_id in uavs]
        add = [order for order in add if not orders.has(order)]
        if kind not in (OrderKind.PAUSE, OrderKind.RETURN):
            why = self._task_refusal(request, kind)
            other = next(filter(None, map(orders.contradicting, add)), None)
            if other is not None:
                why = why or f'it contradicts {other.name} ({other.text}): undo that first'
            if why:
                return refused(why)
        if len(orders.in_force) + len(add) > MAX_ORDERS:
            return refused(f'orders = {MAX_ORDERS}: expected fewer; undo some first')
        text = add[0].text if len(add) == 1 else f'{kind.value} {first_of(uavs)}'
        return OrderChange(text + (f' (not {without})' if without else ''), add=tuple(add))

    def _commanded(self, request: OrderRequest) -> tuple[list[str], str]:
        """The UAVs of a request, and which of them it cannot be for as another has authority."""
        records = self._world.fleet.records
        uavs = [request.uav] if request.uav else sorted(records)
        if request.action not in (OrderAction.PAUSE, OrderAction.RETURN):
            return uavs, ''
        without = {uav_id: records[uav_id].report for uav_id in uavs
                   if uav_id in records and records[uav_id].report.flown_by_other}
        return [uav_id for uav_id in uavs if uav_id not in without], first_of(
            (f'{uav_id}, whose bridge has no authority ({report.reason or report.authority})'
             for uav_id, report in without.items()), separator='; ')

    def _task_refusal(self, request: OrderRequest, kind: OrderKind) -> str:
        """Why the tasks of a request cannot be ordered so; '' where they can."""
        if kind is not OrderKind.SEQUENCE and len(request.tasks) != 1:
            return f'task_id = {first_of(request.tasks)!r}: expected one task'
        if len(request.tasks) > _MOST_ORDERED:
            return f'{len(request.tasks)} task_ids: expected at most {_MOST_ORDERED}'
        if len(set(request.tasks)) < len(request.tasks):
            twice = next(t for t in request.tasks if request.tasks.count(t) > 1)
            return f'task_ids: {twice} is there twice'
        for task_id in request.tasks:
            if why := self._unfit(task_id, request.uav, kind):
                return why
        return ''

    def _unfit(self, task_id: str, uav_id: str, kind: OrderKind) -> str:
        """Why a task cannot be given to a UAV by an order."""
        world = self._world
        record, uav = world.announced.known(task_id), world.fleet.records.get(uav_id)
        if record is None:
            return f'task_id = {task_id!r}: expected an accepted task'
        if not record.open:
            return f'{task_id} is {record.state.name}'
        if kind is OrderKind.SEQUENCE and task_id in world.works.records:
            return f'{task_id} is flown in pieces, in any order: pin it to {uav_id} instead'
        if kind is OrderKind.FORBID:
            return ''
        if uav is None:
            return f'{uav_id} has not reported yet'
        task = record.task
        if task.allowed_uavs is not None and uav_id not in task.allowed_uavs:
            return f'{task_id} is allowed for {first_of(sorted(task.allowed_uavs))} only'
        lacking = task.required_capabilities - uav.report.capabilities
        if lacking:
            return f'{uav_id} lacks {first_of(sorted(lacking))}, which {task_id} requires'
        capacity = uav.report.payload_capacity or 0.0
        if task.payload > capacity:
            return f'{task_id}: payload {task.payload:g} kg; {uav_id} takes {capacity:g} kg'
        if not may_fly(task, record.failed_on, uav.report):
            return f'{task_id} failed on {uav_id}'
        order = world.orders.of_uav(uav_id)
        if order is not None:
            return f'it contradicts {order.name} ({order.text}): resume {uav_id} first'
        return world.fleet.why_unusable(uav_id)


def refused(why: str) -> OrderAnswer:
    """Return the answer to a request that is refused.

    Args:
        why: value, expectation and place.

    Returns:
        Without success, and without a price.
    """
    return OrderAnswer(False, f'refused: {why}')
