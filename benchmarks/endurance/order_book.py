# SPDX-License-Identifier: Apache-2.0
"""The orders in force by the answers of an allocator alone, and the lists that break one."""
from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from uav_task_alloc_msgs import msg as m

RECENT = 30.0  # [s] for which a task counts as being flown after it was reported last
MOST = 10  # faults that are kept
KINDS = {'pin_task': 'pin', 'forbid_task': 'forbid', 'order_tasks': 'next', 'pause_uav': 'pause',
         'return_uav': 'return'}


@dataclass
class GivenOrder:
    """One order."""

    id: str
    kind: str  # of KINDS
    uav: str
    tasks: tuple[str, ...] = ()
    keep_tasks: bool = False
    since: float = 0.0  # [s] of /clock: lists stamped from then on keep it
    leaving: bool = False  # its end was asked for


class OrderBook:
    """What is in force.

    Args:
        uavs: all of the fleet.
        lag: [s] of /clock by which two nodes may differ.
    """

    def __init__(self, uavs: Iterable[str], lag: float) -> None:
        self.uavs, self.lag = tuple(uavs), lag
        self.in_force: dict[str, GivenOrder] = {}
        self.undone: dict[str, float] = {}  # [s] of /clock: messages from then on do not name it
        self.flown: dict[str, dict[str, float]] = {}  # [s] last reported, by UAV and task
        self.holds: dict[str, m.UavHold] = {}
        self.broken: list[str] = []
        self.without_reason: list[str] = []
        self.stale: list[str] = []
        self.checked = self.checked_quiet = 0

    # requests and answers

    def ending(self, name: str, fields: Mapping[str, Any]) -> list[GivenOrder]:
        """The orders that a request ends."""
        uav, orders = fields.get('uav_id', ''), list(self.in_force.values())
        if name == 'undo_order':
            return [each for each in orders if each.id == fields['order_id']]
        if name == 'resume_uav':
            return [each for each in orders if each.uav == uav
                    and each.kind in ('pause', 'return')]
        if name == 'order_tasks' and not fields.get('task_ids'):
            return [each for each in orders if each.uav == uav and each.kind == 'next']
        if fields.get('clear'):
            return [each for each in orders if each.kind == KINDS[name] and each.uav == uav
                    and each.tasks == (fields['task_id'],)]
        return []

    def asked(self, name: str, fields: Mapping[str, Any]) -> None:
        """Note a request before it is sent: what it may end is not judged any more."""
        for order in self.ending(name, fields):
            order.leaving = True

    def answered(self, name: str, fields: Mapping[str, Any], answer: Any, now: float) -> None:
        """Put in force or end what the answer says."""
        ending = self.ending(name, fields)
        if not answer.success:
            why = answer.message.removeprefix('refused: ')
            if why == answer.message or not why.strip():
                self.without_reason.append(f'{name} {dict(fields)}: {answer.message!r}')
            self.shown(answer.message, now, f'refusal of {name}')
            for order in ending:  # it may have ended without an undo
                order.leaving = 'not in force any more' in answer.message
                if order.leaving:
                    del self.in_force[order.id]
            return
        for order in ending:
            del self.in_force[order.id]
            self.undone[order.id] = now + self.lag
        if not ending and name in KINDS and not fields.get('clear'):
            self._give(name, fields, answer, now)

    def _give(self, name: str, fields: Mapping[str, Any], answer: Any, now: float) -> None:
        tasks = tuple(fields.get('task_ids', ())) or tuple(
            filter(None, (fields.get('task_id', ''),)))
        for order_id in filter(None, answer.order_id.split(',')):
            self.in_force.setdefault(order_id, GivenOrder(
                order_id, KINDS[name], fields['uav_id'], tasks,
                fields.get('keep_tasks', False), now + self.lag))

    def ended(self, tasks: set[str]) -> None:
        """Drop orders all of whose tasks have ended."""
        self.in_force = {order.id: order for order in self.in_force.values()
                         if not order.tasks or not set(order.tasks) <= tasks}

    # what is published

    def flies(self, uav: str, task: str, now: float) -> None:
        """Note the task that a UAV reports."""
        if task:
            self.flown.setdefault(uav, {})[task] = now

    def held(self, msg: m.UavHold) -> None:
        """Note a hold."""
        if msg.source == m.UavHold.OPERATOR:
            self.holds[msg.uav_id] = msg

    def shown(self, text: str, stamp: float, where: str) -> None:
        """Check that a text names no order that was taken back before its stamp."""
        for order_id in re.findall(r'\border (o\d+)\b', text):
            if stamp >= self.undone.get(order_id, math.inf) and len(self.stale) < MOST:
                self.stale.append(f'{where} at {stamp:.1f}: {text}')

    def check(self, uav: str, listed: tuple[str, ...], stamp: float) -> None:
        """Check the list of a UAV against the orders in force at its stamp."""
        self.checked += 1
        for order in self.in_force.values():
            if order.since <= stamp and not order.leaving:
                self._check(order, uav, listed, f'list of {uav} at {stamp:.1f}')

    def check_all(self, lists: Mapping[str, tuple[str, ...]]) -> None:
        """Check all lists and holds against all orders, once nothing changes any more."""
        self.checked_quiet += 1
        for order in self.in_force.values():
            for uav, listed in lists.items():
                self._check(order, uav, listed, f'list of {uav} when quiet')
        for uav in self.uavs:
            last = self._last(uav)
            paused, hold = last is not None and last.kind == 'pause', self.holds.get(uav)
            if paused != (hold is not None and hold.hold):
                self._note(f'hold of {uav} is {hold and hold.hold}, orders {last}')
        twice = [task for uav in lists for task in lists[uav]
                 if sum(task in each for each in lists.values()) > 1]
        if twice:
            self._note(f'in two lists: {twice}')

    def _last(self, uav: str) -> GivenOrder | None:
        """The last pause or return of a UAV, which counts."""
        return max((each for each in self.in_force.values() if each.uav == uav
                    and each.kind in ('pause', 'return')), key=lambda each: int(each.id[1:]),
                   default=None)

    def _check(self, order: GivenOrder, uav: str, listed: tuple[str, ...], where: str) -> None:
        if order.kind == 'forbid':
            bad = uav == order.uav and order.tasks[0] in listed
        elif order.kind in ('pin', 'next'):
            bad = (bool(set(order.tasks) & set(listed)) if uav != order.uav
                   else order.kind == 'next' and not self._in_order(order, listed))
        else:
            bad = (uav == order.uav and bool(listed) and order is self._last(uav)
                   and not (order.kind == 'pause' and order.keep_tasks))
        if bad:
            self._note(f'{where}: {" ".join(listed)}: {order}')

    def _in_order(self, order: GivenOrder, listed: tuple[str, ...]) -> bool:
        """Whether the tasks of a fixed order come first, after the one that is being flown."""
        wanted = tuple(task for task in order.tasks if task in listed)
        flown = self.flown.get(order.uav, {})
        newest = max(flown.values(), default=0.0)
        return listed[:len(wanted)] == wanted or (
            listed[1:1 + len(wanted)] == wanted
            and flown.get(listed[0], -math.inf) >= newest - RECENT)

    def _note(self, fault: str) -> None:
        if len(self.broken) < MOST:
            self.broken.append(fault)
