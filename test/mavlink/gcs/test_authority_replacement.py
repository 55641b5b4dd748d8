# SPDX-License-Identifier: Apache-2.0
"""A pilot or a failsafe while a mission is replaced in flight, and a replacement that stalls."""
import math

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
    S,
    flown_up_by_pilot,
    flying,
    lost,
    sends_no_command,
    status_is,
)
from flight_bench import places
from mission_bench import task_list

from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.model import Shape, ThreatZone

NEW = 'ZYXWVUTSRQ'
BRAKE = 17
MOMENTS = pytest.mark.parametrize('moment', ['holding', 'counting', 'sending', 'sent', 'reading'])


def replacing(kind, moment, **kwargs):
    """In flight, at some moment of the upload of a new list."""
    bench = flying(kind, delay=(0.1, 0.1), tick=0.1, **kwargs)
    start = len(bench.sent)
    bench.assign(task_list(NEW, 2))

    def count(name):
        return sum(m.get_type() == name for _, _, m in bench.sent[start:])
    last = len(NEW) + bench.onboard().own
    reached = {'holding': lambda: kind == 'px4' or bench.modes(start),
               'counting': lambda: count('MISSION_COUNT'),
               'sending': lambda: count('MISSION_ITEM_INT') >= 5,
               'sent': lambda: count('MISSION_ITEM_INT') >= last,
               'reading': lambda: count('MISSION_REQUEST_INT') >= 5}[moment]
    assert bench.run(reached, 20.0)
    if moment == 'holding':
        bench.run(limit=0.15)  # the command has arrived: of two pending ones the last one counts
    assert bench.authority() is H
    return bench


def transfer_ended(bench, start):
    """Only reading after the loss."""
    bench.run(limit=20.0)
    assert {action for _, action, _ in bench.sent[start:]} <= {'read'}
    assert bench.vehicles[1].flight.custom_mode != MODES[
        'px4' if bench.executor().profile.atomic else 'ardupilot'].mission
    assert sends_no_command(bench, 40.0)


@BOTH
@MOMENTS
@pytest.mark.parametrize('mode', ['stick', 'rtl'])
def test_a_pilot_during_a_replacement_ends_the_transfer(kind, moment, mode):
    bench = replacing(kind, moment)
    bench.vehicles[1].rc_mode(getattr(MODES[kind], mode))
    assert bench.run(lambda: bench.authority() is L, 3.0)
    transfer_ended(bench, len(bench.sent))
    assert status_is(bench, L, 'not by the bridge')
    assert bench.onboard().state is not MissionState.UPLOADING
    assert bench.executor().watch.replacing_since is None


@BOTH
@MOMENTS
def test_a_failsafe_during_a_replacement_ends_the_transfer(kind, moment):
    bench = replacing(kind, moment)
    bench.vehicles[1].failsafe('battery', MODES[kind].rtl)
    assert bench.run(lambda: bench.authority() is not H, 3.0)
    start = len(bench.sent)
    assert bench.run(lambda: bench.authority() is L, 3.0)
    transfer_ended(bench, start)
    assert status_is(bench, L, 'failsafe: ')


@BOTH
@MOMENTS
def test_a_failsafe_that_keeps_the_mode_stops_the_transfer_and_then_is_a_loss(kind, moment):
    bench = replacing(kind, moment)
    bench.vehicles[1].failsafe('radio', None)
    assert bench.run(lambda: bench.authority() is S, 3.0)
    start = len(bench.sent)
    bench.run(limit=10.0)
    assert bench.sent[start:] == []
    bench.vehicles[1].failsafe('battery', MODES[kind].rtl)
    assert bench.run(lambda: bench.authority() is L, 3.0)
    transfer_ended(bench, start)


@BOTH
@pytest.mark.parametrize('moment', ['sending', 'reading'])
def test_a_replacement_continues_after_a_failsafe_that_kept_the_mode(kind, moment):
    bench = replacing(kind, moment)
    bench.vehicles[1].failsafe('radio', None)
    assert bench.run(lambda: bench.authority() is S, 3.0)
    bench.run(limit=8.0)
    bench.vehicles[1].failsafe_over()
    assert bench.run(lambda: bench.completed()[-len(NEW):] == list(NEW), 400.0)


