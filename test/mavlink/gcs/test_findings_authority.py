# SPDX-License-Identifier: Apache-2.0
"""Findings 1-3, 14, 15, 19, 25: no command against a pilot, and none without knowing the state."""
import dataclasses

import pytest
from findings_bench import (
    BOTH,
    MODES,
    FindingsBench,
    arms,
    commanded,
    drop_messages,
    flying,
    happened,
    left_alone,
    take,
)
from flight_bench import places
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.model import Shape, ThreatZone

AROUND_HOME = ThreatZone('Z', Shape.CYLINDER, (0.0, 10.0, 0.0), 30.0)
MOMENTS = ['start', 'upload', 'verified', 'readback', 'last task', 'return path']
WHILE = {'ardupilot': ['RTL', 'LOITER', 'BRAKE', 'PAUSE'], 'px4': ['RTL', 'LOITER', 'PAUSE']}


def climbing(kind):
    """A vehicle that climbs to its cruise altitude."""
    bench = FindingsBench(kind).discover()
    bench.assign(task_list('ABC'))
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[2] > 15.0)
    return bench


@BOTH
@pytest.mark.parametrize('moment', ['climb', 'mission'])
@pytest.mark.parametrize('who', ['station', 'pilot', 'failsafe'])
@pytest.mark.parametrize('mode', ['LAND', 'RTL'])
def test_finding_01_a_vehicle_landed_by_somebody_else_stays_on_the_ground(kind, moment, who, mode):
    bench = climbing(kind) if moment == 'climb' else flying(kind)
    take(bench, mode, who)
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 200.0)
    bench.truth[1].clear()
    bench.vehicles[1].failsafe_over()
    bench.assign(task_list('CBA', 2))
    bench.run(limit=40.0)
    assert not happened(bench, 'armed')
    assert not happened(bench, 'takeoff')
    assert commanded(bench) == []
    assert not bench.state().available


def at(moment, kind):
    """A vehicle in flight at a moment at which the bridge used to set its mode again."""
    if moment == 'start':
        bench = flying(kind)  # no heartbeat has shown the mission mode
    elif moment == 'upload':
        bench = flying(kind, delay=(0.3, 0.3))
        bench.run(limit=1.5)  # a heartbeat has shown the mission mode
        bench.assign(task_list('DEFGHIJKLMNO', 2))
        assert bench.run(lambda: len(bench.line.sent('MISSION_REQUEST', 'down')
                                     + bench.line.sent('MISSION_REQUEST_INT', 'down')) > 6)
    elif moment == 'verified':
        bench = flying(kind, 'ABC')
        bench.assign(task_list('CAB', 2))
        assert bench.run(lambda: bench.onboard().revision == 2)
        bench.run(limit=1.5)
    elif moment == 'readback':
        bench = flying(kind, 'EAB', side=300.0)
        reads = len(bench.line.sent('MISSION_REQUEST_LIST'))
        assert bench.run(lambda: len(bench.line.sent('MISSION_REQUEST_LIST')) > reads, 100.0)
    elif moment == 'last task':
        bench = flying(kind, 'C')
        bench.run(limit=2.0)
    else:
        bench = flying(kind, 'C', returns=True)
        assert bench.run(lambda: bench.completed() == ['C'])
        bench.run(limit=2.0)
    return bench


@pytest.mark.parametrize(('kind', 'mode'), [(k, m) for k, modes in WHILE.items() for m in modes])
@pytest.mark.parametrize('moment', MOMENTS)
def test_finding_02_a_mode_that_somebody_else_has_set_stays(kind, moment, mode):
    bench = at(moment, kind)
    if bench.vehicles[1].flight.custom_mode == MODES[kind][mode]:
        mode = 'LAND'  # PX4 is in its return mode already, the copter is held for a replacement
    take(bench, mode)
    left_alone(bench)
    assert not bench.state().available


