# SPDX-License-Identifier: Apache-2.0
"""Random orders to real nodes: each list that is published keeps every order that is in force.

    python benchmarks/endurance/order_lists.py [--requests 2000] [--speedup 4] [--trips] [--json]

Run after `colcon build`, in a sourced shell. fleet_sim, allocator and bridge run as processes;
operators order, take back and cancel at random while tasks come and are flown. What is in force is
kept here, by the answers alone (order_book.py), and compared with each list, hold, status and
diagnostic. In the end all orders are taken back, and all tasks have to be flown. Ends with 1 where
an order was broken, a refusal has no reason, an order that was taken back still shows in a text or
still refuses another one, or an
accepted task was lost. --trips: with batteries that are changed at the base.
"""
from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import rclpy
from battery_kills import SCENARIO, START
from battery_ledger import Ledger
from diagnostic_msgs.msg import DiagnosticArray
from node_run import Nodes, node_run, print_figures
from order_book import OrderBook
from rclpy.executors import SingleThreadedExecutor
from rosgraph_msgs.msg import Clock
from uav_task_alloc_msgs import msg as m, srv

from uav_task_alloc.model import Task
from uav_task_alloc.nodes.conversions.messages import LATCHED, STATES, announcement, from_stamp

UAVS = ('uav_1', 'uav_2', 'uav_3')
SIDE, MOST_OPEN, MOST_ORDERS = 900.0, 14, 25  # [m]; tasks; orders in force
ANSWER, END = 120.0, 900.0  # [s] of wall time for an answer; until all tasks are flown
QUIET, QUIET_EVERY = 1.5, 20  # [s] without a new list; requests between two such checks
LAG = 1.0  # [s] of wall time by which clocks of two nodes may differ
SERVICES: dict[str, Any] = {
    'pin_task': srv.PinTask, 'forbid_task': srv.ForbidTask, 'order_tasks': srv.OrderTasks,
    'pause_uav': srv.PauseUav, 'resume_uav': srv.ResumeUav, 'return_uav': srv.ReturnUav,
    'undo_order': srv.UndoOrder}
WEIGHTS = {'pin_task': 5, 'forbid_task': 4, 'order_tasks': 4, 'pause_uav': 2, 'resume_uav': 3,
           'return_uav': 1, 'undo_order': 5, 'cancel': 1}
PLAIN = SCENARIO.replace('trips: 2\n', '').replace(
    'range: 6000, endurance: 400, turnaround: 120, ', 'range: 1000000, ')


class Operators:
    """The node of all operators: requests, and everything that is published."""

    def __init__(self, rng: random.Random, speedup: float) -> None:
        self.rng, self.ledger, self.book = rng, Ledger(), OrderBook(UAVS, LAG * speedup)
        self.node = rclpy.create_node('operators')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        subscribe = self.node.create_subscription
        subscribe(Clock, '/clock', self.on_clock, 1)
        subscribe(m.UavState, 'uav_states', self.on_state, STATES)
        subscribe(m.TaskStatusArray, 'task_statuses', self.on_statuses, LATCHED)
        subscribe(m.Allocation, 'allocation', self.on_allocation, LATCHED)
        subscribe(DiagnosticArray, '/diagnostics', self.on_diagnostics, 10)
        for uav in UAVS:
            subscribe(m.TaskList, f'{uav}/task_list', self.on_list, LATCHED)
            subscribe(m.UavHold, f'{uav}/hold', self.book.held, LATCHED)
        self.clients = {name: self.node.create_client(kind, f'allocator/{name}')
                        for name, kind in SERVICES.items()}
        self.clients['submit'] = self.node.create_client(srv.SubmitTasks, 'allocator/submit_tasks')
        self.now, self.lists, self.newest = 0.0, dict[str, m.TaskList](), 0.0
        self.known, self.done, self.refused = set[str](), Counter[str](), Counter[str]()

    # what is published

    def on_clock(self, msg: Clock) -> None:
        self.now = from_stamp(msg.clock)

    def on_state(self, msg: m.UavState) -> None:
        self.known.add(msg.uav_id)
        self.book.flies(msg.uav_id, msg.active_task_id, self.now)

    def on_statuses(self, msg: m.TaskStatusArray) -> None:
        self.ledger.statuses(msg, self.now)
        self.book.ended(set(self.ledger.ended))
        for status in msg.statuses:
            self.book.shown(status.reason, from_stamp(msg.header.stamp), status.task_id)

    def on_diagnostics(self, msg: DiagnosticArray) -> None:
        for status in msg.status:
            if ' order ' in f' {status.name} ':
                self.book.shown(status.name, from_stamp(msg.header.stamp), '/diagnostics')

    def on_list(self, msg: m.TaskList) -> None:
        self.newest = time.monotonic()
        self.lists[msg.uav_id] = msg
        self.book.check(msg.uav_id, ids(msg), from_stamp(msg.header.stamp))

    def on_allocation(self, msg: m.Allocation) -> None:
        for tasks in msg.lists:
            self.book.check(tasks.uav_id, ids(tasks), from_stamp(msg.header.stamp))

    # requests

    def until(self, condition, seconds: float) -> bool:
        end = time.monotonic() + seconds
        while not condition() and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)
        return bool(condition())

    def call(self, name: str, request: Any) -> Any:
        """The answer to a request. Exits where there is none."""
        asked = self.clients[name].call_async(request)
        if not self.until(asked.done, ANSWER):
            sys.exit(f'{name}: no answer within {ANSWER:g} s')
        return asked.result()

    def announce(self) -> None:
        """Announce a task."""
        self.ledger.number += 1
        task = Task(f't{self.ledger.number}', (self.rng.uniform(0.0, SIDE),
                                               self.rng.uniform(0.0, SIDE), 40.0))
        answer = self.call('submit', srv.SubmitTasks.Request(announcement=announcement(
            m.TaskAnnouncement.ADD, [task], self.now)))
        assert answer.accepted, answer.reasons
        self.ledger.accept(task, self.now)

    def cancel(self, task: str) -> None:
        """Cancel a task; it may be completed meanwhile."""
        self.call('submit', srv.SubmitTasks.Request(announcement=announcement(
            m.TaskAnnouncement.CANCEL, [Task(task, (0.0, 0.0, 0.0))], self.now)))

    def order(self) -> None:
        """One random request."""
        rng, tasks = self.rng, self.ledger.open() or ['t1']
        name = rng.choices(list(WEIGHTS), WEIGHTS.values())[0]
        if len(self.book.in_force) > MOST_ORDERS:
            name = 'undo_order'
        if name == 'cancel':
            self.done[name] += 1
            return self.cancel(rng.choice(tasks))
        fields: dict[str, Any] = {'uav_id': rng.choice(UAVS)}
        if name in ('pin_task', 'forbid_task'):
            fields |= {'task_id': rng.choice(tasks), 'clear': rng.random() < 0.1}
        elif name == 'order_tasks':
            fields['task_ids'] = rng.sample(tasks, min(len(tasks), rng.randrange(4)))
        elif name == 'pause_uav':
            fields['keep_tasks'] = rng.random() < 0.5
        elif name == 'undo_order':
            fields = {'order_id': rng.choice([*self.book.in_force, 'o99999'])}
        if rng.random() < 0.03:
            fields = dict.fromkeys(fields.keys() & {'uav_id', 'order_id'}, 'nobody')
        self.request(name, fields)

    def request(self, name: str, fields: dict[str, Any]) -> None:
        """Give an order; its answer decides what is in force from then on."""
        self.book.asked(name, fields)
        answer = self.call(name, SERVICES[name].Request(operator_name='ann', **fields))
        self.book.answered(name, fields, answer, self.now)
        (self.done if answer.success else self.refused)[name] += 1

    def check_when_quiet(self) -> None:
        """Check all lists and holds once nothing changes any more."""
        self.newest = time.monotonic()
        if self.until(lambda: time.monotonic() > self.newest + QUIET, 30.0):
            self.book.check_all({uav: ids(msg) for uav, msg in self.lists.items()})


