# SPDX-License-Identifier: Apache-2.0
"""A flight bench that checks every message of the bridge against the state of authority."""
from dataclasses import replace
from types import SimpleNamespace

import pytest
from bench_copy import kept
from flight_bench import FlightBench, Store
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import Suspension
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.sim.modes import px4_mode

N, H, S, L = (
    AuthorityState.NONE,
    AuthorityState.HELD,
    AuthorityState.SUSPENDED,
    AuthorityState.LOST,
)
BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
ARDUPILOT = pytest.mark.parametrize('kind', ['ardupilot'])
PX4 = pytest.mark.parametrize('kind', ['px4'])
MODES = {
    'ardupilot': SimpleNamespace(
        mission=d.COPTER_MODE_AUTO, hold=d.COPTER_MODE_GUIDED, stick=d.COPTER_MODE_LOITER,
        rtl=d.COPTER_MODE_RTL, land=d.COPTER_MODE_LAND, own=d.COPTER_MODE_BRAKE,
        names={d.COPTER_MODE_AUTO: 'AUTO', d.COPTER_MODE_GUIDED: 'GUIDED',
               d.COPTER_MODE_LOITER: 'LOITER', d.COPTER_MODE_RTL: 'RTL'}),
    'px4': SimpleNamespace(
        mission=px4_mode(4, 4), hold=px4_mode(4, 3), stick=px4_mode(3), rtl=px4_mode(4, 5),
        land=px4_mode(4, 6), own=px4_mode(6),
        names={px4_mode(4, 4): 'Mission', px4_mode(4, 3): 'Hold', px4_mode(3): 'Position',
               px4_mode(4, 5): 'Return'})}
COPTER = MODES['ardupilot']
LONG = 'ABCDEFGHIJKLMNOPQRSTUVWXY'  # more than two minutes
_READS = {'MISSION_REQUEST_LIST', 'MISSION_REQUEST_INT', 'MISSION_REQUEST',
          'PARAM_REQUEST_READ'}
_UPLOADS = {'MISSION_COUNT', 'MISSION_ITEM_INT'}
_ASKS = {d.MAV_CMD_SET_MESSAGE_INTERVAL, d.MAV_CMD_REQUEST_MESSAGE}


class AuthorityBench(FlightBench):
    """Fails when the bridge sends a message that the present state forbids."""

    def __init__(self, *args, tick=0.2, **kwargs):
        self.sent = []  # (now, action, message)
        self.moved = {}  # new address -> vehicle
        super().__init__(*args, tick=tick, **kwargs)

    def _up(self, outgoing):
        for address, m in outgoing:
            n = self.moved.get(address, address)
            self.sent.append((self.now, action_of(m), m))
            allowed = allowed_actions(self.executor(n).authority)
            assert action_of(m) in allowed, (self.now, self.authority(n), m)
            super()._up([(n, m)])

    def commands(self, since=0):
        """Messages of the class 'command', from the `since`-th message on."""
        return [m for _, action, m in self.sent[since:] if action == 'command']

    def modes(self, since=0):
        """Custom modes that were commanded."""
        profile = self.executor().profile
        return [profile.commanded_mode(m) for m in self.commands(since)
                if profile.commanded_mode(m) is not None]

    def set_policy(self, n=1, **changes):
        """The operator sets parameters."""
        self.executor(n).policy = replace(self.executor(n).policy, **changes)

    def reaches(self, state, limit=15.0, n=1):
        """Whether a state is reached within `limit` [s]."""
        return self.run(lambda: self.authority(n) is state, limit)

    def kill_and_restart(self, seconds=0.0, store=True):
        """Kill the bridge and start a new one after a while; without a store: no record."""
        self.kill()
        self.run(limit=seconds)
        if not store:
            self.store = Store()
        self.start()
        self.discover()

    def kill(self):
        """Kill the bridge; `start` starts a new one."""
        self.ground_station = SimpleNamespace(sessions={}, step=lambda now: [],
                                      receive=lambda address, m, now: [])

    def move_address(self, n=1, address='new'):
        """Let the messages of the vehicle come from a new address from now on."""
        receive, self.moved[address] = self.ground_station.receive, n
        self.ground_station.receive = lambda _, m, now: receive(address, m, now)


