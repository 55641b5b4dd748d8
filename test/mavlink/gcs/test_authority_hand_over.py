# SPDX-License-Identifier: Apache-2.0
"""`~/hand_over`: refused in each named case with its words, granted otherwise, and hold first."""
import pytest
from authority_bench import (
    BOTH,
    LONG,
    MODES,
    AuthorityBench,
    H,
    L,
    N,
    S,
    flying,
    in_flight,
    keeps_quiet,
    lost,
    on_ground,
    risen_by_pilot,
    shows,
    suspended,
)
from mission_bench import drop, task_list

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent, Suspension
from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState


def refused(bench, words):
    """Nothing changes, and nothing is sent."""
    state, start = bench.authority(), len(bench.sent)
    assert bench.hand_over() == words
    assert bench.authority() is state
    bench.run(limit=5.0)
    assert bench.commands(start) == []
    return True


@BOTH
@pytest.mark.parametrize('state', [S, L, N])
def test_it_is_refused_while_the_link_is_stale(kind, state):
    bench = in_flight(kind, state)
    bench.line.cut = True
    bench.run(limit=4.0)
    assert refused(bench, 'its link is stale')


@BOTH
@pytest.mark.parametrize('state', [S, L, N])
def test_it_is_refused_while_a_failsafe_is_active(kind, state):
    bench = in_flight(kind, state)
    bench.vehicles[1].failsafe('radio', None)
    bench.run(limit=2.0)
    assert refused(bench, 'a failsafe is active')


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_it_is_refused_on_a_low_battery(kind, state):
    bench = in_flight(kind, state)
    bench.vehicles[1].flight.body.battery = 0.195
    bench.run(limit=3.0)
    assert refused(bench, 'battery = 19%: expected at least 20%')


@BOTH
def test_it_is_refused_beside_a_foreign_mission(kind):
    bench = suspended(kind, Suspension.FOREIGN)
    assert refused(bench, 'the mission on board is foreign')
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    assert bench.becomes(L, 3.0)
    assert refused(bench, 'the mission on board is foreign')


@BOTH
def test_it_is_refused_while_traffic_is_avoided_or_something_else_suspends(kind):
    bench = flying(kind)
    bench.executor().authority.apply(AuthorityEvent.AVOIDING, bench.now, 'avoids')
    assert bench.hand_over() == 'SUSPENDED: avoids'


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_it_is_refused_on_the_ground_without_takeoff(kind, state):
    bench = on_ground(kind, state)
    bench.wants(takeoff=False)
    bench.run(limit=1.0)
    assert refused(bench, 'on the ground, and takeoff is false')


@BOTH
def test_it_is_refused_while_the_autopilot_starts(kind):
    bench = AuthorityBench(kind, configs={1: {'boot_delay': 30.0}}).discover()
    bench.run(limit=3.0)
    assert refused(bench, 'the autopilot is starting')


@BOTH
def test_it_is_refused_while_it_is_not_known_whether_it_flies(kind):
    bench = flying(kind)
    bench.line.tampers.append(drop({'EXTENDED_SYS_STATE', 'GLOBAL_POSITION_INT'}, 1 << 30))
    bench.dead_for(1.0, store=False)
    bench.run(limit=2.0)
    assert bench.hand_over() == 'not known whether it is in the air'


@BOTH
def test_what_is_ours_already_is_granted_and_nothing_changes(kind):
    bench = flying(kind)
    start = len(bench.sent)
    assert bench.hand_over() == ''
    bench.run(limit=10.0)
    assert bench.commands(start) == []
    assert shows(bench, H, 'takeoff is true')


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_in_flight_it_is_granted_and_holds_before_anything_else(kind, state):
    bench, modes = in_flight(kind, state), MODES[kind]
    start = len(bench.sent)
    assert bench.hand_over() == ''
    assert bench.run(lambda: len(bench.modes(start)) == 2, 20.0)
    assert shows(bench, H, 'handed over by test')
    assert bench.modes(start) == [modes.hold, modes.mission]
    first = bench.commands(start)[0]
    assert bench.executor().profile.commanded_mode(first) == modes.hold
    assert bench.run(lambda: len(bench.completed()) >= 2, 60.0)


