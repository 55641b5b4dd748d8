# SPDX-License-Identifier: Apache-2.0
"""A bridge killed and started again: what was flown is found, and not flown twice."""

import random
from dataclasses import replace

import pytest
from flight_bench import FlightBench, flying, places
from mission_bench import task_list

from uav_task_alloc.mavlink.gcs.authority import AuthorityState
from uav_task_alloc.mavlink.gcs.status import UavMode
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


@BOTH
@pytest.mark.parametrize('moment', [0.5, 2.0, 6.0, 14.0, 22.0])
def test_a_killed_bridge_finds_what_each_vehicle_holds_and_flies_no_task_twice(kind, moment):
    bench = flying(kind, 'ABCDE')
    bench.run(limit=moment)
    before = bench.completed()
    counts = len(bench.line.sent('MISSION_COUNT'))
    bench.start()
    bench.run(limit=8.0)
    bench.discover()
    rest = [t for t in 'ABCDE' if t not in before]
    bench.assign(task_list(rest, 5))
    assert bench.run(lambda: len(bench.completed()) == len(rest))
    assert before + bench.completed() == list('ABCDE') == places(bench)
    assert len(bench.line.sent('MISSION_COUNT')) == counts  # nothing differed


@BOTH
def test_a_task_flown_while_the_bridge_was_dead_is_completed_under_a_new_list(kind):
    bench = flying(kind, 'ABCDE')
    assert bench.run(lambda: bench.completed() == ['A'])
    bench.line.cut = True
    bench.run(lambda: len(bench.flown()) == 3)
    bench.line.cut = False
    bench.start()
    bench.discover()
    bench.assign(task_list('EDCB', 2))
    assert bench.run(lambda: len(bench.completed()) == 4)
    assert bench.completed() == ['C', 'B', 'E', 'D']
    assert places(bench) == list('ABCED')


@BOTH
@pytest.mark.parametrize('moment', [0.2, 0.4, 0.8, 1.2])
def test_a_bridge_killed_in_mid_upload_brings_the_list_on_board(kind, moment):
    bench = flying(kind, 'ABC', delay=(0.05, 0.05), tick=0.05)
    bench.assign(task_list('CDEFAB', 2))
    bench.run(limit=moment)
    before = bench.completed()
    bench.start()
    bench.discover()
    bench.assign(task_list('CDEFAB', 2))
    assert bench.run(lambda: len(bench.completed()) == 6)
    assert before + bench.completed() == list('CDEFAB') == places(bench)


def dead_until(bench, count):
    """The bridge is killed, the vehicles fly on; a new one starts once so many were reached."""
    bench.line.cut = True
    assert bench.run(lambda: len(bench.flown()) == count)
    bench.run(limit=12.0)
    bench.line.cut = False
    bench.start()
    bench.discover()


def handed_over_where_it_held(bench, n=1):
    """PX4 went to Hold while no bridge was there to see why: an operator gives it back."""
    if bench.authority(n) is AuthorityState.LOST and bench.executor(n).telemetry.airborne:
        assert bench.executor(n).profile.name == 'px4'
        assert bench.executor(n).authority.why.endswith(('the vehicle is in Hold', 'Hold instead of Mission'))
        assert bench.hand_over(n) == ''


@BOTH
@pytest.mark.parametrize('first', ['', 'X'])
def test_what_was_flown_unheard_is_known_after_a_list_without_it(kind, first):
    bench = flying(kind, 'ABC')
    bench.run(limit=1.5)  # a heartbeat has shown the mission mode
    dead_until(bench, 3)
    bench.assign(task_list(first, 2))  # the allocator has given it up meanwhile
    bench.run(limit=4.0)
    assert bench.authority() is (AuthorityState.LOST if kind == 'px4' else AuthorityState.HELD)
    bench.assign(task_list('CBDA', 3))
    handed_over_where_it_held(bench)
    assert bench.run(lambda: len(bench.completed()) == 4)
    assert sorted(bench.completed()) == list('ABCD')
    assert bench.run(lambda: len(bench.flown()) == 4)
    assert places(bench) == list('ABCD')


@pytest.mark.parametrize('kinds', [('ardupilot', 'px4'), ('px4', 'ardupilot')])
def test_what_one_has_flown_unheard_is_not_flown_by_another(kinds):
    bench = FlightBench(*kinds).discover()
    bench.assign(task_list('ABC', service=1.0))
    bench.assign(task_list('X'), 2)
    assert bench.run(lambda: bench.started() == ['A'] and bench.started(2) == ['X'])
    dead_until(bench, 3)
    bench.assign(task_list('', 2))
    bench.assign(task_list('CBDA', 3, service=1.0), 2)
    assert bench.run(lambda: handed_over_where_it_held(bench, 2) or (
        bench.authority(2) is AuthorityState.HELD), 10.0)
    assert bench.run(lambda: len(bench.completed(2)) == 4)
    assert bench.run(lambda: len(bench.flown(2)) == 2)
    assert places(bench, 2)[1:] == ['D']
    assert 'A was flown by uav_1, unheard' in bench.notes


