# SPDX-License-Identifier: Apache-2.0
"""A battery change at the base reboots the vehicle: with `relaunch: automatic` it flies on."""
from dataclasses import replace

import pytest
from authority_bench import MODES, AuthorityBench, set_mode
from flight_bench import FlightBench
from mission_bench import task_list

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


def changed(kind, relaunch, landed=lambda bench: None):
    """After a flight of A, a landing at home, then `landed`, and a battery change."""
    bench = FlightBench(kind, relaunch=relaunch, configs={1: {
        'turnaround': 60.0, 'range': 3000.0, 'home': (0.0, 10.0, 0.0), 'boot_delay': 6.0,
        'arming_delay': 10.0}}).discover()
    bench.assign(task_list('A', returns=True))
    assert bench.run(lambda: bench.completed() == ['A'], 200.0)
    bench.assign(replace(task_list('', 2), returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    bench.run(limit=3.0)
    landed(bench)
    truth = [e.name for e in bench.truth[1]]
    assert bench.run(lambda: 'battery_changed' in [e.name for e in bench.truth[1]], 300.0), truth
    bench.run(limit=30.0)
    return bench


@BOTH
def test_with_automatic_relaunch_it_is_available_again_and_flies_its_next_list(kind):
    bench = changed(kind, 'automatic')
    assert bench.authority() is AuthorityState.HELD
    assert bench.state().available
    assert bench.state().battery > 0.99
    lost = [text for text in bench.notes if 'LOST' in text]
    why = {'ardupilot': 'the vehicle rebooted',  # PX4: a heartbeat came before its clock
           'px4': 'the link is back, in Hold instead of Mission'}[kind]
    assert lost[0].startswith(f'authority LOST: {why}; given back by ')
    assert lost[-1].startswith(f'authority LOST: {why}; given back by a full battery, ')
    bench.assign(task_list('B', 3, returns=True))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 300.0)


@BOTH
def test_without_it_an_operator_hands_it_over(kind):
    bench = changed(kind, 'operator')
    assert bench.authority() is not AuthorityState.HELD
    assert not bench.state().available
    bench.assign(task_list('B', 3, returns=True))
    bench.run(limit=60.0)
    assert bench.completed() == ['A']
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 300.0)


@BOTH
def test_a_reboot_in_the_air_still_ends_the_grant(kind):
    bench = FlightBench(kind, relaunch='automatic').discover()
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.completed() == ['A'], 200.0)
    bench.vehicles[1].reboot(bench.now)
    assert bench.run(lambda: bench.authority() is AuthorityState.LOST, 60.0)


@BOTH
def test_a_vehicle_that_a_pilot_has_taken_stays_with_the_pilot(kind):
    modes = MODES[kind]
    bench = changed(kind, 'automatic', lambda bench: bench.from_station(set_mode(
        modes.stick, kind)))
    assert bench.authority() is AuthorityState.LOST
    assert bench.state().battery > 0.99


def names(bench):
    return [event.name for event in bench.truth[1]]


def powered_off(bench):
    return 'power_off' in names(bench)


# when the bridge is killed, and when it is started again
MOMENTS = {
    'turns home': (lambda bench: bench.started() == ['A'] and not bench.run(limit=4.0),
                   lambda bench: 'item_reached' in names(bench) and not bench.run(limit=3.0)),
    'comes down until power is lost': (
        lambda bench: bench.completed() == ['A'] and not bench.run(limit=5.0)
        and 0.5 < bench.vehicles[1].flight.body.position[2] < 20.0, powered_off),
    'comes down until it boots': (
        lambda bench: bench.completed() == ['A'] and not bench.run(limit=5.0)
        and 0.5 < bench.vehicles[1].flight.body.position[2] < 8.0,
        lambda bench: 'battery_changed' in names(bench)),
    'has just touched down': (
        lambda bench: bench.completed() == ['A'] and not bench.run(limit=5.0) and bench.run(
            lambda: bench.vehicles[1].flight.landed, 60.0), powered_off),
    'lands': (lambda bench: bench.completed() == ['A'] and not bench.run(limit=5.0)
              and bench.vehicles[1].flight.body.position[2] < 12.0,
              lambda bench: 'disarmed' in names(bench)),
    'has landed': (lambda bench: 'disarmed' in names(bench) and not bench.run(limit=2.0),
                   lambda bench: not powered_off(bench)),
    'loses power': (lambda bench: 'disarmed' in names(bench) and not bench.run(limit=2.0),
                    powered_off),
    'boots': (powered_off, lambda bench: 'battery_changed' in names(bench)),
    'has booted': (lambda bench: 'battery_changed' in names(bench) and not bench.run(limit=3.0),
                   lambda bench: True),
}


