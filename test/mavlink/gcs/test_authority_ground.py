# SPDX-License-Identifier: Apache-2.0
"""Authority by the parameter `takeoff`, and of an autopilot of unknown kind."""
import pytest
from authority_bench import (
    ARDUPILOT,
    BOTH,
    COPTER,
    MODES,
    PX4,
    AuthorityBench,
    H,
    L,
    N,
    S,
    armed_by_us,
    flying,
    in_flight,
    on_ground,
    sends_no_command,
    set_mode,
    status_is,
    upload_by_another,
)
from findings_bench import drop_messages
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

# takeoff becomes true

@BOTH
def test_takeoff_set_to_true_does_not_recover_a_lost_vehicle(kind):
    bench = on_ground(kind, L)
    for takeoff in (False, True, False, True):
        bench.set_policy(takeoff=takeoff)
        bench.run(limit=2.0)
    assert sends_no_command(bench, 20.0)
    assert status_is(bench, L)


@BOTH
@pytest.mark.parametrize('state', [H, S])
def test_takeoff_set_to_true_while_held_or_suspended_changes_nothing(kind, state):
    bench = on_ground(kind, state)
    bench.executor().watch._grant.takeoff = False
    bench.run(limit=2.0)
    assert bench.authority() is state


@BOTH
def test_takeoff_set_to_true_on_the_ground_grants_it(kind):
    bench = on_ground(kind, N)
    assert status_is(bench, N, 'never granted')
    bench.set_policy(takeoff=True)
    bench.run(limit=0.3)
    assert status_is(bench, H, 'takeoff is true')
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@BOTH
def test_nothing_is_granted_before_the_end_of_the_boot(kind):
    bench = AuthorityBench(kind, configs={1: {'boot_delay': 15.0}}).discover()
    bench.assign(task_list('AB'))
    bench.run(lambda: bench.now >= 14.0)
    assert bench.authority() is N
    assert bench.commands() == []
    assert bench.reaches(H, 5.0)


@BOTH
def test_nothing_is_granted_in_the_air_or_while_armed(kind):
    bench = in_flight(kind, N)
    bench.set_policy(takeoff=True)
    assert sends_no_command(bench)
    bench = on_ground(kind, N)
    bench.vehicles[1].rc_arm(True)
    bench.run(limit=1.5)
    bench.set_policy(takeoff=True)
    bench.run(limit=4.0)
    assert bench.authority() is N
    assert bench.commands() == []


# takeoff becomes false

@BOTH
@pytest.mark.parametrize('relaunch', ['operator', 'automatic'])
def test_takeoff_set_to_false_in_the_air_takes_effect_at_the_landing(kind, relaunch):
    bench = flying(kind, 'AB', relaunch=relaunch)
    bench.set_policy(takeoff=False)
    bench.run(limit=1.0)
    assert status_is(bench, H)
    bench.vehicles[1].failsafe('radio', None)
    assert bench.reaches(S)
    bench.run(limit=6.5)
    bench.vehicles[1].failsafe_over()
    assert bench.reaches(H)
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 60.0)
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    assert bench.reaches(N, 3.0)
    assert sends_no_command(bench)
    assert status_is(bench, N, 'landed')


@BOTH
def test_takeoff_set_to_false_and_true_again_in_the_air_changes_nothing(kind):
    bench = flying(kind, 'AB', relaunch='automatic')
    bench.set_policy(takeoff=False)
    bench.run(limit=1.0)
    bench.set_policy(takeoff=True)
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    bench.run(limit=2.0)
    assert status_is(bench, H)


@BOTH
def test_takeoff_set_to_false_on_the_ground_withdraws_authority(kind):
    bench = on_ground(kind, H)
    bench.set_policy(takeoff=False)
    bench.run(limit=0.2)
    assert status_is(bench, N, 'takeoff is false')
    assert sends_no_command(bench)


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
    bench.set_policy(takeoff=False)
    bench.run(limit=0.2)
    assert bench.authority() is N
    bench.vehicles[1].flight.arming_fault = ''
    assert sends_no_command(bench)
    assert not bench.vehicles[1].flight.armed


