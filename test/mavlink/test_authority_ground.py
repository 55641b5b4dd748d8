# SPDX-License-Identifier: Apache-2.0
"""`takeoff`, `relaunch`, arming, landing, and an autopilot of unknown kind."""
import pytest
from authority_bench import (
    ARDUPILOT,
    BOTH,
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
    shows,
)
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

BY_HAND = '; given back by ~/hand_over'


def armed_by_us(bench):
    """Waiting on the ground while its take-off command is lost."""
    bench.line.tampers.append(lambda way, m, now: [] if way == 'up' and (
        m.get_type() == 'COMMAND_LONG' and m.command == d.MAV_CMD_NAV_TAKEOFF) else None)
    bench.assign(task_list('AB', 2))
    assert bench.run(lambda: bench.vehicles[1].flight.armed, 10.0)
    bench.run(limit=2.5)
    assert bench.authority() is H
    return bench


# takeoff becomes true

@BOTH
@pytest.mark.parametrize('state', [H, S, L])
def test_takeoff_set_to_true_gives_it_only_to_who_never_had_it(kind, state):
    bench = on_ground(kind, state)
    for takeoff in (False, True, False, True):
        bench.pilot().watch._takeoff = takeoff = True if state is H else takeoff
        bench.wants(takeoff=takeoff)
        bench.run(limit=2.0)
    assert bench.authority() is state
    if state is not H:
        assert keeps_quiet(bench, 20.0)


@BOTH
def test_takeoff_set_to_true_on_the_ground_grants_it(kind):
    bench = on_ground(kind, N)
    assert shows(bench, N, 'never granted')
    bench.wants(takeoff=True)
    bench.run(limit=0.3)
    assert shows(bench, H, 'takeoff is true')
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@BOTH
def test_nothing_is_granted_before_the_end_of_the_boot(kind):
    bench = AuthorityBench(kind, configs={1: {'boot_delay': 15.0}}).found()
    bench.assign(task_list('AB'))
    bench.run(lambda: bench.now >= 14.0)
    assert bench.authority() is N
    assert bench.commands() == []
    assert bench.becomes(H, 5.0)


@BOTH
def test_nothing_is_granted_in_the_air_nor_to_one_that_is_armed(kind):
    bench = in_flight(kind, N)
    bench.wants(takeoff=True)
    assert keeps_quiet(bench)
    bench = on_ground(kind, N)
    bench.vehicles[1].rc_arm(True)
    bench.run(limit=1.5)
    bench.wants(takeoff=True)
    bench.run(limit=4.0)
    assert bench.authority() is N
    assert bench.commands() == []


# takeoff becomes false

@BOTH
@pytest.mark.parametrize('relaunch', ['operator', 'automatic'])
def test_takeoff_set_to_false_in_the_air_counts_from_the_landing_on(kind, relaunch):
    bench = flying(kind, 'AB', relaunch=relaunch)
    bench.wants(takeoff=False)
    bench.run(limit=1.0)
    assert shows(bench, H)
    bench.vehicles[1].failsafe('radio', None)
    assert bench.becomes(S)
    bench.run(limit=6.5)
    bench.vehicles[1].failsafe_over()
    assert bench.becomes(H)
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 60.0)
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    assert bench.becomes(N, 3.0)
    assert keeps_quiet(bench)
    assert shows(bench, N, 'landed')


@BOTH
def test_takeoff_set_to_false_and_true_again_in_the_air_changes_nothing(kind):
    bench = flying(kind, 'AB', relaunch='automatic')
    bench.wants(takeoff=False)
    bench.run(limit=1.0)
    bench.wants(takeoff=True)
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    bench.run(limit=2.0)
    assert shows(bench, H)


@BOTH
def test_takeoff_set_to_false_on_the_ground_ends_it(kind):
    bench = on_ground(kind, H)
    bench.wants(takeoff=False)
    bench.run(limit=0.2)
    assert shows(bench, N, 'takeoff is false')
    assert keeps_quiet(bench)