@BOTH
def test_what_was_withdrawn_unflown_is_flown_when_it_comes_back_to_another(kind):
    bench = FlightBench(kind, kind).discover()
    bench.assign(task_list('ABC'))
    bench.assign(task_list('X'), 2)
    assert bench.run(lambda: bench.started() == ['A'])
    bench.line.cut = True
    bench.run(limit=1.0)
    bench.line.cut = False
    bench.start()
    bench.discover()
    bench.assign(task_list('C', 2))
    bench.assign(task_list('XAB', 2), 2)
    assert bench.run(lambda: bench.completed() == ['C'] and len(bench.completed(2)) == 3)
    assert places(bench) == ['C']
    assert sorted(places(bench, 2)) == list('ABX')


@BOTH
def test_what_was_flown_unheard_is_flown_again_where_its_place_has_changed(kind):
    bench = flying(kind, 'ABC')
    assert bench.run(lambda: bench.completed() == ['A'])
    bench.start()
    bench.discover()
    bench.assign(task_list('ABC', 2))
    assert bench.run(lambda: 'A' in bench.completed())
    assert next(e.revision for _, e in bench.events if e.event == 'COMPLETED') == 2
    tasks = task_list('AC', 3)
    moved = MissionStop(replace(tasks.stops[0].task, position=(350.0, 350.0, 50.0)))
    bench.assign(TaskList(3, (moved, tasks.stops[1])))
    assert bench.run(lambda: bench.completed().count('A') == 2)
    assert (350, 350, 50) in bench.flown()


@BOTH
def test_a_first_list_on_the_ground_is_flown_though_the_same_is_on_board(kind):
    bench = FlightBench(kind, relaunch='automatic').discover()
    bench.assign(task_list('AB', returns=True))
    assert bench.run(lambda: bench.completed() == ['A', 'B'])
    assert bench.run(lambda: bench.state().mode is UavMode.STANDBY)
    bench.start()
    bench.discover()
    bench.run(limit=5.0)
    bench.assign(task_list('AB', returns=True))
    assert bench.run(lambda: bench.completed() == ['A', 'B'])
    assert bench.run(lambda: places(bench) == list('ABAB'), 1.0)


class Dealer:
    """A careless allocator: deals what is not completed at random, takes back what is."""

    def __init__(self, bench, names, rng):
        self.bench, self.names, self.rng = bench, names, rng
        self.done, self.lists, self.revision = set(), {1: [], 2: []}, 1

    def hear(self):
        for n in self.lists:
            handed_over_where_it_held(self.bench, n)
            self.done |= {*self.bench.completed(n)}
        for n, tasks in self.lists.items():
            if any(t in self.done and t not in self.bench.completed(n) for t in tasks):
                self.send(n, [t for t in tasks if t not in self.done])
        return self.done == set(self.names)

    def deal(self):
        left = [t for t in self.names if t not in self.done]
        self.rng.shuffle(left)
        cut = self.rng.randint(0, len(left))
        self.send(1, left[:cut])
        self.send(2, left[cut:])

    def send(self, n, tasks):
        self.revision += 1
        self.lists[n] = tasks
        self.bench.assign(task_list(tasks, self.revision), n)


@BOTH
@pytest.mark.parametrize('seed', range(20))
def test_killed_at_random_and_dealt_anew_each_task_is_flown_once(kind, seed):
    rng = random.Random(seed)
    other = {'ardupilot': 'px4', 'px4': 'ardupilot'}[kind]
    bench = FlightBench(kind, other, seed=seed, delay=(0.02, 0.02)).discover()
    dealer = Dealer(bench, 'ABCDEFGH', rng)
    dealer.deal()
    for _ in range(3):
        bench.run(dealer.hear, rng.uniform(8.0, 25.0))
        bench.line.cut = True
        bench.run(limit=rng.uniform(0.5, 30.0))
        bench.line.cut = False
        bench.start()
        bench.discover()
        dealer.deal()
        bench.run(dealer.hear, rng.uniform(0.0, 3.0))
        dealer.deal()
    assert bench.run(dealer.hear)
    bench.run(limit=5.0)
    assert sorted(places(bench) + places(bench, 2)) == list('ABCDEFGH'), f'seed {seed}'
