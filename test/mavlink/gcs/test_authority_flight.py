# SPDX-License-Identifier: Apache-2.0
"""Pilots and other stations change modes in flight: who has the aircraft, and what is sent."""
import pytest
from authority_bench import (
    BOTH,
    MODES,
    H,
    L,
    N,
    S,
    flying,
    in_flight,
    keeps_quiet,
    set_mode,
    shows,
    suspended,
)
from mission_bench import task_list

from uav_task_alloc.mavlink.gcs.authority import Suspension
from uav_task_alloc.mavlink.gcs.flight_modes import mode_name
from uav_task_alloc.sim.modes import COPTER_MODES, PX4_MODES, px4_mode

STICKS = [('ardupilot', n) for n, m in COPTER_MODES.items() if m.stick] + [
    ('px4', n) for n, m in PX4_MODES.items() if m.stick]
OWN = [('ardupilot', n) for n in (6, 7, 9, 17, 20, 21, 23, 27)] + [
    ('px4', px4_mode(*n)) for n in ((4, 1), (4, 2), (4, 5), (4, 6), (4, 8), (4, 9), (4, 10), (6,),
                                    (10,))]
TO_HOLD = [(kind, MODES[kind].hold) for kind in MODES]
FEW = [(kind, mode) for kind in MODES
       for mode in (MODES[kind].stick, MODES[kind].rtl, MODES[kind].own, MODES[kind].hold)]


@pytest.mark.parametrize(('kind', 'mode'), STICKS + OWN + TO_HOLD)
def test_any_mode_that_a_pilot_sets_in_the_mission_takes_the_aircraft(kind, mode):
    bench = flying(kind)
    start = len(bench.sent)
    bench.vehicles[1].rc_mode(mode)
    assert bench.becomes(L, 3.0)
    assert bench.commands(start) == []
    assert shows(bench, L, 'not by the bridge: ', mode_name(bench.executor().profile.family, mode))
    assert 'MISSION mode set in flight' in bench.state().reason


@pytest.mark.parametrize(('kind', 'mode'), FEW)
def test_after_a_pilot_took_it_nothing_is_sent_for_a_minute_whatever_lists_come(kind, mode):
    bench = flying(kind)
    bench.vehicles[1].rc_mode(mode)
    assert bench.becomes(L, 3.0)
    assert keeps_quiet(bench)
    assert 'waits for the pilot to give it back' in bench.notes


@pytest.mark.parametrize(('kind', 'mode'), FEW)
def test_another_station_that_sets_a_mode_takes_it_like_a_pilot(kind, mode):
    bench = flying(kind)
    bench.from_station(set_mode(mode, kind))
    assert bench.becomes(L, 3.0)
    assert keeps_quiet(bench)
    assert shows(bench, L)


@pytest.mark.parametrize(('kind', 'mode'), FEW)
def test_a_mode_set_while_it_is_suspended_takes_it(kind, mode):
    bench = suspended(kind, Suspension.FOREIGN)
    start = len(bench.sent)
    bench.vehicles[1].rc_mode(mode)
    assert bench.becomes(L, 3.0)
    assert keeps_quiet(bench)
    assert bench.commands(start) == []
    assert shows(bench, L, 'not by the bridge')


@pytest.mark.parametrize(('kind', 'mode'), FEW)
@pytest.mark.parametrize('state', [L, N])
def test_a_pilot_who_flies_by_himself_may_set_what_he_likes(kind, mode, state):
    bench = in_flight(kind, state)
    if mode == MODES[kind].hold:
        bench.vehicles[1].rc_mode(MODES[kind].own)
        bench.run(limit=2.0)  # from OWN to HOLD hands nothing over, and from STICK it does
    bench.vehicles[1].rc_mode(mode)
    bench.run(limit=3.0)
    assert bench.authority() is (N if state is N and mode == MODES[kind].stick else L)
    assert keeps_quiet(bench)
    assert shows(bench, bench.authority())


# retries

@BOTH
@pytest.mark.parametrize('state', [L, S])
def test_a_command_that_is_being_repeated_ends_with_the_news(kind, state):
    bench = flying(kind)
    bench.line.tampers.append(lambda way, m, now: [] if way == 'up' and (
        m.get_type() == 'COMMAND_LONG' and m.command == 176) else None)
    bench.assign(task_list('', 2))  # hold
    bench.run(limit=1.5)
    assert len(bench.modes()) >= 2
    assert bench.executor().sender.busy
    start = len(bench.sent)
    if state is L:
        bench.vehicles[1].rc_mode(MODES[kind].stick)
    else:
        bench.vehicles[1].failsafe('radio', None)
    assert bench.becomes(state, 3.0)
    start = len(bench.sent)
    assert keeps_quiet(bench)
    assert bench.commands(start) == []
    assert not bench.executor().sender.busy
    assert not bench.executor().sender.must_start


@BOTH
@pytest.mark.parametrize('delay', [1.0, 5.0, 11.0])
def test_our_own_command_that_comes_late_does_not_take_it_back_from_the_pilot(kind, delay):
    bench, modes = flying(kind), MODES[kind]
    bench.assign(task_list('', 2))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == modes.hold, 5.0)
    bench.run(limit=2.0)
    late = [delay]

    def hold_back(way, m, now):
        if way == 'up' and m.get_type() == 'COMMAND_LONG' and m.command == 176 and late:
            return [(late.pop(), m)]
        return None
    bench.line.tampers.append(hold_back)
    bench.assign(task_list('XYZ', 3))
    assert bench.run(lambda: not late, 20.0)
    assert bench.modes()[-1] == modes.mission
    bench.vehicles[1].rc_mode(modes.stick)
    taken = bench.now
    assert bench.becomes(L, 3.0)
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == modes.mission,
                     delay + 1.0) or bench.now < taken
    assert keeps_quiet(bench, 40.0, 'YX')
    assert shows(bench, L, 'not by the bridge')


@BOTH
def test_our_own_hold_that_comes_late_is_no_hand_over_by_the_pilot(kind):
    bench, modes = flying(kind), MODES[kind]
    late = [4.0]

    def hold_back(way, m, now):
        if way == 'up' and m.get_type() == 'COMMAND_LONG' and m.command == 176 and late:
            return [(late.pop(), m)]
        return None
    bench.line.tampers.append(hold_back)
    bench.assign(task_list('', 2))
    bench.run(limit=0.5)
    bench.vehicles[1].rc_mode(modes.stick)
    assert bench.becomes(L, 3.0)
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == modes.hold, 6.0)
    assert keeps_quiet(bench, 40.0)
    assert shows(bench, L)


@BOTH
def test_another_stations_delayed_commands_are_its_own(kind):
    bench, modes = flying(kind), MODES[kind]
    bench.assign(task_list('', 2))  # the bridge holds it
    bench.run(limit=5.0)
    assert bench.authority() is H
    bench.from_station(set_mode(modes.rtl, kind))
    assert bench.becomes(L, 3.0)
    bench.from_station(set_mode(modes.hold, kind))
    bench.run(limit=12.0)
    assert bench.authority() is L
    assert keeps_quiet(bench, 40.0)