@BOTH
@pytest.mark.parametrize('cause', ['link', 'failsafe'])
def test_takeoff_set_to_false_while_suspended_takes_effect_afterwards(kind, cause):
    bench = on_ground(kind, H)
    if cause == 'link':
        bench.line.cut = True
    else:
        bench.vehicles[1].failsafe('radio', None)
    assert bench.reaches(S, 5.0)
    bench.set_policy(takeoff=False)
    bench.run(limit=3.0)
    assert bench.authority() is S
    bench.line.cut = False
    bench.vehicles[1].failsafe_over()
    assert bench.reaches(N, 3.0)
    assert sends_no_command(bench)
    assert bench.commands() == []


@BOTH
def test_takeoff_set_to_false_while_no_bridge_ran_withdraws_authority_on_the_ground(kind):
    bench = on_ground(kind, H)
    bench.policy = type(bench.policy)(takeoff=False)
    bench.kill_and_restart(3.0)
    bench.run(limit=2.0)
    assert status_is(bench, N, 'takeoff is false')
    assert sends_no_command(bench)


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_takeoff_set_to_false_changes_nothing_while_not_held(kind, state):
    bench = in_flight(kind, state)
    bench.set_policy(takeoff=True)
    bench.run(limit=1.0)
    bench.set_policy(takeoff=False)
    bench.run(limit=2.0)
    assert bench.authority() is state
    assert sends_no_command(bench, 20.0)


# an autopilot of unknown kind

def unknown(**kwargs):
    """Its heartbeat names no autopilot that the bridge knows."""
    bench = AuthorityBench('ardupilot', **kwargs)

    def rename(direction, m, now):
        if m.get_type() == 'HEARTBEAT' and direction == 'down':
            m.autopilot = d.MAV_AUTOPILOT_GENERIC
    bench.line.tampers.append(rename)
    bench.discover()
    assert bench.executor().profile.name == 'generic'
    return bench


@ARDUPILOT
def test_an_unknown_autopilot_is_held_by_takeoff_whatever_its_modes(kind):
    bench = unknown()
    assert bench.reaches(H)
    for mode in (COPTER.stick, COPTER.hold, COPTER.mission, COPTER.rtl, COPTER.own, 0):
        bench.vehicles[1].rc_mode(mode)
        bench.run(limit=8.0)
        assert status_is(bench, H)


@ARDUPILOT
def test_an_unknown_autopilot_is_held_by_a_hand_over_and_never_by_a_mode(kind):
    bench = unknown(takeoff=False)
    vehicle = bench.vehicles[1]
    vehicle.rc_mode(COPTER.stick)
    vehicle.rc_arm(True)
    vehicle.rc_stick((0.0, 0.0, 3.0))
    bench.run(limit=12.0)
    vehicle.rc_stick(None)
    for mode in (COPTER.hold, COPTER.mission, COPTER.stick, COPTER.hold):
        vehicle.rc_mode(mode)
        bench.run(limit=8.0)
        assert status_is(bench, N)
    assert bench.hand_over() == ''
    bench.run(limit=1.0)
    assert status_is(bench, H, 'handed over by test')
    vehicle.rc_mode(COPTER.stick)
    bench.run(limit=3.0)
    assert bench.authority() is H
    vehicle.failsafe('radio', None)
    assert bench.reaches(S)
    vehicle.kill_switch()
    assert bench.reaches(L)


@BOTH
def test_a_return_set_after_a_reboot_on_the_ground_that_is_not_seen_yet_is_of_another(kind):
    bench, hidden = on_ground(kind, H), [True]
    bench.line.tampers.append(lambda direction, m, now: [] if (
        hidden and hasattr(m, 'time_boot_ms')) else None)
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=1.2)
    bench.from_station(set_mode(MODES[kind].rtl, kind))
    bench.run(limit=2.0)
    hidden.clear()
    assert bench.reaches(L, 8.0)
    assert sends_no_command(bench)


