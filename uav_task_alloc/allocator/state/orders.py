# SPDX-License-Identifier: Apache-2.0
"""Orders of operators: those in force, what they allow, what they contradict, and their log."""
from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from uav_task_alloc.allocator.order_records import (
    OperatorHold,
    Order,
    OrderKind,
    OrderLogEntry,
    OrderRows,
)
from uav_task_alloc.errors import first_of
from uav_task_alloc.model import Task
from uav_task_alloc.piece_ids import split_piece

MAX_ORDERS = 2000  # in force; more are refused
_MAX_LOG = 1000  # entries of the log that are kept, the newest


_OF_UAV = frozenset({OrderKind.PAUSE, OrderKind.RETURN})


class Orders:
    """The orders in force by id, their log, and the holds that follow.

    Args:
        saved: what the journal restored.

    Arguments of methods:
        uav_id, task_id: known or not.
        order: that is given.
        entry: of the log, without its number.
        order_id: of an order, in force or not.
        reason: for users.
        ended: (task_id) -> why no order can concern it any more, '' while one can.
        stamp: [s] clock of the node.
    """

    def __init__(self, saved: OrderRows | None = None) -> None:
        saved = saved or OrderRows()
        self.in_force = {order.id: order for order in sorted(
            saved.orders, key=lambda order: order.number)}
        # the journal has the rows in any order
        self.log = {entry.number: entry for entry in sorted(
            saved.log, key=lambda entry: entry.number)}
        self.holds = {hold.uav: hold for hold in saved.holds}
        self.number = max((0, *self.log, *(order.number for order in saved.orders)))
        # ids not yet on disk, by kind of row
        self.unsaved: dict[str, set[str]] = {'order': set(), 'order_log': set(), 'hold': set()}
        self.changed_holds = set(self.holds)  # UAVs whose holds are to be published
        self._index()

    def _index(self) -> None:
        """Sort what is in force by tasks and UAVs."""
        self._owner: dict[str, Order] = {}
        self._forbidden: dict[str, dict[str, Order]] = {}
        self._sequence: dict[str, Order] = {}
        self._of_uav: dict[str, Order] = {}
        for order in self.in_force.values():
            if order.kind in _OF_UAV:
                self._of_uav[order.uav] = order  # the last one counts
            elif order.kind is OrderKind.FORBID:
                self._forbidden.setdefault(order.tasks[0], {})[order.uav] = order
            else:
                self._owner.update(dict.fromkeys(order.tasks, order))
            if order.kind is OrderKind.SEQUENCE:
                self._sequence[order.uav] = order

    # what the orders in force allow

    def allows(self, uav_id: str, task_id: str) -> bool:
        """Return whether a UAV may fly a task as far as orders are concerned."""
        whole, _ = split_piece(task_id)  # an order for work is one for all its pieces
        owner = self._owner.get(whole)
        return (owner is None or owner.uav == uav_id) and uav_id not in self._forbidden.get(
            whole, ())

    def narrowed(self, task: Task, known: frozenset[str]) -> Task:
        """Return a task as only those UAVs may fly it that the orders allow.

        Args:
            task: as announced.
            known: UAVs that it allows where it allows all.
        """
        whole, _ = split_piece(task.id)
        if whole not in self._owner and whole not in self._forbidden:
            return task
        allowed = known if task.allowed_uavs is None else task.allowed_uavs
        return replace(task, allowed_uavs=frozenset(
            uav_id for uav_id in allowed if self.allows(uav_id, task.id)))

    def owner(self, task_id: str) -> str:
        """Return the only UAV that may fly a task; '' where no order names one."""
        order = self._owner.get(split_piece(task_id)[0])
        return order.uav if order else ''

    def sequence(self, uav_id: str) -> tuple[str, ...]:
        """Return the tasks that a UAV flies next, in order; ended ones are among them."""
        order = self._sequence.get(uav_id)
        return order.tasks if order else ()

    def of_uav(self, uav_id: str) -> Order | None:
        """Return the order that keeps a UAV from getting tasks: the last pause or return."""
        return self._of_uav.get(uav_id)

    def keeps_tasks(self, uav_id: str) -> bool:
        """Return whether a UAV is paused, and its tasks wait for it."""
        order = self._of_uav.get(uav_id)
        return order is not None and order.kind is OrderKind.PAUSE and order.keep_tasks

    def returns(self, uav_id: str) -> bool:
        """Return whether a UAV is ordered home."""
        order = self._of_uav.get(uav_id)
        return order is not None and order.kind is OrderKind.RETURN

    def reason(self, task_id: str) -> str:
        """Return which orders keep UAVs from a task, for its status; '' where none does."""
        task_id, _ = split_piece(task_id)
        owner, texts = self._owner.get(task_id), []
        if owner:
            texts = [f'only {owner.uav} may fly it ({owner.name})']
        texts += [f'not {order.uav} ({order.name})'
                  for order in self._forbidden.get(task_id, {}).values()]
        return first_of(texts, separator='; ')

    # orders that are given

    def has(self, order: Order) -> bool:
        """Return whether an order in force says the same, and no later one counts instead."""
        same = [each for each in self.in_force.values() if each.content == order.content]
        return bool(same) and (order.kind not in _OF_UAV or self._of_uav[order.uav] in same)

    def contradicting(self, order: Order) -> Order | None:
        """Return the first order in force that cannot be kept beside another one."""
        return next((each for each in self.in_force.values()
                     if _contradict(each, order)), None)

    @contextmanager
    def trial(self, add: Sequence[Order], remove: Iterable[str]) -> Iterator[None]:
        """Within the context other orders are in force; afterwards everything is as before.

        Args:
            add: orders on trial.
            remove: ids of orders that are left out.
        """
        before, gone = self.in_force, set(remove)
        self.in_force = {key: each for key, each in before.items() if key not in gone}
        first = self.number + 1
        for number, order in enumerate(add, first):
            order = replace(order, number=number)
            self.in_force[order.id] = order
        self._index()
        try:
            yield
        finally:
            self.in_force = before
            self._index()

    def apply(self, add: Sequence[Order], remove: Iterable[str], entry: OrderLogEntry,
              stamp: float) -> list[Order]:
        """Put orders in force, and take others back.

        Args:
            add: new orders; they get their numbers and `stamp` here.
            remove: ids of orders in force.
            entry: of the log; it gets its number here.
            stamp: [s].

        Returns:
            The new orders as they are in force.
        """
        for order_id in remove:
            del self.in_force[order_id]
            self.unsaved['order'].add(order_id)
        given = [replace(order, number=self.number + n, stamp=stamp)
                 for n, order in enumerate(add, 1)]
        for order in given:
            self.in_force[order.id] = order
            self.unsaved['order'].add(order.id)
        self.number += max(1, len(given))
        self._log(replace(entry, number=self.number, stamp=stamp))
        self._index()
        self._update_holds(stamp)
        return given

    def end_fulfilled(self, ended: Callable[[str], str], stamp: float) -> list[OrderLogEntry]:
        """Remove the orders whose tasks have all ended; returns their entries in the log."""
        entries = []
        for order in list(self.in_force.values()):
            whys = [ended(task_id) for task_id in order.tasks]
            if order.tasks and all(whys):
                entry = OrderLogEntry(0, stamp, '', f'{order.name} ended: {whys[-1]}',
                                      order.text, 'free')
                self.apply((), (order.id,), entry, stamp)
                entries.append(self.log[self.number])
        return entries

    def write_log(self, entry: OrderLogEntry) -> OrderLogEntry:
        """Add an entry that changes no order; returns it with its number."""
        self.number += 1
        self._log(replace(entry, number=self.number))
        return self.log[self.number]

    def release(self, uav_id: str, stamp: float, reason: str) -> None:
        """Publish that a UAV may go on although no order holds it."""
        self._set_hold(OperatorHold(uav_id, False, stamp, reason))

    def history(self, order_id: str) -> str:
        """Return what became of an order that is not in force; '' where that is not known."""
        return next((entry.action for entry in reversed(self.log.values())
                     if order_id in entry.action.replace(',', ' ').split()), '')

    def _log(self, entry: OrderLogEntry) -> None:
        self.log[entry.number] = entry
        self.unsaved['order_log'].add(str(entry.number))
        while len(self.log) > _MAX_LOG:
            oldest = next(iter(self.log))
            del self.log[oldest]
            self.unsaved['order_log'].add(str(oldest))

    def _update_holds(self, stamp: float) -> None:
        """Let the holds follow from the orders in force."""
        wanted = {uav_id: order for uav_id, order in self._of_uav.items()
                  if order.kind is OrderKind.PAUSE}
        for uav_id in {*wanted, *self.holds}:
            order, known = wanted.get(uav_id), self.holds.get(uav_id)
            reason = order.name if order else 'no order to pause is in force'
            if (order is not None) != (known is not None and known.hold) or (
                    order and known and known.reason != reason):
                self._set_hold(OperatorHold(uav_id, order is not None, stamp, reason))

    def _set_hold(self, hold: OperatorHold) -> None:
        self.holds[hold.uav] = hold
        self.unsaved['hold'].add(hold.uav)
        self.changed_holds.add(hold.uav)


def _contradict(one: Order, other: Order) -> bool:
    """Whether two orders cannot both be kept."""
    if one.kind in _OF_UAV or other.kind in _OF_UAV:
        return False
    shared = set(one.tasks) & set(other.tasks)
    if OrderKind.FORBID in (one.kind, other.kind):
        return bool(shared) and one.kind is not other.kind and one.uav == other.uav
    if one.kind is other.kind is OrderKind.SEQUENCE and one.uav == other.uav:
        return True
    return bool(shared) and one.uav != other.uav