@BOTH
@pytest.mark.parametrize('moment', MOMENTS)
def test_it_flies_its_next_list_after_a_kill_of_the_bridge_while_it(kind, moment):
    bench = AuthorityBench(kind, relaunch='automatic', configs={1: {
        'turnaround': 30.0, 'range': 3000.0, 'boot_delay': 6.0, 'arming_delay': 10.0,
        'settling_time': 8.0 if kind == 'px4' else None}}).discover()
    killed, started = MOMENTS[moment]
    bench.assign(task_list('A', returns=True))
    assert bench.run(lambda: killed(bench), 300.0), names(bench)
    bench.kill()
    assert bench.run(lambda: started(bench), 100.0), names(bench)
    bench.start()
    assert bench.run(lambda: bench.ground_station.sessions, 100.0)
    bench.assign(task_list('A', returns=True) if moment == 'turns home' else replace(
        task_list('', 2), returns=True))
    assert bench.run(lambda: 'battery_changed' in names(bench), 300.0), names(bench)
    assert bench.run(lambda: bench.state().available and bench.state().battery > 0.99, 60.0), (
        '\n'.join(bench.notes))
    assert bench.authority() is AuthorityState.HELD
    assert bench.completed() in ([], ['A'])  # again after 'turns home'
    assert bench.flown() == [(0, 100, 50)]


@BOTH
def test_it_stays_with_a_pilot_who_has_landed_it_elsewhere_after_a_kill_of_the_bridge(kind):
    bench = AuthorityBench(kind, relaunch='automatic', configs={1: {
        'range': 3000.0, 'boot_delay': 6.0, 'arming_delay': 10.0}}).discover()
    flight = bench.vehicles[1].flight
    bench.assign(task_list('A', returns=True))
    assert bench.run(lambda: bench.completed() == ['A'], 100.0)
    assert bench.run(lambda: flight.body.position[2] < 20.0, 100.0)
    bench.kill()
    for mode, stick in ((MODES[kind].stick, (5.0, 0.0, 0.0)), (MODES[kind].land, None)):
        bench.vehicles[1].rc_mode(mode)
        bench.vehicles[1].rc_stick(stick)
        bench.run(limit=4.0)
    assert bench.run(lambda: 'disarmed' in names(bench), 60.0)
    flight.body.battery = 1.0
    bench.vehicles[1].reboot(bench.now)
    bench.start()
    assert bench.run(lambda: bench.ground_station.sessions, 100.0)
    bench.assign(task_list('AB', 2, returns=True))
    bench.run(limit=60.0)
    assert bench.authority() is AuthorityState.LOST
    assert not flight.armed


def test_it_stays_with_a_pilot_who_has_landed_it_at_home_after_a_kill_of_the_bridge():
    bench = AuthorityBench('ardupilot', relaunch='automatic', configs={1: {
        'turnaround': 30.0, 'range': 3000.0}}).discover()
    bench.assign(task_list('A', returns=True))
    assert bench.run(lambda: bench.completed() == ['A'], 100.0)
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[2] < 20.0, 100.0)
    bench.kill()
    bench.vehicles[1].rc_mode(MODES['ardupilot'].land)
    assert bench.run(lambda: 'disarmed' in names(bench), 60.0)
    bench.start()  # it shows the pilot's mode
    assert bench.run(lambda: 'battery_changed' in names(bench), 100.0)
    bench.run(limit=60.0)
    assert bench.authority() is AuthorityState.LOST
