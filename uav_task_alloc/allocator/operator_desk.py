# SPDX-License-Identifier: Apache-2.0
"""Takes orders of operators: checks each, has it priced, puts it in force, and writes the log."""
from __future__ import annotations

from dataclasses import dataclass, replace

from uav_task_alloc.allocator.core import Allocator
from uav_task_alloc.allocator.order_records import OrderKind, OrderLogEntry
from uav_task_alloc.allocator.order_requests import (
    ORDER_KINDS,
    OrderAction,
    OrderAnswer,
    OrderRequest,
    RequestCheck,
    refused,
)
from uav_task_alloc.allocator.replanning.accepted_lists import accepted_lists
from uav_task_alloc.allocator.replanning.what_if import (
    OrderChange,
    WhatIfAnswer,
    WhatIfProblem,
    broken_order,
    what_if_problem,
)
from uav_task_alloc.errors import counted, first_of
from uav_task_alloc.piece_ids import split_piece


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
        self._check = RequestCheck(core.world)

    def open(self, request: OrderRequest, now: float, stamp: float) -> OrderAnswer | OrderTrial:
        """Check a request; it is refused, done at once, or has to be solved first."""
        change = self._check.change_of(request)
        if isinstance(change, OrderAnswer):
            return change
        if not (change.add or change.remove):
            return self._nothing_to_do(request, change, now, stamp)
        if not (_must_be_kept(change) or request.dry_run):
            return self._apply(request, change, None, now, stamp)
        if not self._world.kernels_ready:
            return refused('the solver is still loading: try again in a minute')
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
        change = self._check.change_of(request)  # the world has gone on
        if isinstance(change, OrderAnswer):
            return change
        if answer is None:
            return refused('the solver failed; its log says why')
        if _must_be_kept(change):
            why = broken_order(trial.change, trial.problem, answer) or self._breaks_other(answer)
            if why:
                return refused(why)
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
        if accept and (silent := self._core.awaited(now)):  # a list needs the place of its UAV
            return refused(f'after the restart {first_of(silent)} have not reported yet: try '
                           'again when they have')
        word = 'accepted' if accept else 'rejected'
        text = f'plan {revision} {word}: {first_of(proposal.changes, separator="; ")}'
        price = (proposal.distance, proposal.finish, proposal.late) if accept else (0.0, 0.0, ())
        before = f'revision {self._world.revision}'
        if dry_run:
            why = accepted_lists(self._world, proposal, stamp)[1] if accept else ''
        else:
            why = self._core.decide(accept, operator, now, stamp)
        if why:
            return refused(f'plan {revision} cannot be put in force now: {why}')
        if dry_run:
            return OrderAnswer(True, f'dry run: {text}', '', *price)
        entry = self._world.orders.write_log(OrderLogEntry(
            0, stamp, operator, f'plan {revision} {word}', before,
            f'revision {self._world.revision}: {first_of(proposal.changes, separator="; ")}'))
        self._world.note(f'{operator}: {entry.text}')
        return OrderAnswer(True, text, '', *price)

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
            return before != after or not self._world.fleet.usable_ids()

    def _nothing_to_do(self, request: OrderRequest, change: OrderChange, now: float,
                       stamp: float) -> OrderAnswer:
        """A request that changes no order; a resumed UAV may go on in any case."""
        if request.action is OrderAction.RESUME:
            if not request.dry_run:
                self._world.orders.release(request.uav, stamp, f'resumed by {request.operator}')
                self._world.note(f'{request.operator}: resume {request.uav}: no order held it')
            return OrderAnswer(True, f'no order held {request.uav}', '', 0.0, 0.0)
        same = [order for order in self._world.orders.in_force.values()
                if order.kind is ORDER_KINDS[request.action] and order.tasks == request.tasks
                and request.uav in ('', order.uav)
                and (order.kind is not OrderKind.PAUSE or order.keep_tasks == request.keep_tasks)]
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
            return first_of((f'{order.uav} has '
                              f'{counted(len(world.list_of(order.uav).stops), "task")}'
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
