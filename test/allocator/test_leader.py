# SPDX-License-Identifier: Apache-2.0
"""Several allocators of one fleet: exactly one leads, in every order of starts and messages."""
from itertools import permutations

import pytest

from uav_task_alloc.allocator.leader import (
    LISTEN,
    SETTLE,
    WAIT,
    AllocatorInstance,
    Leader,
    Role,
    heard,
    told,
)
from uav_task_alloc.errors import InvalidValue

STEP = 0.1  # [s]


class Fleet:
    """Allocators in virtual time that speak every second; they hear each other at once."""

    def __init__(self):
        self.now, self.leaders, self.spoken = 100.0, [], {}

    def start(self, started, id):
        leader = Leader(AllocatorInstance(started, id, f'/{id}'), self.now)
        self.leaders.append(leader)
        self.spoken[id] = self.now + 0.3 * len(self.leaders) - 1.0
        return leader

    def kill(self, leader):
        self.leaders.remove(leader)

    def run(self, seconds, cut=False):
        """cut: nobody hears anybody."""
        for _ in range(round(seconds / STEP)):
            self.now += STEP
            others = 0 if cut else sum(
                each.role is not Role.PASSIVE for each in self.leaders) - 1
            for each in self.leaders:
                each.tick(others, self.now)
                if self.now - self.spoken[each.me.id] >= 1.0:
                    self.spoken[each.me.id] = self.now
                    for other in () if cut else self.leaders:
                        other.hear(each.me, each.role, self.now)

    @property
    def leading(self):
        return [each.me.id for each in self.leaders if each.role is Role.LEADING]


@pytest.fixture
def fleet():
    return Fleet()


def test_finding_22_an_allocator_alone_leads_after_a_moment(fleet):
    fleet.start(1, 'a')
    assert fleet.leading == []
    fleet.run(LISTEN + STEP)
    assert fleet.leading == ['a']


def test_finding_22_a_restarted_one_leads_soon_unless_a_uav_has_a_list_of_another(fleet):
    leader = Leader(AllocatorInstance(1, 'a', '/a'), fleet.now, restarted=True)
    leader.tick(0, fleet.now + SETTLE)
    assert leader.role is Role.LEADING
    leader.tick(0, fleet.now + SETTLE + STEP, strange=True)
    assert leader.role is Role.STARTING
    leader.tick(0, fleet.now + LISTEN - STEP, strange=True)
    assert leader.role is Role.STARTING
    leader.tick(0, fleet.now + LISTEN, strange=True)
    assert leader.role is Role.LEADING


@pytest.mark.parametrize('started', [2, 1, 0])  # 0: a computer whose clock is behind
def test_finding_22_whoever_leads_already_stays(fleet, started):
    fleet.start(1, 'b')
    fleet.run(5.0)
    late = fleet.start(started, 'a')
    fleet.run(5.0)
    assert fleet.leading == ['b']
    assert late.trouble(fleet.now) == (
        'passive: another allocator leads this fleet: /b (instance b, started '
        '1970-01-01T00:00:00+00:00); this one publishes nothing until it is restarted')


@pytest.mark.parametrize('order', permutations([(1, 'b'), (2, 'a'), (2, 'c')]))
def test_finding_22_of_those_that_start_at_once_the_earliest_leads(fleet, order):
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
    assert passive.trouble(fleet.now).endswith('that one was not heard for 30 s')
    fleet.start(3, 'a2')
    fleet.run(2.0)
    assert fleet.leading == ['a2']


def test_finding_22_a_publisher_that_says_nothing_delays_a_start_only(fleet):
    leader = fleet.start(1, 'a')
    while fleet.now < 100.0 + WAIT - STEP:
        fleet.now += STEP
        leader.tick(1, fleet.now)
        assert leader.role is Role.STARTING
    leader.tick(1, 100.0 + WAIT)
    assert (leader.role, leader.silent_others) == (Role.LEADING, True)


def test_finding_22_an_allocator_whose_journal_is_in_use_never_leads(fleet):
    leader = fleet.start(1, 'a')
    leader.refuse('journal.sqlite3 cannot be opened: database is locked', fleet.now)
    fleet.run(2.0)
    assert fleet.leading == []
    assert 'database is locked' in leader.trouble(fleet.now)


def test_finding_22_what_an_allocator_tells_is_read_by_its_fleet_only():
    me = AllocatorInstance(17, 'a1', '/north/allocator')
    words = {key: str(value) for key, value in
             told(me, Role.LEADING, '/north/allocation').items()}
    assert heard('/north/allocator', words, '/north/allocation') == (me, Role.LEADING)
    assert heard('/north/allocator', words, '/south/allocation') is None
    assert heard('/bridge', {}, '/north/allocation') is None


@pytest.mark.parametrize(('key', 'value'), [
    ('started', '²'), ('started', '-1'), ('started', ''), ('started', '9' * 5000),
    ('instance', ''), ('instance', 'x' * 201), ('role', 'king')])
def test_finding_22_hostile_words_are_refused(key, value):
    words = {key: str(value) for key, value in
             told(AllocatorInstance(1, 'a', ''), Role.LEADING, '/allocation').items()}
    with pytest.raises(InvalidValue, match=key):
        heard('/allocator', {**words, key: value}, '/allocation')


def test_finding_22_any_start_time_that_is_read_can_be_shown():
    assert 'started 5138-' in AllocatorInstance(10**20 - 1, 'a', '/a').text
