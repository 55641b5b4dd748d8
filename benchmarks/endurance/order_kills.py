# SPDX-License-Identifier: Apache-2.0
"""Kills the allocator amid orders and open proposals; none may be lost or applied twice.

    python benchmarks/endurance/order_kills.py [--kills 200] [--seed 1] [--json]

Run after `colcon build`, in a sourced shell. Operators give random orders, take them back, and
decide about proposals (`approval: replan`) while tasks come; kill -9 ends the allocator at random
moments, many with requests that are not answered yet. Each request has an operator of its own, so
that the log in the journal shows how often it was applied: what was acknowledged exactly once,
everything else at most once, and the orders in force are those that the log says. Ends with 1
otherwise.
"""
from __future__ import annotations

import random
import sys
import time
from collections import Counter

import rclpy
from crash import LIMIT, Process, measured
from geometry_msgs.msg import Point
from rclpy.executors import SingleThreadedExecutor
from uav_task_alloc_msgs import msg as m, srv

from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.journal_recovery import read_copy
from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS, LATCHED, STATES

UAVS = ('a', 'b', 'c', 'd')
SERVICES = {'pin_task': srv.PinTask, 'forbid_task': srv.ForbidTask, 'order_tasks': srv.OrderTasks,
            'pause_uav': srv.PauseUav, 'resume_uav': srv.ResumeUav, 'return_uav': srv.ReturnUav,
            'undo_order': srv.UndoOrder, 'approve_plan': srv.ApprovePlan}
PARAMETERS = ('-p', 'approval:=replan', '-p', 'approval_timeout:=3.0', '-p',
              'approval_on_timeout:=accept')


class Operators:
    """The node of all operators: a fleet that stands still, tasks, and random requests."""

    def __init__(self, rng: random.Random) -> None:
        self.rng, self.node = rng, rclpy.create_node('operators')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.states = self.node.create_publisher(m.UavState, 'uav_states', STATES)
        self.tasks = self.node.create_publisher(m.TaskAnnouncement, 'task_announcements',
                                                ANNOUNCEMENTS)
        self.clients = {name: self.node.create_client(kind, f'allocator/{name}')
                        for name, kind in SERVICES.items()}
        self.node.create_subscription(m.Allocation, 'allocation', self.on_allocation, LATCHED)
        self.node.create_subscription(m.PlanProposal, 'plan_proposal', self.on_proposal, LATCHED)
        self.node.create_timer(0.2, self.publish_states)
        self.announced, self.sent = 0, 0
        self.acknowledged: dict[str, str] = {}  # operator -> service, of what succeeded
        self.refused, self.order_ids = Counter[str](), list[str]()
        self.published, self.proposal = False, 0
        self.proposals: set[int] = set()
        self.seen: set[str] = set()  # operators whose requests were in the log

    def on_allocation(self, _: m.Allocation) -> None:
        self.published = True

    def on_proposal(self, msg: m.PlanProposal) -> None:
        self.proposal = msg.plan.revision if msg.plan.lists else 0
        self.proposals |= {self.proposal} - {0}

    def publish_states(self) -> None:
        for n, uav_id in enumerate(UAVS):
            self.states.publish(m.UavState(
                uav_id=uav_id, position=Point(x=300.0 * n, z=50.0), available=True,
                range_remaining=float('nan'), home=Point(x=300.0 * n, z=50.0),
                cruise_speed=float('nan'), battery=float('nan')))

    def until(self, condition, seconds: float) -> bool:
        end = time.monotonic() + seconds
        while time.monotonic() < end and not condition():
            self.executor.spin_once(timeout_sec=0.02)
        return bool(condition())

    def announce(self) -> None:
        self.announced += 1
        self.tasks.publish(m.TaskAnnouncement(tasks=[m.Task(
            task_id=f't{self.announced}', value=1.0, acceptance_radius=float('nan'),
            position=Point(x=self.rng.uniform(0.0, 900.0), y=self.rng.uniform(-300.0, 300.0),
                           z=50.0))]))

    def request(self) -> None:
        """Send one random request; its answer may never come."""
        rng, name = self.rng, self.rng.choice(list(SERVICES))
        task = f't{rng.randint(max(1, self.announced - 20), max(1, self.announced))}'
        fields = {'pin_task': {'task_id': task, 'uav_id': rng.choice(UAVS)},
                  'forbid_task': {'task_id': task, 'uav_id': rng.choice(UAVS)},
                  'order_tasks': {'uav_id': rng.choice(UAVS), 'task_ids': [task]},
                  'undo_order': {'order_id': rng.choice(self.order_ids or ['o1'])},
                  'approve_plan': {'revision': self.proposal, 'accept': rng.random() < 0.7}}.get(
                      name, {'uav_id': rng.choice(UAVS)})
        if not self.clients[name].service_is_ready():
            return
        self.sent += 1
        operator = f'r{self.sent}'

        def answered(future) -> None:
            answer = future.result()
            if not answer.success:
                self.refused[name] += 1
                assert answer.message.startswith('refused: '), answer.message
            elif 'in force already' not in answer.message and 'no order held' not in (
                    answer.message):
                self.acknowledged[operator] = name
                self.order_ids = [*self.order_ids, *answer.order_id.split(',')][-30:]

        self.clients[name].call_async(
            SERVICES[name].Request(operator_name=operator, **fields)).add_done_callback(answered)


