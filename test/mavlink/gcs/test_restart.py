# SPDX-License-Identifier: Apache-2.0
"""A bridge killed and restarted: tasks flown meanwhile are detected, and not flown twice."""

import math
import random
from dataclasses import replace

import pytest
from authority_bench import MODES, flying as flying_held
from findings_bench import distance, drop_messages, flown_once_each
from flight_bench import FlightBench, flying, places
from mission_bench import REPORTS_STATE, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.status import UavMode
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task

AT_A = (0.0, 100.0, 50.0)
BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
PX4 = pytest.mark.parametrize('kind', ['px4'])


@BOTH
@pytest.mark.parametrize('moment', [0.5, 2.0, 6.0, 14.0, 22.0])
def test_a_killed_bridge_reads_each_onboard_mission_and_flies_no_task_twice(kind, moment):
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
def test_a_bridge_killed_during_an_upload_completes_it_after_the_restart(kind, moment):
    bench = flying(kind, 'ABC', delay=(0.05, 0.05), tick=0.05)
    bench.assign(task_list('CDEFAB', 2))
    bench.run(limit=moment)
    before = bench.completed()
    bench.start()
    bench.discover()
    bench.assign(task_list('CDEFAB', 2))
    assert bench.run(lambda: len(bench.completed()) == 6)
    assert before + bench.completed() == list('CDEFAB') == places(bench)


def dead_until(bench, count, rest=12.0):
    """Kill the bridge, and start a new one `rest` [s] after `count` items were reached."""
    bench.line.cut = True
    assert bench.run(lambda: len(bench.flown()) == count)
    bench.run(limit=rest)
    bench.line.cut = False
    bench.start()
    bench.discover()


def hand_over_in_hold(bench, n=1):
    """Hand over a PX4 that changed to Hold while no bridge ran (LOST)."""
    if bench.authority(n) is AuthorityState.LOST and bench.executor(n).telemetry.airborne:
        assert bench.executor(n).profile.name == 'px4'
        assert bench.executor(n).authority.why.endswith(
            ('the vehicle is in Hold', 'Hold instead of Mission'))
        assert bench.hand_over(n) == ''


@BOTH
@pytest.mark.parametrize('first', ['', 'X'])
def test_a_task_flown_while_no_bridge_ran_is_known_after_a_list_without_it(kind, first):
    bench = flying(kind, 'ABC', configs=REPORTS_STATE)
    bench.run(limit=1.5)  # a heartbeat has shown the mission mode
    dead_until(bench, 3)
    bench.assign(task_list(first, 2))  # the allocator has withdrawn the tasks meanwhile
    bench.run(limit=4.0)
    assert bench.authority() is AuthorityState.HELD
    bench.assign(task_list('CBDA', 3))
    hand_over_in_hold(bench)
    assert bench.run(lambda: len(bench.completed()) == 4)
    assert sorted(bench.completed()) == list('ABCD')
    assert bench.run(lambda: len(bench.flown()) == 4)
    assert places(bench) == list('ABCD')


@pytest.mark.parametrize(('known', 'flown_again'), [(True, []), (False, ['A', 'B', 'C'])])
def test_a_task_flown_while_no_bridge_ran_is_known_minutes_later_by_its_id(known, flown_again):
    bench = FlightBench('ardupilot', 'ardupilot').discover()
    bench.assign(task_list('ABC', service=1.0))
    bench.assign(task_list('X'), 2)
    assert bench.run(lambda: bench.started() == ['A'] and bench.started(2) == ['X'])
    bench.run(limit=1.5)  # a heartbeat has shown the mission mode
    dead_until(bench, 3)
    bench.assign(task_list('', 2))
    bench.assign(task_list('', 2), 2)
    bench.run(limit=150.0)
    tasks = task_list('CBDA', 3, service=1.0)
    if not known:  # other tasks at the same places
        tasks = TaskList(3, tuple(MissionStop(replace(stop.task, id=f'new {stop.task.id}'))
                                  for stop in tasks.stops))
    bench.assign(tasks, 2)
    assert bench.run(lambda: len(bench.completed(2)) == 4)
    assert bench.run(lambda: len(bench.flown(2)) == 2 + len(flown_again))
    assert sorted(places(bench, 2)[1:]) == sorted(['D', *flown_again])


