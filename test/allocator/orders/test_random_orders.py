# SPDX-License-Identifier: Apache-2.0
"""Random orders mixed with events: no order broken, no task lost, what is undone is as before.

HYPOTHESIS_ORDERS=1200 python -m pytest test/allocator/orders/test_random_orders.py gives 20 000.
"""
import os
from collections import Counter

from allocation import AllocatorDriver, greedy
from hypothesis import HealthCheck, Phase, settings, strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from uav_task_alloc.allocator.order_records import OrderKind
from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.model import Task, ThreatZone

UAVS = ('a', 'b', 'c')
TASKS = tuple(f't{n}' for n in range(12))
SPOTS = st.tuples(st.integers(-9, 9), st.integers(-9, 9))
OPERATORS = st.sampled_from(('ann', 'bob'))
PICKS = st.integers(0, 200)
DOME = ThreatZone.cylinder('dome', (150.0, 50.0), 60.0)
COUNTS = Counter()  # of what was done, for a run by hand


class OrdersAndEvents(RuleBasedStateMachine):
    """A fleet, its operators, and what happens to it."""

    @initialize(approval=st.sampled_from(('none', 'none', 'replan', 'all')),
                end=st.sampled_from(('hold', 'home')))
    def begin(self, approval, end):
        self.params = {'approval': approval, 'route_end': end, 'uav_timeout': 5.0}
        self.driver = AllocatorDriver(**self.params)
        self.alive, self.ranges = set(UAVS), dict.fromkeys(UAVS, 3000.0)
        self.places = {uav_id: (300.0 * n, 0.0, 50.0) for n, uav_id in enumerate(UAVS)}
        self.report()
        self.driver.add(*(Task(name, (150.0 * n - 600.0, 40.0 * (n % 5), 50.0))
                          for n, name in enumerate(TASKS[:8])))
        self.accepted = set(TASKS[:8])
        self.settle()
        if self.driver.world.proposal is not None:
            self.driver.core.decide(True, 'ann', self.driver.now, self.driver.now)
            self.driver.take()

    def report(self):
        for uav_id in sorted(self.alive):
            self.driver.uav(uav_id, *self.places[uav_id], range=self.ranges[uav_id],
                            home=self.places[uav_id])

    def settle(self):
        self.report()
        self.driver.settle(wait=0.5, report=False)

    # events

    @rule(name=st.sampled_from(TASKS), spot=SPOTS, only=st.sampled_from((None, None, 'a', 'b')))
    def announce(self, name, spot, only):
        allowed = frozenset({only}) if only else None
        verdict, = self.driver.add(Task(name, (100.0 * spot[0], 100.0 * spot[1], 50.0),
                                        allowed_uavs=allowed))
        if verdict.accepted:
            self.accepted.add(name)
        self.settle()

    @rule(name=st.sampled_from(TASKS))
    def cancel(self, name):
        self.driver.cancel(name)
        self.settle()

    @rule(uav_id=st.sampled_from(UAVS), kind=st.sampled_from(('STARTED', 'COMPLETED', 'FAILED')))
    def progress(self, uav_id, kind):
        listed = self.driver.world.lists.get(uav_id).task_ids
        if listed and uav_id in self.alive:
            assert self.driver.event(kind, listed[0], uav_id) == ''
            self.settle()

    @rule(uav_id=st.sampled_from(UAVS))
    def lose_or_find(self, uav_id):
        self.alive ^= {uav_id}
        for _ in range(4):
            self.report()
            self.driver.settle(wait=2.0, report=False)

    @rule(uav_id=st.sampled_from(UAVS), metres=st.sampled_from((300.0, 1500.0, 3000.0)))
    def drain(self, uav_id, metres):
        self.ranges[uav_id] = metres
        self.report()
        self.driver.world.request_replan('test', self.driver.now)
        self.settle()

    @rule(there=st.booleans())
    def zone(self, there):
        self.driver.world.set_zones([DOME] if there else [], (), self.driver.now)
        self.settle()

    @rule(accept=st.booleans())
    def approve(self, accept):
        proposal = self.driver.world.proposal
        if proposal is not None:
            COUNTS['approvals'] += 1
            desk = self.driver.desk()
            answer = desk.approve(proposal.revision, accept, 'ann', False, self.driver.now,
                                  self.driver.now)
            assert answer.success
            again = desk.approve(proposal.revision, accept, 'ann', False, self.driver.now,
                                 self.driver.now)
            assert not again.success
            self.settle()

    @rule()
    def restart(self):
        core, world = self.driver.core, self.driver.world
        core.nothing_written()
        state = restored_state(row for row in core.rows() if row.body is not None)
        assert state.unreadable == []
        before = world.orders, world.proposal, dict(world.lists.lists), self.driver.now
        self.driver = AllocatorDriver(state, **self.params)
        self.driver.now = before[3] + 1.0
        orders = self.driver.world.orders
        assert (orders.in_force, orders.log, orders.holds, orders.number) == (
            before[0].in_force, before[0].log, before[0].holds, before[0].number)
        assert self.driver.world.proposal == before[1]
        for _ in range(5):
            self.report()
            self.driver.settle(wait=2.0, report=False)
        self.driver.lists = {**before[2], **self.driver.lists}

    # orders

    def order(self, action, uav_id='', *tasks, **more):
        """Give an order twice: as a dry run, which changes nothing, and then in earnest."""
        driver, world = self.driver, self.driver.world
        before = dict(world.orders.in_force), world.version, dict(world.lists.lists)
        dry = driver.order(action, uav_id, *tasks, dry_run=True, **more)
        assert (world.orders.in_force, world.version, world.lists.lists) == before
        answer = driver.order(action, uav_id, *tasks, **more)
        assert dry.success == answer.success
        COUNTS[action, answer.success] += 1
        if not answer.success:
            assert answer.message.startswith('refused: ')
            assert len(answer.message) > len('refused: ') + 8
            assert world.orders.in_force == before[0]
        self.settle()
        return before[0], answer

    def task(self, pick):
        """An open task for most numbers, any name for some."""
        names = [record.task.id for record in self.driver.world.tasks.open()]
        return names[pick % len(names)] if names and pick % 9 else TASKS[pick % len(TASKS)]

    @rule(uav_id=st.sampled_from(UAVS), pick=PICKS, kind=st.sampled_from(('PIN', 'FORBID')),
          operator=OPERATORS)
    def pin_or_forbid(self, uav_id, pick, kind, operator):
        self.order(kind, uav_id, self.task(pick), operator=operator)

    @rule(uav_id=st.sampled_from(UAVS), picks=st.lists(PICKS, min_size=1, max_size=3),
          operator=OPERATORS)
    def sequence(self, uav_id, picks, operator):
        self.order('ORDER', uav_id, *map(self.task, picks), operator=operator)

    @rule(pick=PICKS)
    def clear(self, pick):
        orders = list(self.driver.world.orders.in_force.values())
        if orders:
            order = orders[pick % len(orders)]
            if order.kind is OrderKind.SEQUENCE:
                self.order('ORDER', order.uav)
            elif order.tasks:
                self.order(order.kind.name, order.uav, *order.tasks, clear=True)
            if order.tasks:
                assert order.id not in self.driver.world.orders.in_force

    @rule(uav_id=st.sampled_from(UAVS), keep=st.booleans(),
          action=st.sampled_from(('PAUSE', 'RESUME', 'RETURN', 'RESUME')))
    def hold(self, uav_id, keep, action):
        self.order(action, uav_id, **({'keep_tasks': keep} if action == 'PAUSE' else {}))

    @rule(pick=st.integers(0, 50))
    def undo(self, pick):
        in_force = list(self.driver.world.orders.in_force)
        name = in_force[pick % len(in_force)] if in_force else 'o1'
        before, answer = self.order('UNDO', order_id=name)
        assert answer.success == (name in before)

    def what_orders_demand(self):
        """What the solver may do, states of UAVs, holds, reasons, and a plan without a start."""
        world = self.driver.world
        orders, tasks = world.orders, sorted(world.tasks_to_plan(), key=lambda task: task.id)
        uavs = [world.uav(uav_id) for uav_id in sorted(world.fleet.usable_ids())]
        return {
            'uavs': uavs, 'tasks': tasks, 'in force': list(orders.in_force.values()),
            'next': [orders.sequence(uav_id) for uav_id in UAVS],
            'kept': [orders.keeps_tasks(uav_id) for uav_id in UAVS],
            'returns': [orders.returns(uav_id) for uav_id in UAVS],
            'holds': [uav_id in orders.holds and orders.holds[uav_id].hold for uav_id in UAVS],
            'reasons': [orders.reason(name) for name in TASKS],
            'plan': greedy(uavs, tasks, tuple(world.airspace.zones.values())).routes}

    def kept_by_others(self, uav_id, names):
        """Those of the tasks that a paused UAV keeps: an order that moves them makes them free."""
        world = self.driver.world
        return [world.task_records()[name].task for name in names
                if any(name in world.lists.lists[other].task_ids for other in UAVS
                       if other != uav_id and other in world.lists.lists
                       and world.orders.keeps_tasks(other))]

    def with_tasks(self, demand, more):
        tasks = sorted([*demand['tasks'], *more], key=lambda task: task.id)
        zones = self.driver.world.airspace.zones
        plan = greedy(demand['uavs'], tasks, tuple(zones.values())).routes
        return {**demand, 'tasks': tasks, 'plan': plan}

    @rule(uav_id=st.sampled_from(UAVS), picks=st.lists(PICKS, min_size=1, max_size=2),
          kind=st.sampled_from(('PIN', 'FORBID', 'FORBID', 'ORDER', 'PAUSE', 'RETURN')),
          keep=st.booleans(), lists_change=st.booleans())
    def give_and_take_back(self, uav_id, picks, kind, keep, lists_change):
        self.settle()
        names = [self.task(pick) for pick in picks[:2 if kind == 'ORDER' else 1]]
        before, more = self.what_orders_demand(), {}
        kept = self.kept_by_others(uav_id, names)
        # tasks that a paused UAV keeps move on when it is sent home, and stay where they are then
        keeps = self.driver.world.orders.keeps_tasks(uav_id)
        if kind in ('PAUSE', 'RETURN'):
            names, more = [], {'keep_tasks': keep} if kind == 'PAUSE' else {}
        answer = self.driver.order(kind, uav_id, *names, **more)
        if answer.success and answer.order_id not in {each.id for each in before['in force']}:
            assert self.what_orders_demand() != before
            if lists_change and not keeps:
                self.settle()
            assert self.driver.order('UNDO', order_id=answer.order_id).success
            if kept and lists_change and kind in ('PIN', 'ORDER'):
                before = self.with_tasks(before, kept)
            assert self.what_orders_demand() == before
            COUNTS['undone', kind] += 1
        self.settle()

    # what always holds

    @invariant()
    def no_order_is_broken(self):
        if not hasattr(self, 'driver'):
            return
        world = self.driver.world
        lists = {uav_id: each.task_ids for uav_id, each in world.lists.lists.items()}
        for order in world.orders.in_force.values():
            if order.kind is OrderKind.FORBID:
                assert order.tasks[0] not in lists.get(order.uav, ())
            elif order.kind in (OrderKind.PIN, OrderKind.SEQUENCE):
                for uav_id, listed in lists.items():
                    assert uav_id == order.uav or not set(order.tasks) & set(listed)
            if order.kind is OrderKind.SEQUENCE:
                listed = lists.get(order.uav, ())
                active = world.fleet.active.get(order.uav)
                rest = listed[1:] if listed[:1] == (active,) else listed
                rest = listed if active in order.tasks else rest
                flown = [name for name in order.tasks if name in listed]
                assert list(rest[:len(flown)]) == flown, (order, listed)
        for uav_id in lists:
            last = world.orders.of_uav(uav_id)
            if last is not None and not world.orders.keeps_tasks(uav_id):
                assert lists[uav_id] == ()
            hold = world.orders.holds.get(uav_id)
            paused = last is not None and last.kind is OrderKind.PAUSE
            assert (hold is not None and hold.hold) == paused

    @invariant()
    def no_task_is_lost_or_flown_twice(self):
        if not hasattr(self, 'driver'):
            return
        world = self.driver.world
        records = world.task_records()
        assert self.accepted <= set(records)
        listed = [name for each in world.lists.lists.values() for name in each.task_ids]
        assert len(listed) == len(set(listed))
        for record in world.tasks.open():
            name, state = record.task.id, record.state.name
            assert (name in listed) == (state in ('ASSIGNED', 'ACTIVE')), (name, state)
            assert name in listed or record.reason
        assert all(records[name].open for name in listed)


OrdersAndEvents.TestCase.settings = settings(
    max_examples=int(os.environ.get('HYPOTHESIS_ORDERS', '25')), stateful_step_count=50,
    deadline=None, suppress_health_check=list(HealthCheck),
    phases=(Phase.explicit, Phase.reuse, Phase.generate))  # to shrink one takes minutes
TestRandomOrders = OrdersAndEvents.TestCase


def teardown_module():
    print(dict(COUNTS))