@BOTH
def test_a_heartbeat_with_the_mode_before_our_own_change_is_no_loss(kind):
    bench = FindingsBench(kind).discover()
    late = []

    def tamper(direction, m, now):
        if direction == 'down' and m.get_type() == 'HEARTBEAT' and (
                bench.started() and m.custom_mode == MODES[kind]['AUTO'] and not late):
            late.append(now)  # PX4 acknowledges a moment before its heartbeat shows the new mode
            m.custom_mode = MODES[kind]['PAUSE']
        return None
    bench.line.tampers.append(tamper)
    bench.assign(task_list('AB'))
    assert bench.run(lambda: bench.completed() == ['A', 'B'])
    assert late
    assert bench.noted('authority SUSPENDED')
    assert not bench.noted('authority LOST')


class Rerouted:
    """A ground station that receives the vehicle's messages from a new address."""

    def __init__(self, ground):
        self._ground, self.sessions = ground, ground.sessions

    def _back(self, outgoing):
        return [(n if isinstance(n, int) else n[1], m) for n, m in outgoing]

    def receive(self, n, message, now):
        return self._back(self._ground.receive(('new', n), message, now))

    def step(self, now):
        return self._back(self._ground.step(now))

    def assign(self, *args):
        return self._back(self._ground.assign(*args))


@BOTH
@pytest.mark.parametrize('mode', ['PAUSE', 'LOITER'])
@pytest.mark.parametrize('after', ['new address', 'restart', 'restart without a file'])
def test_finding_03_a_pause_by_the_pilot_persists(kind, mode, after):
    bench = flying(kind, 'ABC')
    bench.run(limit=2.0)
    take(bench, mode)
    bench.run(limit=10.0)
    bench.line.cut = True
    bench.run(limit=5.0)
    bench.line.cut = False
    if after == 'new address':
        bench.ground_station = Rerouted(bench.ground_station)
    else:
        bench.store = bench.store if after == 'restart' else type(bench.store)()
        bench.start()
        bench.discover()
    bench.assign(task_list('ABC', 2))
    left_alone(bench)
    assert bench.vehicles[1].flight.custom_mode == MODES[kind][mode]
    assert not bench.state().available


@BOTH
@pytest.mark.parametrize('change', ['takeoff', 'list'])
def test_finding_14_arming_retries_end_when_it_is_not_wanted_any_more(kind, change):
    bench = FindingsBench(kind).discover()
    bench.vehicles[1].flight.arming_fault = 'Gyros inconsistent'
    bench.assign(task_list('AB'))
    assert bench.run(lambda: len(arms(bench)) == 5, 30.0)
    if change == 'takeoff':
        bench.executor().policy = dataclasses.replace(bench.executor().policy, takeoff=False)
    else:
        bench.assign(task_list('', 2))
    bench.run(limit=60.0)
    assert len(arms(bench)) == 5
    bench.vehicles[1].flight.arming_fault = ''
    bench.run(limit=10.0)
    assert not happened(bench, 'armed')


@BOTH
@pytest.mark.parametrize('change', ['takeoff', 'list'])
def test_a_vehicle_armed_while_takeoff_is_withdrawn_does_not_take_off(kind, change):
    bench = FindingsBench(kind, delay=(0.3, 0.3)).discover()
    bench.assign(task_list('AB'))
    assert bench.run(lambda: arms(bench), 30.0)
    if change == 'takeoff':
        bench.executor().policy = dataclasses.replace(bench.executor().policy, takeoff=False)
    else:
        bench.assign(task_list('', 2))
    bench.run(limit=60.0)
    assert happened(bench, 'armed')
    assert not happened(bench, 'takeoff')
    assert not bench.vehicles[1].flight.armed


@BOTH
def test_finding_15_an_acknowledgement_to_another_station_is_ignored(kind):
    bench = FindingsBench(kind).discover()
    drop_messages(bench, 'up', 'COMMAND_LONG',
            lambda m: m.command == d.MAV_CMD_COMPONENT_ARM_DISARM and len(arms(bench)) < 9)
    bench.assign(task_list('AB'))
    assert bench.run(lambda: arms(bench), 30.0)
    for station, component in ((255, 190), (245, 191)):
        bench.from_vehicle(d.MAVLink_command_ack_message(
            d.MAV_CMD_COMPONENT_ARM_DISARM, d.MAV_RESULT_ACCEPTED, 0, 0, station, component))
    bench.run(limit=5.0)
    assert len(arms(bench)) >= 5
    assert 'takeoff' not in commanded(bench)
    assert bench.run(lambda: bench.completed() == ['A', 'B'])