@BOTH
@pytest.mark.parametrize('armed', [False, True])
def test_takeoff_set_to_false_drops_a_pending_arming_and_take_off(kind, armed):
    if armed:
        bench = armed_by_us(on_ground(kind, H))
    else:
        bench = on_ground(kind, H)
        bench.vehicles[1].flight.refuses = 'Gyros inconsistent'
        bench.assign(task_list('AB', 2))
        bench.run(limit=8.0)
        assert bench.pilot().helm.busy
    bench.wants(takeoff=False)
    bench.run(limit=0.2)
    assert bench.authority() is N
    bench.vehicles[1].flight.refuses = ''
    assert keeps_quiet(bench)
    assert not bench.vehicles[1].flight.armed


@BOTH
@pytest.mark.parametrize('cause', ['link', 'failsafe'])
def test_takeoff_set_to_false_while_it_is_suspended_counts_afterwards(kind, cause):
    bench = on_ground(kind, H)
    if cause == 'link':
        bench.line.cut = True
    else:
        bench.vehicles[1].failsafe('radio', None)
    assert bench.becomes(S, 5.0)
    bench.wants(takeoff=False)
    bench.run(limit=3.0)
    assert bench.authority() is S
    bench.line.cut = False
    bench.vehicles[1].failsafe_over()
    assert bench.becomes(N, 3.0)
    assert keeps_quiet(bench)
    assert bench.commands() == []


@BOTH
def test_takeoff_set_to_false_while_no_bridge_was_there_ends_it_on_the_ground(kind):
    bench = on_ground(kind, H)
    bench.policy = type(bench.policy)(takeoff=False)
    bench.dead_for(3.0)
    bench.run(limit=2.0)
    assert shows(bench, N, 'takeoff is false')
    assert keeps_quiet(bench)


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_takeoff_set_to_false_changes_nothing_where_it_is_not_ours(kind, state):
    bench = in_flight(kind, state)
    bench.wants(takeoff=True)
    bench.run(limit=1.0)
    bench.wants(takeoff=False)
    bench.run(limit=2.0)
    assert bench.authority() is state
    assert keeps_quiet(bench, 20.0)


# landing, relaunch

@BOTH
@pytest.mark.parametrize('end', ['item', 'mode'])
@pytest.mark.parametrize('relaunch', ['operator', 'automatic'])
def test_after_our_landing_it_starts_again_as_relaunch_says(kind, relaunch, end):
    bench = AuthorityBench(kind, relaunch=relaunch).found()
    bench.assign(task_list('A', returns=end == 'item'))
    assert bench.run(lambda: bench.completed() == ['A'], 60.0)
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    bench.run(limit=5.0)
    if relaunch == 'operator':
        assert shows(bench, N, 'landed')
        assert bench.state().reason.endswith(BY_HAND)
        assert keeps_quiet(bench)
        for takeoff in (False, True):
            bench.wants(takeoff=takeoff)
            bench.run(limit=2.0)
        assert shows(bench, N)
        assert 'waits for ~/hand_over: it has landed' in bench.notes
        assert bench.hand_over() == ''
    assert bench.authority() is H
    bench.assign(task_list('B', 9))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@BOTH
def test_after_a_landing_a_restarted_bridge_waits_for_the_hand_over_too(kind):
    bench = flying(kind, 'A')
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    bench.run(limit=3.0)
    bench.dead_for(3.0)
    assert keeps_quiet(bench)
    assert bench.state().reason.endswith(BY_HAND)


@BOTH
def test_while_it_is_suspended_a_landing_of_ours_is_a_loss(kind):
    bench = flying(kind, 'A')
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == MODES[kind].rtl, 60.0)
    bench.run(limit=2.0)
    bench.vehicles[1].failsafe('radio', None)
    assert bench.becomes(S)
    assert bench.becomes(L, 60.0)
    assert keeps_quiet(bench, 20.0)


@BOTH
@pytest.mark.parametrize('relaunch', ['operator', 'automatic'])
def test_a_landing_of_the_pilot_gives_nothing(kind, relaunch):
    bench = lost(kind, relaunch=relaunch)
    bench.vehicles[1].rc_mode(MODES[kind].land)
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    assert keeps_quiet(bench)
    assert bench.authority() is L