def action_of(m):
    """The class of a message to a vehicle, independent of the code under test."""
    kind = m.get_type()
    if kind in _READS or (kind == 'MISSION_ACK' and m.type == 0) or (
            kind == 'COMMAND_LONG' and m.command in _ASKS):
        return 'read'
    return 'upload' if kind in _UPLOADS or kind == 'MISSION_ACK' else 'command'


def allowed_actions(authority):
    """The classes of messages that may be sent, independent of the code under test."""
    if authority.undecided or set(authority.suspensions) == {Suspension.FOREIGN}:
        return {'read'}
    return {H: {'read', 'upload', 'command'}, N: {'read', 'upload'}, L: {'read'}, S: set()}[
        authority.state]


@kept
def flying(kind, names=LONG, **kwargs):
    """HELD, on the leg to the first task, and a heartbeat has shown the mission mode."""
    bench = AuthorityBench(kind, **kwargs).discover()
    bench.assign(task_list(names))
    assert bench.run(lambda: bench.started() == [names[0]])
    bench.run(limit=2.0)
    assert bench.authority() is H
    return bench


@kept
def flown_up_by_pilot(kind, names=LONG, **kwargs):
    """NONE, hovering in a stick mode, with the list on board."""
    bench = AuthorityBench(kind, takeoff=False, **kwargs)
    vehicle = bench.vehicles[1]
    vehicle.rc_mode(MODES[kind].stick)
    bench.discover()
    bench.assign(task_list(names))
    assert bench.run(lambda: bench.onboard().state is MissionState.VERIFIED, 20.0)
    assert vehicle.rc_arm(True)
    vehicle.rc_stick((0.0, 0.0, 3.0))
    bench.run(limit=12.0)
    vehicle.rc_stick(None)
    bench.run(limit=4.0)
    assert bench.executor().telemetry.airborne
    assert bench.authority() is N
    return bench


def upload_by_another(bench, n=1, items=1):
    """Another station puts a mission on board."""
    own = bench.onboard(n).own
    bench.from_station(d.MAVLink_mission_count_message(n, 1, items + own, 0), n)
    for seq in range(items + own):
        x, y = 473990000 + 9000 * seq, 85460000
        bench.from_station(d.MAVLink_mission_item_int_message(
            n, 1, seq, d.MAV_FRAME_GLOBAL_INT, d.MAV_CMD_NAV_WAYPOINT, 0, 1, 0, 0, 0, 0,
            x, y, 540.0, 0), n)


@kept
def suspended(kind, cause=Suspension.FAILSAFE, **kwargs):
    """SUSPENDED in flight, in the mission mode."""
    bench = flying(kind, **kwargs)
    if cause is Suspension.FAILSAFE:
        bench.vehicles[1].failsafe('battery', None)
    elif cause is Suspension.LINK:
        bench.line.cut = True
    elif cause is Suspension.AVOID:
        bench.vehicles[1].avoid(True)
    elif cause is Suspension.FOREIGN:
        bench.run(limit=3.0)
        upload_by_another(bench, items=20)
    assert bench.run(lambda: bench.authority() is S, 20.0)
    assert bench.executor().authority.suspended_by(cause)
    bench.run(limit=6.5)  # the STATUSTEXT of the failsafe no longer counts
    assert bench.authority() is S
    return bench


@kept
def lost(kind, **kwargs):
    """LOST in flight: the pilot holds it in a stick mode."""
    bench = flying(kind, **kwargs)
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    assert bench.reaches(L)
    bench.run(limit=12.0)  # commands sent before have taken effect, or never will
    return bench


def in_flight(kind, state, **kwargs):
    return {H: flying, S: suspended, L: lost, N: flown_up_by_pilot}[state](kind, **kwargs)