@BOTH
def test_positions_lost_before_the_restart_do_not_count_as_the_time_without_a_bridge(kind):
    bench = flying(kind, 'EDC')
    bench.line.tampers.append(lambda direction, m, now: [] if (
        m.get_type() == 'GLOBAL_POSITION_INT' and not bench.flown()) else None)
    assert bench.run(lambda: bench.completed() == ['E'])
    bench.run(limit=1.0)
    dead_until(bench, 3, 2.0)  # for less time than the positions were lost before
    bench.assign(task_list('DCB', 2))
    bench.run(limit=4.0)
    hand_over_in_hold(bench)
    assert bench.run(lambda: len(bench.completed()) == 3)
    assert places(bench) == list('EDCB')


@pytest.mark.parametrize('kinds', [('ardupilot', 'px4'), ('px4', 'ardupilot')])
def test_a_task_flown_while_no_bridge_ran_is_not_flown_by_another_uav(kinds):
    bench = FlightBench(*kinds, configs=REPORTS_STATE).discover()
    bench.assign(task_list('ABC', service=1.0))
    bench.assign(task_list('X'), 2)
    assert bench.run(lambda: bench.started() == ['A'] and bench.started(2) == ['X'])
    dead_until(bench, 3)
    bench.assign(task_list('', 2))
    bench.assign(task_list('CBDA', 3, service=1.0), 2)
    assert bench.run(lambda: hand_over_in_hold(bench, 2) or (
        bench.authority(2) is AuthorityState.HELD), 10.0)
    assert bench.run(lambda: len(bench.completed(2)) == 4)
    assert bench.run(lambda: len(bench.flown(2)) == 2)
    assert places(bench, 2)[1:] == ['D']
    assert 'A was flown by uav_1 while the bridge was down' in bench.notes


@pytest.mark.parametrize('kinds', [('ardupilot', 'px4'), ('px4', 'ardupilot')])
@pytest.mark.parametrize(('unread', 'tasks', 'waits'), [
    (5.0, 'CBDA', True),  # its tasks went to another UAV before its mission was read
    (5.0, 'DE', False),  # others did
    (60.0, 'CBDA', False)])  # its mission cannot be read
def test_a_uav_waits_for_the_mission_of_the_one_that_may_have_flown_its_tasks(
        kinds, unread, tasks, waits):
    bench = FlightBench(*kinds, configs=REPORTS_STATE).discover()
    bench.assign(task_list('ABC', service=1.0))
    bench.assign(task_list('X'), 2)
    assert bench.run(lambda: bench.started() == ['A'] and bench.started(2) == ['X'])
    bench.run(limit=1.5)  # a heartbeat has shown the mission mode
    read_at = math.inf
    bench.line.tampers.append(lambda direction, m, now: [] if (
        direction == 'down' and m.get_type() == 'MISSION_COUNT' and m.count >= 3  # of uav_1
        and now < read_at) else None)
    dead_until(bench, 3)
    read_at = bench.now + unread
    bench.assign(task_list('', 2))
    bench.assign(task_list(tasks, 3, service=1.0), 2)
    assert bench.run(lambda: hand_over_in_hold(bench, 2) or (
        bench.authority(2) is AuthorityState.HELD), 2.0)
    bench.run(limit=2.5 if unread < 10.0 else 11.0)
    sent = [m for m in bench.line.sent('MISSION_COUNT') if m.target_system == 2]
    assert (len(sent) == 1) is waits  # that of 'X'
    assert bench.run(lambda: len(bench.completed(2)) == len(tasks))
    if waits:
        assert bench.run(lambda: 'D' in places(bench, 2))
        assert not set('ABC').intersection(places(bench, 2))


