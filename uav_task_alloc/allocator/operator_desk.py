# SPDX-License-Identifier: Apache-2.0
"""Takes orders of operators: checks each, has it priced, puts it in force, and writes the log."""
from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

from uav_task_alloc.allocator.core import Allocator
from uav_task_alloc.allocator.order_records import Order, OrderKind, OrderLogEntry
from uav_task_alloc.allocator.replanning.what_if import (
    OrderChange,
    WhatIfAnswer,
    WhatIfProblem,
    broken_order,
    what_if_problem,
)
from uav_task_alloc.allocator.state.fleet import may_fly
from uav_task_alloc.allocator.state.orders import MAX_ORDERS
from uav_task_alloc.errors import first_of
from uav_task_alloc.piece_ids import split_piece

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


_KINDS = {OrderAction.PIN: OrderKind.PIN, OrderAction.FORBID: OrderKind.FORBID,
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


@dataclass(frozen=True, slots=True)
class OrderTrial:
    """A request that is to be solved before it is decided."""

    request: OrderRequest  # of an operator
    change: OrderChange  # that it asks for
    problem: WhatIfProblem  # to solve


class OperatorDesk:
    """Decides about requests of operators: `open`, where it returns a trial solve it, `close`.

    Args:
        core: whose world orders change.

    Arguments of methods:
        request: of an operator.
        now: [s] steady clock.
        stamp: [s] clock of the node.
    """

    def __init__(self, core: Allocator) -> None:
        self._core, self._world = core, core.world

    def open(self, request: OrderRequest, now: float, stamp: float) -> OrderAnswer | OrderTrial:
        """Check a request; it is refused, done at once, or has to be solved first."""
        change = self._checked(request)
        if isinstance(change, OrderAnswer):
            return change
        if not (change.add or change.remove):
            return self._nothing_to_do(request, change, now, stamp)
        if not (_must_be_kept(change) or request.dry_run):
            return self._apply(request, change, None, now, stamp)
        if not self._world.kernels_ready:
            return _refused(request, 'the solver is still loading: try again in a minute')
        if self._has_no_price(change):
            return self._priced(request, change, None)
        return OrderTrial(request, change, what_if_problem(self._world, change, stamp))

    def close(self, trial: OrderTrial, answer: WhatIfAnswer | None, now: float,
              stamp: float) -> OrderAnswer:
        """Decide a request that was solved.

        Args:
            trial: as `open` returned it.
            answer: None where the solve failed.
        """
        request = trial.request
        change = self._checked(request)  # the world has gone on
        if isinstance(change, OrderAnswer):
            return change
        if answer is None:
            return _refused(request, 'the solver failed; its log says why')
        if _must_be_kept(change):
            why = broken_order(trial.change, trial.problem, answer) or self._breaks_other(answer)
            if why:
                return _refused(request, why)
        if request.dry_run:
            return self._priced(request, change, answer)
        return self._apply(request, change, answer, now, stamp)

    def approve(self, revision: int, accept: bool, operator: str, dry_run: bool, now: float,
                stamp: float) -> OrderAnswer:
        """Accept or reject the plan that waits for approval.

        Args:
            revision: of that plan.
            accept: put it in force; else it is dropped.
            operator: who decides.
            dry_run: only its price is asked for.
        """
        why, proposal = self._core.approvals.refusal(revision), self._world.proposal
        if why or proposal is None:
            return OrderAnswer(False, f'refused: {why}')
        word = 'accepted' if accept else 'rejected'
        text = f'plan {revision} {word}: {first_of(proposal.changes, separator="; ")}'
        price = (proposal.distance, proposal.finish, proposal.late) if accept else (0.0, 0.0, ())
        if dry_run:
            return OrderAnswer(True, f'dry run: {text}', '', *price)
        before = f'revision {self._world.revision}'
        self._core.decide(accept, operator, now, stamp)
        entry = self._world.orders.write_log(OrderLogEntry(
            0, stamp, operator, f'plan {revision} {word}', before,
            f'revision {self._world.revision}: {first_of(proposal.changes, separator="; ")}'))
        self._world.note(f'{operator}: {entry.text}')
        return OrderAnswer(True, text, '', *price)

    # checks

    def _checked(self, request: OrderRequest) -> OrderChange | OrderAnswer:
        """The change that a request asks for, or its refusal."""
        world, revision = self._world, request.revision
        if revision and not world.plan_revision <= revision <= world.revision:
            return _refused(request, f'revision = {revision}: expected 0 or {world.revision}, '
                            'that of the allocation in force')
        if request.action is OrderAction.UNDO:
            return self._undone(request)
        if why := self._unknown_uav(request):
            return _refused(request, why)
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
                return _refused(request, f'order_id = {order_id!r}: ' + (
                    f'it is not in force any more ({known})' if known else
                    'expected an order in force'))
            found.append(orders.in_force[order_id])
        if not found:
            return _refused(request, "order_id = '': expected an order in force")
        return OrderChange(f'undo {first_of(order.id for order in found)}', remove=tuple(found))

    def _cleared(self, request: OrderRequest) -> OrderChange | OrderAnswer:
        """The end of the order that says what a request says."""
        kind = _KINDS[request.action]
        gone = tuple(order for order in self._world.orders.in_force.values()
                     if order.kind is kind and order.uav == request.uav
                     and (kind is OrderKind.SEQUENCE or order.tasks == request.tasks))
        what = f'{request.action.value} of {" ".join((*request.tasks, request.uav))}'
        if not gone:
            return _refused(request, f'no {what} is in force')
        return OrderChange(f'clear {what}', remove=gone)

    def _added(self, request: OrderRequest) -> OrderChange | OrderAnswer:
        orders, kind = self._world.orders, _KINDS[request.action]
        uavs, without = self._commanded(request)
        if not uavs:
            return _refused(request, without)
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
                return _refused(request, why)
        if len(orders.in_force) + len(add) > MAX_ORDERS:
            return _refused(request, f'orders = {MAX_ORDERS}: expected fewer; undo some first')
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
        if not may_fly(task, record.failed_on, uav.report):
            return f'{task_id} failed on {uav_id}'
        order = world.orders.of_uav(uav_id)
        if order is not None:
            return f'it contradicts {order.name} ({order.text}): resume {uav_id} first'
        return world.fleet.why_unusable(uav_id)

    def _breaks_other(self, answer: WhatIfAnswer) -> str:
        """Which order in force could not be kept any more."""
        orders = self._world.orders
        for task_id, why in answer.left_out.items():
            whole, _ = split_piece(task_id)
            order = next((each for each in orders.in_force.values()
                          if whole in each.tasks and each.kind is not OrderKind.FORBID), None)
            if order is not None:
                return f'it contradicts {order.name} ({order.text}): {task_id} {why}'
        return ''

    # answers

    def _has_no_price(self, change: OrderChange) -> bool:
        """Whether it depends on when a UAV is resumed, or no UAV would be left."""
        orders, uavs = self._world.orders, {o.uav for o in (*change.add, *change.remove)}
        before = {uav_id for uav_id in uavs if orders.keeps_tasks(uav_id)}
        with orders.trial(change.add, (order.id for order in change.remove)):
            after = {uav_id for uav_id in uavs if orders.keeps_tasks(uav_id)}
            return before != after or not self._world.any_usable()

    def _nothing_to_do(self, request: OrderRequest, change: OrderChange, now: float,
                       stamp: float) -> OrderAnswer:
        """A request that changes no order; a resumed UAV may go on in any case."""
        if request.action is OrderAction.RESUME:
            if not request.dry_run:
                self._world.orders.release(request.uav, stamp, f'resumed by {request.operator}')
                self._world.note(f'{request.operator}: resume {request.uav}: no order held it')
            return OrderAnswer(True, f'no order held {request.uav}', '', 0.0, 0.0)
        same = [order for order in self._world.orders.in_force.values()
                if order.kind is _KINDS[request.action] and order.tasks == request.tasks
                and request.uav in ('', order.uav)]
        return OrderAnswer(True, f'in force already: {first_of(each.name for each in same)}',
                           ','.join(each.id for each in same), 0.0, 0.0)

    def _priced(self, request: OrderRequest, change: OrderChange,
                answer: WhatIfAnswer | None) -> OrderAnswer:
        """The answer to a dry run."""
        if answer is None:
            return OrderAnswer(True, f'dry run: {change.action}: its price is not known, as it '
                               'depends on when a UAV goes on')
        return OrderAnswer(True, f'dry run: {change.action}: {price_text(answer)}', '',
                           answer.distance, answer.finish, answer.late)

    def _apply(self, request: OrderRequest, change: OrderChange, answer: WhatIfAnswer | None,
               now: float, stamp: float) -> OrderAnswer:
        """Put a change in force, and write the log."""
        world = self._world
        before = self._state_text(change)
        price = '' if answer is None else f' ({price_text(answer)})'
        given = world.orders.apply(
            change.add, [order.id for order in change.remove],
            OrderLogEntry(0, stamp, request.operator, change.action, before, ''), stamp)
        entry = world.orders.log[world.orders.number]
        names = first_of((order.id for order in given), most=1000)
        entry = replace(entry, after=(
            f'in force as {names}{price}' if given else f'free{price}'))
        world.orders.log[entry.number] = entry
        world.note(f'{request.operator}: {entry.text}')
        world.outbox.statuses = True
        world.request_replan(f'{change.action} by {request.operator}', now)
        return OrderAnswer(
            True, f'{change.action}: {entry.after}; before: {before}',
            ','.join(order.id for order in given or change.remove),
            *((answer.distance, answer.finish, answer.late) if answer else ()))

    def _state_text(self, change: OrderChange) -> str:
        """What holds before a change: who has the tasks, which orders are in force."""
        world = self._world
        if change.remove:
            return first_of((f'{order.text} ({order.name})' for order in change.remove),
                            separator='; ')
        tasks = [task_id for order in change.add for task_id in order.tasks]
        if not tasks:
            return first_of((f'{order.uav} has {len(world.list_of(order.uav).stops)} tasks'
                             for order in change.add), separator='; ')
        records = [record for record in map(world.announced.known, tasks) if record]
        return first_of((f'{record.task.id} {record.state.name}' + (
            f' on {record.uav}' if record.uav else '') for record in records), separator='; ')


def price_text(answer: WhatIfAnswer) -> str:
    """Return what a change costs in words.

    Args:
        answer: of the solve.

    Returns:
        Metres, seconds, and the tasks that get late or are left out.
    """
    parts = [f'{answer.distance:+.0f} m', f'finish {answer.finish:+.0f} s']
    if answer.late:
        parts.append(f'late: {first_of(answer.late)}')
    if answer.left_out:
        parts.append('left out: ' + first_of(
            (f'{task_id} ({why})' for task_id, why in answer.left_out.items()), separator='; '))
    return ', '.join(parts)


def _must_be_kept(change: OrderChange) -> bool:
    """Whether it gives tasks to a UAV, which has to be able to fly them."""
    return any(order.kind in (OrderKind.PIN, OrderKind.SEQUENCE) for order in change.add)


def _refused(request: OrderRequest, why: str) -> OrderAnswer:
    return OrderAnswer(False, f'refused: {why}')