# arming by others

@BOTH
@pytest.mark.parametrize('state', [H, S])
def test_armed_by_another_it_is_a_loss(kind, state):
    bench = on_ground(kind, state)
    bench.vehicles[1].rc_arm(True)
    assert bench.becomes(L, 3.0)
    assert shows(bench, L, 'armed, not by the bridge')
    assert keeps_quiet(bench)


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_armed_and_disarmed_by_another_changes_nothing_where_it_is_not_ours(kind, state):
    bench = on_ground(kind, state)
    for armed in (True, False):
        bench.vehicles[1].rc_arm(armed)
        bench.run(limit=3.0)
        assert bench.authority() is state
    assert keeps_quiet(bench, 20.0)


@BOTH
def test_disarmed_by_another_after_our_arming_it_is_a_loss(kind):
    bench = armed_by_us(on_ground(kind, H))
    bench.vehicles[1].rc_arm(False)
    assert bench.run(lambda: bench.authority() is L, 3.0)
    assert keeps_quiet(bench)
    assert shows(bench, L, 'disarmed, not by the bridge')


@BOTH
def test_a_vehicle_that_disarms_itself_before_its_take_off_is_a_loss(kind):
    bench = armed_by_us(on_ground(kind, H))
    bench.line.tampers.append(lambda way, m, now: [] if way == 'up' and (
        m.get_type() == 'COMMAND_LONG' and m.command == 400) else None)
    assert bench.run(lambda: bench.authority() is L, 20.0)
    assert keeps_quiet(bench)
    assert shows(bench, L, 'disarmed, not by the bridge')


@BOTH
def test_an_arming_of_ours_that_comes_late_gives_nothing_back(kind):
    bench = on_ground(kind, H)
    bench.line.tampers.append(lambda way, m, now: [(5.0, m)] if way == 'up' and (
        m.get_type() == 'COMMAND_LONG' and m.command == 400) else None)
    bench.assign(task_list('AB', 2))
    bench.run(limit=1.5)
    bench.wants(takeoff=False)
    bench.run(limit=0.2)
    assert bench.authority() is N
    assert keeps_quiet(bench)


# an autopilot of unknown kind

def unknown(**kwargs):
    """Its heartbeat names no autopilot that the bridge knows."""
    bench = AuthorityBench('ardupilot', **kwargs)

    def rename(way, m, now):
        if m.get_type() == 'HEARTBEAT' and way == 'down':
            m.autopilot = d.MAV_AUTOPILOT_GENERIC
    bench.line.tampers.append(rename)
    bench.found()
    assert bench.pilot().profile.name == 'generic'
    return bench


@ARDUPILOT
def test_an_unknown_autopilot_is_ours_by_takeoff_whatever_its_modes(kind):
    bench = unknown()
    assert bench.becomes(H)
    for mode in (5, 4, 3, 6, 17, 0):
        bench.vehicles[1].rc_mode(mode)
        bench.run(limit=8.0)
        assert shows(bench, H)


@ARDUPILOT
def test_an_unknown_autopilot_is_ours_by_a_hand_over_and_never_by_a_mode(kind):
    bench = unknown(takeoff=False)
    vehicle = bench.vehicles[1]
    vehicle.rc_mode(5)
    vehicle.rc_arm(True)
    vehicle.rc_stick((0.0, 0.0, 3.0))
    bench.run(limit=12.0)
    vehicle.rc_stick(None)
    for mode in (4, 3, 5, 4):
        vehicle.rc_mode(mode)
        bench.run(limit=8.0)
        assert shows(bench, N)
    assert bench.hand_over() == ''
    bench.run(limit=1.0)
    assert shows(bench, H, 'handed over by test')
    vehicle.rc_mode(5)
    bench.run(limit=3.0)
    assert bench.authority() is H
    vehicle.failsafe('radio', None)
    assert bench.becomes(S)
    vehicle.kill_switch()
    assert bench.becomes(L)