@BOTH
def test_without_authority_no_mission_is_replaced_in_flight(kind):
    bench = lost(kind)
    start = len(bench.sent)
    bench.vehicles[1].failsafe('battery', MODES[kind].rtl)
    assert sends_no_command(bench)
    assert {action for _, action, _ in bench.sent[start:]} <= {'read'}
    bench = flown_up_by_pilot(kind)
    start = len(bench.sent)
    assert sends_no_command(bench)
    assert {action for _, action, _ in bench.sent[start:]} <= {'read'}
    assert bench.authority() is N


# a good link, at most 30 s

@BOTH
def test_in_flight_a_replacement_begins_only_after_ten_seconds_of_good_link(kind):
    bench = flying(kind)
    bench.line.cut = True
    bench.run(limit=2.6)  # not stale
    bench.line.cut = False
    bench.run(limit=0.5)
    assert bench.authority() is H
    start, since = len(bench.sent), bench.now
    bench.assign(task_list('ZYX', 2))
    assert bench.run(lambda: any(action != 'read' for _, action, _ in bench.sent[start:]), 20.0)
    assert bench.now - since > 9.0
    assert bench.run(lambda: bench.completed()[-3:] == ['Z', 'Y', 'X'], 200.0)


def stalled_replacement(**kwargs):
    """Held for an upload whose items are all lost."""
    bench = flying('ardupilot', **kwargs)
    bench.run(limit=4.0)
    bench.line.tampers.append(lambda direction, m, now: [] if direction == 'up' and (
        m.get_type() == 'MISSION_ITEM_INT') else None)
    start = len(bench.sent)
    bench.assign(task_list(NEW, 2))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == COPTER.hold, 10.0)
    return bench, start, bench.now


def test_held_for_30_seconds_it_returns_when_the_return_path_is_clear():
    bench, start, since = stalled_replacement()
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == COPTER.rtl, 60.0)
    assert 29.0 < bench.now - since < 45.0
    assert bench.modes(start) == [COPTER.hold, COPTER.rtl]
    assert any('held for 30 s' in note and 'returns' in note for note in bench.notes)
    assert bench.authority() is H
    bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    bench.run(limit=3.0)
    assert status_is(bench, N)


def test_held_for_30_seconds_with_a_zone_on_the_return_path_it_stays_with_an_alarm():
    zone = ThreatZone('Z1', Shape.CYLINDER, (0.0, 20.0, 0.0), 5.0)
    bench, start, since = stalled_replacement()
    bench.set_policy(zones=(zone,))
    bench.run(lambda: bench.executor().alarm, 60.0)
    assert 29.0 < bench.now - since < 45.0
    bench.run(limit=60.0)
    assert COPTER.rtl not in bench.modes(start)
    assert bench.vehicles[1].flight.custom_mode == COPTER.hold
    assert bench.state().reason == ('held for an upload that does not end, and zone Z1 is across '
                                    'its path home: stays')
    assert not bench.state().available
    bench.line.tampers.clear()
    assert bench.run(lambda: bench.completed() == list(NEW), 400.0)
    assert bench.state().available


@ARDUPILOT
@pytest.mark.parametrize('seconds', [5.0, 40.0])
def test_a_pilot_who_takes_over_during_a_stalled_replacement_keeps_control(kind, seconds):
    bench, _, _ = stalled_replacement()
    bench.run(limit=seconds)
    bench.vehicles[1].rc_mode(COPTER.stick)
    assert bench.run(lambda: bench.authority() is L, 3.0)
    bench.line.tampers.clear()
    transfer_ended(bench, len(bench.sent))


@pytest.mark.parametrize('after', [0.0, 0.3, 0.6])
def test_killed_in_an_upload_after_a_hand_over_the_current_item_completes_nothing(after):
    """ArduPilot keeps the number of its current item, which is of the mission before."""
    bench = AuthorityBench('ardupilot', delay=(0.1, 0.1), tick=0.1).discover()
    bench.assign(task_list('ABCD', service=6.0))
    body = bench.vehicles[1].flight.body
    place = task_list('C').stops[0].task.position
    assert bench.run(lambda: math.dist(body.position, place) < 1.0, 200.0)
    bench.vehicles[1].rc_mode(BRAKE)
    assert bench.run(lambda: bench.authority() is L, 20.0)
    assert 'C' not in places(bench)
    bench.assign(task_list('CZD', 2, service=6.0))
    assert bench.hand_over() == ''
    assert bench.run(lambda: len(bench.onboard().progress.items) == 3, 30.0)
    bench.run(limit=after)
    bench.kill_and_restart(0.1)
    bench.assign(task_list('CZD', 2, service=6.0))
    bench.run(limit=4.0)
    assert not set(bench.completed()) - set(places(bench))
