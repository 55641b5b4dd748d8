# SPDX-License-Identifier: Apache-2.0
"""`takeoff` becomes true and false, and an autopilot of unknown kind."""
import pytest
from authority_bench import (
    ARDUPILOT,
    BOTH,
    AuthorityBench,
    H,
    L,
    N,
    S,
    armed_by_us,
    flying,
    in_flight,
    keeps_quiet,
    on_ground,
    shows,
)
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

# takeoff becomes true

@BOTH
def test_takeoff_set_to_true_gives_nothing_back_that_was_lost(kind):
    bench = on_ground(kind, L)
    for takeoff in (False, True, False, True):
        bench.wants(takeoff=takeoff)
        bench.run(limit=2.0)
    assert keeps_quiet(bench, 20.0)
    assert shows(bench, L)


@BOTH
@pytest.mark.parametrize('state', [H, S])
def test_takeoff_set_to_true_where_it_is_ours_changes_nothing(kind, state):
    bench = on_ground(kind, state)
    bench.executor().watch._grant.takeoff = False
    bench.run(limit=2.0)
    assert bench.authority() is state


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
    bench = AuthorityBench(kind, configs={1: {'boot_delay': 15.0}}).discover()
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
        bench.vehicles[1].flight.arming_fault = 'Gyros inconsistent'
        bench.assign(task_list('AB', 2))
        bench.run(limit=8.0)
        assert bench.executor().sender.busy
    bench.wants(takeoff=False)
    bench.run(limit=0.2)
    assert bench.authority() is N
    bench.vehicles[1].flight.arming_fault = ''
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


# an autopilot of unknown kind

def unknown(**kwargs):
    """Its heartbeat names no autopilot that the bridge knows."""
    bench = AuthorityBench('ardupilot', **kwargs)

    def rename(way, m, now):
        if m.get_type() == 'HEARTBEAT' and way == 'down':
            m.autopilot = d.MAV_AUTOPILOT_GENERIC
    bench.line.tampers.append(rename)
    bench.discover()
    assert bench.executor().profile.name == 'generic'
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