@BOTH
def test_a_withdrawn_task_is_flown_when_it_is_assigned_to_another_uav(kind):
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
def test_a_task_flown_while_no_bridge_ran_is_flown_again_when_its_position_changes(kind):
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
def test_a_first_list_on_the_ground_is_flown_even_if_it_is_on_board_already(kind):
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


class RandomAllocator:
    """Assigns open tasks to two UAVs at random, and withdraws completed ones."""

    def __init__(self, bench, names, rng):
        self.bench, self.names, self.rng = bench, names, rng
        self.done, self.lists, self.revision = set(), {1: [], 2: []}, 1

    def update(self):
        for n in self.lists:
            hand_over_in_hold(self.bench, n)
            self.done |= {*self.bench.completed(n)}
        for n, tasks in self.lists.items():
            if any(t in self.done and t not in self.bench.completed(n) for t in tasks):
                self.send(n, [t for t in tasks if t not in self.done])
        return self.done == set(self.names)

    def assign(self):
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
def test_killed_at_random_and_reassigned_each_task_is_flown_once(kind, seed):
    rng = random.Random(seed)
    other = {'ardupilot': 'px4', 'px4': 'ardupilot'}[kind]
    bench = FlightBench(kind, other, seed=seed, delay=(0.02, 0.02), configs=REPORTS_STATE)
    bench.discover()
    allocator = RandomAllocator(bench, 'ABCDEFGH', rng)
    allocator.assign()
    for _ in range(3):
        bench.run(allocator.update, rng.uniform(8.0, 25.0))
        bench.line.cut = True
        bench.run(limit=rng.uniform(0.5, 30.0))
        bench.line.cut = False
        bench.start()
        bench.discover()
        allocator.assign()
        bench.run(allocator.update, rng.uniform(0.0, 3.0))
        allocator.assign()
    assert bench.run(allocator.update)
    bench.run(limit=5.0)
    assert sorted(places(bench) + places(bench, 2)) == list('ABCDEFGH'), f'seed {seed}'


@PX4
@pytest.mark.parametrize('store', [True, False])
def test_a_hold_by_a_pilot_at_the_last_item_completes_nothing_after_a_restart(kind, store):
    bench = flying_held(kind, 'A')
    bench.assign(task_list('A', 2, service=5.0))
    assert bench.run(lambda: distance(bench, AT_A) < 0.1)
    bench.vehicles[1].rc_mode(MODES[kind].hold)
    bench.run(limit=2.0)
    bench.kill_and_restart(0.0, store)
    bench.assign(task_list('A', 3, service=5.0))
    bench.run(limit=10.0)
    assert bench.completed() == places(bench) == []
    assert bench.hand_over() == ''
    flown_once_each(bench, 'A')


@PX4
def test_a_repetition_after_a_restart_completes_nothing_of_the_mission_on_board(kind):
    bench = flying_held(kind, 'AB')
    assert bench.run(lambda: places(bench) == ['A'])
    ahead = (40.0, 100.0, 50.0)
    tasks = TaskList(2, (MissionStop(Task('X', ahead)), *task_list('BC').stops))
    for message in ('MISSION_COUNT', 'MISSION_ACK', 'GLOBAL_POSITION_INT'):
        drop_messages(bench, 'down', message, lambda m: distance(bench, ahead) > 14.0)
    bench.assign(tasks)
    assert bench.run(lambda: len(bench.vehicles[1].flight.items) == 3, 3.0)
    bench.kill_and_restart(0.0)
    seen = bench.executor().telemetry
    drop_messages(bench, 'down', 'MISSION_ITEM_REACHED', lambda m: seen.mission.current is None)
    drop_messages(bench, 'down', 'MISSION_CURRENT',
                  lambda m: d.MAVLINK_MSG_ID_MISSION_ITEM_REACHED in seen.received_ids)
    bench.assign(tasks)
    assert bench.run(lambda: bench.onboard().held is not None, 20.0)
    assert places(bench) == ['A']
    assert bench.completed() == []
    bench.line.tampers.clear()
    assert bench.run(lambda: len(bench.completed()) == 3, 100.0)