@BOTH
def test_finding_19_no_return_path_is_flown_into_a_zone_over_home(kind):
    bench = FindingsBench(kind).discover()
    bench.assign(task_list('AB', returns=True))
    assert bench.run(lambda: bench.started() == ['A'])
    bench.executor().policy = FindingsBench(kind, zones=(AROUND_HOME,)).policy
    assert bench.run(lambda: bench.completed() == ['A', 'B'])
    bench.assign(task_list('', 2, returns=True))
    bench.run(limit=60.0)
    x, y, z = bench.vehicles[1].flight.body.position
    assert (round(x, -1), round(y, -1), round(z, -1)) == (100.0, 100.0, 50.0)
    assert MODES[kind]['RTL'] not in [e.mode for e in bench.truth[1]]
    assert bench.noted('a path home', 'zone Z')


@BOTH
@pytest.mark.parametrize('when_empty', ['hold', 'return'])
def test_finding_19_an_empty_list_that_returns_holds_outside_the_zone(kind, when_empty):
    bench = flying(kind, 'AB', when_empty=when_empty)
    assert bench.run(lambda: bench.completed() == ['A'])
    bench.executor().policy = FindingsBench(
        kind, when_empty=when_empty, zones=(AROUND_HOME,)).policy
    bench.assign(task_list('', 2, returns=when_empty == 'hold'))
    bench.run(limit=40.0)
    assert MODES[kind]['RTL'] not in [e.mode for e in bench.truth[1]]
    assert bench.vehicles[1].flight.body.position[2] > 40.0
    assert bench.noted('a path home', 'zone Z')


@BOTH
def test_finding_19_on_the_ground_in_a_zone_nothing_takes_off(kind):
    bench = FindingsBench(kind, zones=(AROUND_HOME,)).discover()
    bench.assign(task_list('AB'))
    bench.run(limit=60.0)
    assert not happened(bench, 'armed')
    assert bench.noted('zone Z')
    bench.executor().policy = dataclasses.replace(bench.executor().policy, zones=())
    assert bench.run(lambda: bench.completed() == ['A', 'B'])


@BOTH
@pytest.mark.parametrize('file', [True, False])
def test_finding_25_a_bridge_restarted_without_positions_does_not_take_off(kind, file):
    bench = flying(kind, 'ABC')
    bench.run(limit=2.0)
    silent = [True]
    for message in ('GLOBAL_POSITION_INT', 'EXTENDED_SYS_STATE'):
        drop_messages(bench, 'down', message, lambda m: silent[0])
    bench.store = bench.store if file else type(bench.store)()
    bench.start()
    bench.discover()
    bench.assign(task_list('ABC', 2))
    bench.run(limit=30.0)
    assert [m.command for m in bench.line.sent('COMMAND_LONG')].count(
        d.MAV_CMD_NAV_TAKEOFF) == 1  # the one at the beginning
    silent[0] = False
    assert bench.run(lambda: len(places(bench)) == 3)
    assert bench.run(lambda: sorted(bench.completed()) == ['A', 'B', 'C'])
    assert places(bench) == ['A', 'B', 'C']


@BOTH
def test_a_mode_set_after_a_reboot_on_the_ground_is_not_explained_by_it(kind):
    bench = FindingsBench(kind, takeoff=True, configs={1: {'arming_delay': 60.0}}).discover()
    bench.assign(task_list('AB'))
    bench.run(limit=8.0)
    end = bench.now + 9.0
    bench.line.tampers.append(lambda direction, m, now: [] if now < end and hasattr(
        m, 'time_boot_ms') else None)
    bench.vehicles[1].reboot(bench.now)
    bench.run(limit=6.0)
    assert bench.authority() is AuthorityState.HELD
    take(bench, 'LOITER')
    bench.run(limit=10.0)
    assert bench.authority() is AuthorityState.LOST