def ids(tasks: m.TaskList) -> tuple[str, ...]:
    """The task ids of a list."""
    return tuple(planned.task.task_id for planned in tasks.tasks)


def faults(operators: Operators) -> dict[str, object]:
    """What must be empty."""
    book, ledger = operators.book, operators.ledger
    found = {'broken': book.broken, 'no_reason': book.without_reason, 'still_shown': book.stale,
             'lost': sorted(ledger.lost), 'reopened': sorted(ledger.reopened)}
    return {name: value for name, value in found.items() if value}


def give_orders(operators: Operators, nodes: Nodes, requests: int) -> None:
    """All requests, amid tasks that come and are flown."""
    began = time.monotonic()
    for k in range(requests):
        while len(operators.ledger.open()) < MOST_OPEN and operators.rng.random() < 0.8:
            operators.announce()
        operators.order()
        operators.until(lambda: False, operators.rng.choice((0.0, 0.0, 0.1)))
        if nodes.dead():
            sys.exit('; '.join(nodes.dead()))
        if k % QUIET_EVERY == 0:
            operators.check_when_quiet()
            print(f'\r{k} requests, {time.monotonic() - began:.0f} s, '
                  f'{operators.ledger.count(m.TaskStatus.COMPLETED)} tasks flown, '
                  f'{len(operators.book.in_force)} orders in force, {faults(operators)} ', end='',
                  file=sys.stderr, flush=True)
    print(file=sys.stderr)


def fly_rest(operators: Operators) -> bool:
    """Take everything back; whether all tasks are flown then."""
    while operators.book.in_force:
        operators.request('undo_order', {'order_id': next(iter(operators.book.in_force))})
        operators.until(lambda: False, 0.05)
    operators.check_when_quiet()
    return operators.until(lambda: not operators.ledger.open(), END)


def run(args: argparse.Namespace, folder: Path) -> int:
    """All requests, the figures and the verdict."""
    nodes = Nodes(folder, args.speedup, SCENARIO if args.trips else PLAIN)
    operators, began = Operators(random.Random(args.seed), args.speedup), time.monotonic()
    try:
        for name in ('fleet_sim', 'allocator', 'mavlink_bridge'):
            nodes.start(name)
        if not operators.until(lambda: len(operators.known) == len(UAVS) and all(
                client.service_is_ready() for client in operators.clients.values()), START):
            sys.exit('the nodes do not start')
        give_orders(operators, nodes, args.requests)
        flown = fly_rest(operators)
    finally:
        nodes.stop()
    found = faults(operators)
    figures = {'requests': args.requests, 'seed': args.seed, 'speedup': args.speedup,
               'wall_s': round(time.monotonic() - began), 'accepted': dict(operators.done),
               'refused': dict(operators.refused), 'tasks': len(operators.ledger.tasks),
               'completed': operators.ledger.count(m.TaskStatus.COMPLETED), 'all_flown': flown,
               'lists_checked': operators.book.checked, 'checked_when_quiet':
               operators.book.checked_quiet, 'faults': found}
    print_figures(figures, args.json)
    return int(bool(found) or not flown)


def main() -> int:
    """Command line."""
    return node_run(__doc__, run, {'requests': 2000, 'speedup': 4.0}, ('trips',))


if __name__ == '__main__':
    sys.exit(main())
