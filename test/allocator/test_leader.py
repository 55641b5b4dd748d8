# SPDX-License-Identifier: Apache-2.0
"""Leader election: exactly one allocator leads, in every order of starts and messages."""
from itertools import permutations

import pytest

from uav_task_alloc.allocator.leader import (
    DISCOVERY,
    RESTART_DISCOVERY,
    STATUS_WAIT,
    AllocatorInstance,
    Leader,
    Role,
    parse_status,
    status_values,
)
from uav_task_alloc.errors import InvalidValue

STEP = 0.1  # [s]


class Allocators:
    """Allocators in virtual time that publish their status every second, without delay."""

    def __init__(self):
        self.now, self.leaders, self.published = 100.0, [], {}

    def start(self, started, id):
        leader = Leader(AllocatorInstance(started, id, f'/{id}'), self.now)
        self.leaders.append(leader)
        self.published[id] = self.now + 0.3 * len(self.leaders) - 1.0
        return leader

    def kill(self, leader):
        self.leaders.remove(leader)

    def run(self, seconds, cut=False):
        """Let time pass; `cut`: no status is received."""
        for _ in range(round(seconds / STEP)):
            self.now += STEP
            others = 0 if cut else sum(
                each.role is not Role.PASSIVE for each in self.leaders) - 1
            for each in self.leaders:
                each.tick(others, self.now)
                if self.now - self.published[each.me.id] >= 1.0:
                    self.published[each.me.id] = self.now
                    for other in () if cut else self.leaders:
                        other.update(each.me, each.reported, self.now)

    @property
    def leading(self):
        return [each.me.id for each in self.leaders if each.role is Role.LEADING]


@pytest.fixture
def fleet():
    return Allocators()


def test_finding_22_a_single_allocator_leads_after_the_discovery(fleet):
    fleet.start(1, 'a')
    assert fleet.leading == []
    fleet.run(DISCOVERY + STEP)
    assert fleet.leading == ['a']


def test_finding_22_a_restarted_one_leads_soon_unless_a_uav_has_a_foreign_list(fleet):
    leader = Leader(AllocatorInstance(1, 'a', '/a'), fleet.now, restarted=True)
    leader.tick(0, fleet.now + RESTART_DISCOVERY)
    assert leader.role is Role.LEADING
    leader.tick(0, fleet.now + RESTART_DISCOVERY + STEP, foreign=True)
    assert leader.role is Role.STARTING
    leader.tick(0, fleet.now + DISCOVERY - STEP, foreign=True)
    assert leader.role is Role.STARTING
    leader.tick(0, fleet.now + DISCOVERY, foreign=True)
    assert leader.role is Role.LEADING


@pytest.mark.parametrize('started', [2, 1, 0])  # 0: a computer whose clock is slow
def test_finding_22_the_present_leader_stays(fleet, started):
    fleet.start(1, 'b')
    fleet.run(5.0)
    late = fleet.start(started, 'a')
    fleet.run(5.0)
    assert fleet.leading == ['b']
    assert late.error(fleet.now) == (
        'passive: another allocator leads this fleet: /b (instance b, started '
        '1970-01-01T00:00:00+00:00); this one publishes nothing until it is restarted')


def restarted_unseen(fleet, started, id='r'):
    """A restarted allocator that leads before it has discovered the others."""
    late = Leader(AllocatorInstance(started, id, f'/{id}'), fleet.now, restarted=True)
    late.tick(0, fleet.now + RESTART_DISCOVERY)
    assert late.role is Role.LEADING
    return late


@pytest.mark.parametrize('started', [2, 0])  # 0: a computer whose clock is slow
def test_the_present_leader_stays_where_a_restarted_one_discovers_it_late(fleet, started):
    present = fleet.start(1, 'b')
    fleet.run(5.0)
    late = restarted_unseen(fleet, started)
    now = fleet.now + DISCOVERY - STEP
    present.update(late.me, late.reported, now)
    late.update(present.me, present.reported, now)
    assert (present.role, late.role) == (Role.LEADING, Role.PASSIVE)


@pytest.mark.parametrize('reverse', [False, True])
def test_of_two_restarted_that_discover_each_other_late_one_leads(fleet, reverse):
    both = [restarted_unseen(fleet, started, id) for started, id in ((1, 'z'), (2, 'y'))]
    now = fleet.now + DISCOVERY - STEP
    for one, other in (both[::-1], both) if reverse else (both, both[::-1]):
        one.update(other.me, Role.RESTARTING, now)
    assert [each.role for each in both] == [Role.LEADING, Role.PASSIVE]