@kept
def on_ground(kind, state, **kwargs):
    """On the ground, disarmed, past boot, with a list on board, nothing else going on."""
    takeoff = kwargs.pop('takeoff', state is not N)
    bench = AuthorityBench(kind, takeoff=takeoff, **kwargs).discover()
    vehicle = bench.vehicles[1]
    assert bench.run(lambda: bench.authority() is (H if takeoff else N), 20.0)
    if state is S:
        vehicle.failsafe('battery', None)
        assert bench.reaches(S)
    elif state is L:
        vehicle.rc_arm(True)
        assert bench.reaches(L)
        vehicle.rc_arm(False)
    bench.run(limit=7.0)
    assert bench.authority() is state
    return bench


def armed_by_us(bench):
    """Armed on the ground while the take-off commands are lost."""
    lose_command(bench, d.MAV_CMD_NAV_TAKEOFF)
    bench.assign(task_list('AB', 2))
    assert bench.run(lambda: bench.vehicles[1].flight.armed, 10.0)
    bench.run(limit=2.5)
    assert bench.authority() is H
    return bench


def set_mode(number, kind, n=1):
    """DO_SET_MODE as any station sends it."""
    main, sub = (number >> 16 & 0xff, number >> 24) if kind == 'px4' else (number, 0)
    return d.MAVLink_command_long_message(n, 1, d.MAV_CMD_DO_SET_MODE, 0,
                                          d.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub,
                                          0, 0, 0, 0)


def is_command(m, number):
    """Whether a message is a COMMAND_LONG with this MAV_CMD."""
    return m.get_type() == 'COMMAND_LONG' and m.command == number


def lose_command(bench, number):
    """The line loses each COMMAND_LONG with this MAV_CMD from now on."""
    bench.line.tampers.append(lambda direction, m, now: [] if (
        direction == 'up' and is_command(m, number)) else None)


def delay_one_command(bench, number, delay):
    """The line delays the next COMMAND_LONG with this MAV_CMD.

    Returns the list of delays [s] that are still due: empty once it is delayed.
    """
    due = [delay]

    def hold_back(direction, m, now):
        return [(due.pop(), m)] if direction == 'up' and is_command(m, number) and due else None
    bench.line.tampers.append(hold_back)
    return due


def status_is(bench, state, *words, n=1):
    """UavState and the notes report the state, its reason, and what returns it to HELD."""
    status, authority = bench.state(n), bench.executor(n).authority
    assert bench.authority(n) is state
    assert status.authority is state
    for word in words:
        assert word in authority.why, authority.why
    available = state is H or (state is N and not authority.landed)
    assert status.available is available, status.reason
    if available:
        assert status.reason == ''
    elif not status.reason.startswith('its link'):
        assert status.reason == (f'authority {state.name}: {authority.why}; given back by '
                                 f'{authority.given_back_by}')
        assert authority.given_back_by
    notes = [note for note in bench.notes if note.startswith('authority ')]
    if notes:
        assert notes[-1].startswith(f'authority {state.name}: '), notes
        assert state is S or authority.why in notes[-1], notes[-1]
        if authority.given_back_by:
            assert notes[-1].endswith(f'; given back by {authority.given_back_by}')
    return True


def sends_no_command(bench, seconds=60.0, names='XYZ', n=1):
    """No command is sent while new lists arrive, and the state stays."""
    start, state = len(bench.sent), bench.authority(n)
    tasks = bench.onboard(n).tasks
    revision = tasks.revision if tasks else 0
    for more in range(4):
        bench.assign(task_list(names[more % 2:] if more < 3 else '', revision + 1 + more), n)
        bench.run(limit=seconds / 4.0)
        assert bench.authority(n) is state
    assert bench.commands(start) == []
    return True


__all__ = ['ARDUPILOT', 'BOTH', 'COPTER', 'LONG', 'MODES', 'PX4', 'AuthorityBench', 'H', 'L',
           'N', 'S', 'Store', 'armed_by_us', 'delay_one_command', 'flown_up_by_pilot', 'flying',
           'in_flight', 'is_command', 'lose_command', 'lost', 'on_ground', 'sends_no_command',
           'set_mode', 'status_is', 'suspended', 'upload_by_another']


def flying_with_pilot(kind):
    """A vehicle in flight that a pilot has taken."""
    bench = flying(kind, 'ABC')
    bench.vehicles[1].rc_mode(MODES[kind].stick)
    assert bench.run(lambda: bench.authority() is AuthorityState.LOST, 20.0)
    return bench
