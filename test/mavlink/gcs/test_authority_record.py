# SPDX-License-Identifier: Apache-2.0
"""A bridge restarted without its record, and when the record is saved."""
from dataclasses import replace

import pytest
from authority_bench import (
    ARDUPILOT,
    BOTH,
    COPTER,
    MODES,
    AuthorityBench,
    H,
    L,
    N,
    Store,
    flying,
    is_command,
    on_ground,
    sends_no_command,
    status_is,
    upload_by_another,
)
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

# without a record

@BOTH
def test_without_a_record_on_the_ground_it_is_granted_again(kind):
    bench = on_ground(kind, L)
    bench.kill_and_restart(1.0, store=False)
    bench.run(limit=2.0)
    assert status_is(bench, H, 'takeoff is true')


@BOTH
def test_without_a_record_airborne_with_our_mission_it_is_held(kind):
    bench = flying(kind)
    bench.kill_and_restart(1.0, store=False)
    assert not bench.state().available
    bench.run(limit=3.0)
    assert status_is(bench, L, 'airborne in ')
    bench.assign(task_list('ABCDEFGHIJKLMNOPQRSTUVWXY', 2))
    assert bench.reaches(H, 5.0)
    assert status_is(bench, H, 'flies our mission')
    start = len(bench.sent)
    bench.run(limit=15.0)
    assert bench.modes(start) == []


@BOTH
@pytest.mark.parametrize('mission', ['other list', 'foreign'])
def test_without_a_record_airborne_with_another_mission_it_is_lost(kind, mission):
    bench = flying(kind)
    if mission == 'foreign':
        upload_by_another(bench, items=20)
    bench.kill_and_restart(1.0, store=False)
    bench.run(limit=3.0)
    assert sends_no_command(bench, names='ZZZ' if mission == 'other list' else 'ABC')
    assert status_is(bench, L, 'airborne in ')


@BOTH
@pytest.mark.parametrize('mode', ['stick', 'rtl'])
def test_without_a_record_airborne_in_a_mode_that_was_set_in_a_cut_it_is_lost(kind, mode):
    bench = flying(kind)
    bench.kill_and_restart(1.0, store=False)
    bench.run(limit=3.0)
    assert status_is(bench, L, 'airborne in ')
    bench.line.cut = True
    bench.vehicles[1].rc_mode(getattr(MODES[kind], mode))
    bench.run(limit=5.0)
    bench.line.cut = False
    assert sends_no_command(bench, names='ABC')
    assert bench.authority() is L


@BOTH
@pytest.mark.parametrize('mode', ['hold', 'stick', 'rtl'])
def test_without_a_record_airborne_in_another_mode_it_is_lost(kind, mode):
    bench = flying(kind)
    bench.vehicles[1].rc_mode(getattr(MODES[kind], mode))
    bench.kill_and_restart(1.0, store=False)
    bench.run(limit=3.0)
    assert status_is(bench, L, 'airborne in ')
    assert sends_no_command(bench, names='ABC')


@BOTH
def test_without_a_record_the_authority_is_unknown_until_it_reports_its_position(kind):
    bench = flying(kind)
    bench.line.tampers.append(lambda direction, m, now: [] if (
        direction == 'down' and m.get_type() not in (
            'HEARTBEAT', 'MISSION_COUNT', 'MISSION_ITEM_INT')) else None)
    bench.kill_and_restart(1.0, store=False)
    start = len(bench.sent)
    bench.assign(task_list('ABC', 2))
    bench.run(limit=20.0)
    status = bench.state()
    assert status.authority.name == 'UNKNOWN'
    assert status.reason == 'its authority is not known yet'
    assert {action for _, action, _ in bench.sent[start:]} <= {'read'}


@BOTH
def test_without_a_record_armed_on_the_ground_nothing_is_granted(kind):
    bench = on_ground(kind, H)
    bench.vehicles[1].rc_arm(True)
    bench.kill_and_restart(0.0, store=False)
    bench.run(limit=5.0)
    assert status_is(bench, N)
    assert sends_no_command(bench, 4.0)


# when the record is saved

class Log(Store):
    """Counts how many messages had been sent when a record was saved."""

    def __init__(self):
        super().__init__()
        self.saves, self.line = [], None

    def save(self, uav_id, record):
        super().save(uav_id, record)
        self.saves.append((len(self.line.log) if self.line else 0, record))


@BOTH
def test_each_command_is_saved_before_it_is_sent(kind):
    store = Log()
    bench = AuthorityBench(kind, store=store, relaunch='automatic')
    store.line = bench.line
    bench.discover()
    bench.assign(task_list('ABC'))
    assert bench.run(lambda: bench.started() == ['A'])
    bench.run(limit=3.0)
    bench.assign(task_list('CA', 2))
    assert bench.run(lambda: bench.completed() == ['C', 'A'])
    bench.assign(task_list('', 3, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    seen, profile = set(), bench.executor().profile
    for at, (_, direction, m) in enumerate(bench.line.log):
        before = [record for size, record in store.saves if size <= at]
        if direction != 'up' or m.get_type() != 'COMMAND_LONG':
            continue
        mode = profile.commanded_mode(m)
        if mode is not None:
            assert mode in before[-1].commanded
            seen.add('mode')
        elif m.command == d.MAV_CMD_COMPONENT_ARM_DISARM and m.param1 == 1.0:
            assert before[-1].arming
            seen.add('arm')
        elif m.command == d.MAV_CMD_NAV_TAKEOFF:
            assert before[-1].climb == 50.0 or kind == 'ardupilot'
            seen.add('climb')
    assert seen == {'mode', 'arm', 'climb'}
    assert {record.state for _, record in store.saves} == {H, N}


@ARDUPILOT
def test_a_replacement_is_saved_before_the_hold_is_sent(kind):
    store = Log()
    bench = flying(kind, store=store)
    store.line = bench.line
    start = len(bench.line.log)
    bench.assign(task_list('ZYX', 2))
    bench.run(limit=5.0)
    at = next(n for n, (_, direction, m) in enumerate(bench.line.log) if n >= start
              and direction == 'up' and is_command(m, d.MAV_CMD_DO_SET_MODE))
    before = [record for size, record in store.saves if size <= at][-1]
    assert (before.replacing_since, before.commanded) == (bench.line.log[at][0], (COPTER.hold,))


@BOTH
def test_a_loss_is_saved_at_once(kind):
    bench = flying(kind)
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    assert bench.run(lambda: bench.authority() is L, 3.0)
    record = bench.store.load('uav_1')
    assert (record.state, record.mode, record.why) == (
        L, MODES[kind].stick, bench.executor().authority.why)
    assert record == replace(record, commanded=(), arming=False, replacing_since=None)