@BOTH
@pytest.mark.parametrize('boots', [True, False])
@pytest.mark.parametrize('after', [1.5, 3.4])
def test_a_stick_mode_set_on_the_ground_before_a_reboot_is_of_a_pilot(kind, boots, after):
    config = {'boot_delay': 6.0, 'arming_delay': 8.0} if boots else {}
    bench, hidden = on_ground(kind, H, configs={1: config}), []
    bench.line.tampers.append(lambda direction, m, now: [] if (
        hidden and direction == 'down' and m.get_type() == 'HEARTBEAT') else None)
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    assert bench.reaches(S)
    bench.run(limit=after)
    bench.vehicles[1].reboot(bench.now)
    hidden += [] if boots else [True]  # its clock is received before a heartbeat
    bench.run(limit=1.2)
    hidden.clear()
    bench.run(limit=14.0)
    assert status_is(bench, L)
    assert sends_no_command(bench)


@BOTH
def test_a_late_message_of_before_a_reboot_does_not_hide_who_set_a_mode(kind):
    bench, hidden = on_ground(kind, H), []
    bench.line.tampers.append(lambda direction, m, now: [] if (
        hidden and direction == 'down' and m.get_type() == 'HEARTBEAT') else None)
    bench.run(limit=20.0)
    late = d.MAVLink_system_time_message(0, int(1e3 * bench.now))
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=5.2)  # a heartbeat after the reboot was seen too
    assert bench.authority() is H
    hidden.append(True)
    bench.from_station(set_mode(MODES[kind].land, kind))
    bench.from_vehicle(late)
    bench.run(limit=1.0)
    hidden.clear()
    assert bench.reaches(L, 6.0)
    assert sends_no_command(bench)


def late_reboot(kind, before=()):
    """A bench whose vehicle has rebooted, as seen after two heartbeats; no heartbeat follows."""
    bench, clocks, heartbeats = on_ground(kind, H), [], []
    bench.line.tampers.append(lambda direction, m, now: [] if direction == 'down' and (
        (clocks and hasattr(m, 'time_boot_ms')) or (heartbeats and m.get_type() == 'HEARTBEAT')
    ) else None)
    bench.run(limit=20.0)
    clocks.append(True)
    bench.vehicles[1].reboot(bench.now)
    for mode in before:  # that of its switch, entered while it boots
        bench.vehicles[1].rc_mode(mode)
    bench.run(limit=2.5)
    clocks.clear()
    heartbeats.append(True)
    assert bench.run(lambda: any('was restarted' in note for note in bench.notes), 3.0)
    assert bench.authority() is H
    return bench, heartbeats


@pytest.mark.parametrize(('kind', 'boots_in_another'), [
    ('ardupilot', False), ('px4', False), ('px4', True)])
def test_a_mode_set_once_a_heartbeat_has_shown_the_one_of_the_boot_is_of_a_pilot(
        kind, boots_in_another):
    stick = MODES[kind].stick
    bench, heartbeats = late_reboot(kind, (stick,) * boots_in_another)
    bench.vehicles[1].rc_mode(MODES[kind].land if boots_in_another else stick)
    bench.run(limit=0.5)
    heartbeats.clear()
    assert bench.reaches(L, 8.0)
    assert sends_no_command(bench)


@PX4
def test_armed_by_a_pilot_between_a_reboot_and_the_next_heartbeat_it_is_lost(kind):
    bench, heartbeats = on_ground(kind, H), []
    drop_messages(bench, 'down', 'HEARTBEAT', lambda m: heartbeats)
    bench.run(limit=20.0)
    heartbeats.append(True)
    bench.vehicles[1].reboot(bench.now)
    assert bench.run(lambda: any('was restarted' in note for note in bench.notes), 2.5)
    bench.vehicles[1].rc_arm(True)
    bench.run(limit=0.3)
    heartbeats.clear()
    assert bench.reaches(L, 3.0)
    assert sends_no_command(bench)


@BOTH
@pytest.mark.parametrize('flown', [False, True])
def test_hold_set_by_another_on_the_ground_in_mission_mode_is_a_loss(kind, flown):
    bench = on_ground(kind, L if flown else H)
    upload_by_another(bench, items=2)
    assert not flown or bench.hand_over() == ''
    bench.from_station(set_mode(MODES[kind].mission, kind))
    bench.run(limit=3.0)
    assert bench.vehicles[1].flight.custom_mode == MODES[kind].mission
    assert bench.authority() is H
    bench.from_station(set_mode(MODES[kind].hold, kind))
    assert bench.reaches(L, 8.0)
    bench.assign(task_list('AB'))
    assert sends_no_command(bench, 20.0)
    assert status_is(bench, L)