def test_a_restarted_one_leads_a_new_one_and_reports_it_once_it_has_waited(fleet):
    late = restarted_unseen(fleet, 2)
    late.update(AllocatorInstance(1, 'new', '/new'), Role.STARTING, fleet.now + DISCOVERY)
    late.tick(1, fleet.now + DISCOVERY)
    assert late.reported is Role.RESTARTING
    late.tick(0, fleet.now + DISCOVERY)
    assert (late.reported, late.silent_others) == (Role.LEADING, False)
    other = restarted_unseen(fleet, 3)
    other.tick(1, fleet.now + STATUS_WAIT)
    assert (other.reported, other.silent_others) == (Role.LEADING, True)


@pytest.mark.parametrize('order', list(permutations([(1, 'b'), (2, 'a'), (2, 'c')])))
def test_finding_22_of_several_starts_at_once_the_earliest_leads(fleet, order):
    for each in order:
        fleet.start(*each)
    for _ in range(50):
        fleet.run(STEP)
        assert len(fleet.leading) <= 1
    assert fleet.leading == ['b']


def test_finding_22_the_greater_id_steps_down_where_the_starts_are_equal(fleet):
    fleet.start(1, 'b')
    fleet.start(1, 'a')
    fleet.run(5.0)
    assert fleet.leading == ['a']


def test_finding_22_the_later_start_steps_down_when_a_cut_network_is_whole_again(fleet):
    for k, id in enumerate('bac'):
        fleet.start(k, id)
    fleet.run(5.0, cut=True)
    assert fleet.leading == ['b', 'a', 'c']
    fleet.run(2.0)
    assert fleet.leading == ['b']


def test_finding_22_a_killed_allocator_may_be_restarted_beside_a_passive_one(fleet):
    first = fleet.start(1, 'a')
    fleet.run(2.0)
    passive = fleet.start(2, 'b')
    fleet.run(2.0)
    fleet.kill(first)
    fleet.run(30.0)
    assert fleet.leading == []  # the tasks are in the journal of the killed one
    assert passive.error(fleet.now).endswith('no status of it for 30 s')
    fleet.start(3, 'a2')
    fleet.run(2.0)
    assert fleet.leading == ['a2']


def test_finding_22_a_publisher_without_status_delays_a_start_only(fleet):
    leader = fleet.start(1, 'a')
    while fleet.now < 100.0 + STATUS_WAIT - STEP:
        fleet.now += STEP
        leader.tick(1, fleet.now)
        assert leader.role is Role.STARTING
    leader.tick(1, 100.0 + STATUS_WAIT)
    assert (leader.role, leader.silent_others) == (Role.LEADING, True)


def test_finding_22_an_allocator_whose_journal_is_in_use_never_leads(fleet):
    leader = fleet.start(1, 'a')
    leader.refuse('journal.sqlite3 cannot be opened: database is locked', fleet.now)
    fleet.run(2.0)
    assert fleet.leading == []
    assert 'database is locked' in leader.error(fleet.now)


def test_finding_22_a_status_is_parsed_by_allocators_of_the_same_fleet_only():
    me = AllocatorInstance(17, 'a1', '/north/allocator')
    values = {key: str(value) for key, value in
             status_values(me, Role.LEADING, '/north/allocation').items()}
    assert parse_status('/north/allocator', values, '/north/allocation') == (me, Role.LEADING)
    assert parse_status('/north/allocator', values, '/south/allocation') is None
    assert parse_status('/bridge', {}, '/north/allocation') is None


@pytest.mark.parametrize(('key', 'value'), [
    ('started', '²'), ('started', '-1'), ('started', ''), ('started', '9' * 5000),
    ('instance', ''), ('instance', 'x' * 201), ('role', 'king')])
def test_finding_22_hostile_values_are_refused(key, value):
    values = {key: str(value) for key, value in
             status_values(AllocatorInstance(1, 'a', ''), Role.LEADING, '/allocation').items()}
    with pytest.raises(InvalidValue, match=key):
        parse_status('/allocator', {**values, key: value}, '/allocation')


def test_finding_22_any_start_time_that_is_parsed_can_be_formatted():
    assert 'started 5138-' in AllocatorInstance(10**20 - 1, 'a', '/a').text