def faults(operators: Operators, state_dir: str) -> list[str]:
    """What the journal does not have, has twice, or has in force without a reason."""
    saved = restored_state(read_copy(state_dir))
    found = list(saved.unreadable)
    applied = Counter(entry.operator for entry in saved.orders.log if entry.operator)
    oldest = min((entry.number for entry in saved.orders.log), default=0)
    found += [f'{name} applied {count} times' for name, count in applied.items() if count > 1]
    operators.seen |= set(applied)  # the log keeps the newest 1000 entries
    found += [f'{name} ({service}) is lost' for name, service in
              operators.acknowledged.items() if name not in operators.seen]
    alive: set[str] = set()
    for order in saved.orders.orders:
        found += [f'{order.id} is there twice'] if order.id in alive else []
        alive.add(order.id)
        given = any(order.id in entry.after.replace(',', ' ').split()
                    for entry in saved.orders.log)
        if order.number >= oldest and not given:
            found.append(f'{order.id} is in force, and nobody gave it')
    return found


def run(kills: int, seed: int, process: Process) -> dict[str, object]:
    """All kills, and the figures."""
    rng, found, unanswered = random.Random(seed), list[str](), 0
    operators, began = Operators(rng), time.monotonic()
    for _ in range(6):
        operators.announce()
    for k in range(kills):
        operators.published, before = False, operators.sent
        process.start()
        if not operators.until(lambda: operators.published, LIMIT):
            sys.exit(f'nothing published after kill {k}:\n{process.log.read_text()[-3000:]}')
        end = time.monotonic() + rng.choice((0.4, 3.5)) * rng.uniform(0.5, 1.0)
        while time.monotonic() < end:
            if rng.random() < 0.15:
                operators.announce()
            operators.request()
            operators.until(lambda: False, rng.choice((0.0, 0.02, 0.1)))
        answers = len(operators.acknowledged) + sum(operators.refused.values())
        unanswered = operators.sent - answers
        process.kill()
        operators.until(lambda: False, 0.05)
        found += faults(operators, process.folder)
        print(f'\r{k + 1}/{kills} kills, {operators.sent} requests (+{operators.sent - before}), '
              f'{time.monotonic() - began:.0f} s, {len(found)} faults ', end='', file=sys.stderr)
    print(file=sys.stderr)
    return {'kills': kills, 'requests': operators.sent,
            'acknowledged': len(operators.acknowledged),
            'by_service': dict(Counter(operators.acknowledged.values())),
            'refused': sum(operators.refused.values()), 'unanswered': unanswered,
            'proposals': len(operators.proposals), 'faults': found[:10],
            'fault_count': len(found), 'seed': seed}


def main() -> int:
    """Measure, print, judge."""
    return int(bool(measured(__doc__, run, PARAMETERS)['fault_count']))


if __name__ == '__main__':
    sys.exit(main())