@BOTH
@pytest.mark.parametrize('mode', ['mission', 'rtl', 'land', 'own'])
def test_from_any_mode_it_holds_first_though_its_list_is_verified(kind, mode):
    bench, modes = lost(kind), MODES[kind]
    bench.vehicles[1].rc_mode(modes.own)
    bench.run(limit=2.0)
    bench.vehicles[1].rc_mode(getattr(modes, mode))
    bench.run(limit=0.0)
    start = len(bench.sent)
    assert bench.hand_over() == ''
    assert bench.run(lambda: len(bench.modes(start)) >= 2, 20.0)
    assert bench.modes(start)[:2] == [modes.hold, modes.mission]


@BOTH
def test_with_a_new_list_waiting_it_holds_before_the_upload(kind):
    bench, modes = lost(kind), MODES[kind]
    bench.assign(task_list('ZYX', 2))
    bench.run(limit=3.0)
    start = len(bench.sent)
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.completed()[-3:] == ['Z', 'Y', 'X'], 200.0)
    kinds = [(m.get_type(), bench.executor().profile.commanded_mode(m))
             for _, what, m in bench.sent[start:] if what != 'read']
    assert kinds[0] == ('COMMAND_LONG', modes.hold)
    assert kinds[1][0] == 'MISSION_COUNT'


@BOTH
def test_a_hold_that_does_not_come_about_is_tried_again_and_nothing_else_is_done(kind):
    bench, modes = lost(kind), MODES[kind]
    bench.line.tampers.append(lambda way, m, now: [] if way == 'up' and (
        m.get_type() == 'COMMAND_LONG' and m.command == 176) else None)
    start = len(bench.sent)
    assert bench.hand_over() == ''
    bench.run(limit=40.0)
    assert set(bench.modes(start)) == {modes.hold}
    assert len(bench.modes(start)) >= 10
    bench.line.tampers.clear()
    assert bench.run(lambda: bench.modes(start)[-1] == modes.mission, 30.0)


@BOTH
def test_the_pilot_takes_it_again_right_after_a_hand_over(kind):
    bench, modes = lost(kind), MODES[kind]
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == modes.mission, 3.0)
    bench.run(limit=1.0)
    bench.vehicles[1].rc_mode(modes.stick)
    assert bench.becomes(L, 3.0)
    assert keeps_quiet(bench)


@BOTH
def test_killed_right_after_a_hand_over_it_still_holds_first(kind):
    bench, modes = lost(kind), MODES[kind]
    bench.line.tampers.append(lambda way, m, now: [] if way == 'up' and (
        m.get_type() == 'COMMAND_LONG' and m.command == 176) else None)
    assert bench.hand_over() == ''
    bench.run(limit=2.0)
    bench.dead_for(2.0)
    bench.line.tampers.clear()
    bench.run(limit=3.0)
    assert bench.authority() is H
    start = len(bench.sent)
    bench.assign(task_list(LONG, 2))
    assert bench.run(lambda: len(bench.modes(start)) == 2, 20.0)
    assert bench.modes(start) == [modes.hold, modes.mission]


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_on_the_ground_it_is_granted_and_takes_off(kind, state):
    bench = on_ground(kind, state)
    bench.wants(takeoff=True)
    assert bench.hand_over() == ''
    bench.run(limit=0.2)
    assert shows(bench, H, 'handed over by test')
    bench.assign(task_list('AB', 2))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@BOTH
def test_with_takeoff_false_a_hand_over_in_flight_counts_until_the_landing(kind):
    bench = risen_by_pilot(kind, 'A')
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.completed() == ['A'], 60.0)
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    assert bench.becomes(N, 3.0)
    assert keeps_quiet(bench, 20.0)


@BOTH
def test_nothing_that_was_sent_before_counts_after_a_hand_over(kind):
    bench, modes = flying(kind), MODES[kind]
    bench.assign(task_list('', 2))
    bench.run(limit=3.0)
    bench.vehicles[1].rc_mode(modes.stick)
    assert bench.becomes(L, 3.0)
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == modes.hold, 3.0)
    bench.run(limit=2.0)
    bench.vehicles[1].rc_mode(modes.rtl)
    assert bench.becomes(L, 3.0)
    assert bench.onboard().state is MissionState.VERIFIED
    assert keeps_quiet(bench, 20.0)
