# SPDX-License-Identifier: Apache-2.0
"""Shared by the tests of findings: pilots, second stations, lost messages, simulator events."""
import math

import pytest
from bench_copy import kept
from flight_bench import FlightBench, places
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task
from uav_task_alloc.sim.modes import px4_mode

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
KINDS = ('ardupilot', 'px4')
US = 'station 245/190'
# custom_mode by autopilot; PAUSE is a hold by a station, LOITER by a pilot
MODES = {
    'ardupilot': {'RTL': 6, 'LAND': 9, 'PAUSE': 4, 'LOITER': 5, 'BRAKE': 17, 'AUTO': 3},
    'px4': {'RTL': px4_mode(4, 5), 'LAND': px4_mode(4, 6), 'PAUSE': px4_mode(4, 3),
            'LOITER': px4_mode(3), 'BRAKE': px4_mode(4, 3), 'AUTO': px4_mode(4, 4)}}


class FindingsBench(FlightBench):
    """A bench that records the level of each note."""

    def __init__(self, *kinds, **kwargs):
        self.levels = []  # (level, text)
        super().__init__(*kinds, **kwargs)
        self.kind = kinds[0]

    def _collect(self):
        for session in self.ground_station.sessions.values():
            self.levels += [(note.level, note.text) for note in session.executor.notes]
        super()._collect()

    def noted(self, *words):
        """Notes with all of these words."""
        return [note for note in self.notes if all(word in note for word in words)]


@kept
def flying(kind, names='ABC', **kwargs):
    """A vehicle flying to the first of some tasks."""
    lists = {key: kwargs.pop(key) for key in ('service', 'side', 'returns') if key in kwargs}
    bench = FindingsBench(kind, **kwargs).discover()
    bench.assign(task_list(names, **lists))
    assert bench.run(lambda: bench.started() == [names[0]])
    return bench


def listed(revision, **stops):
    """A list of tasks by name, each at a position (x, y) [m], 50 m high."""
    return TaskList(revision, tuple(MissionStop(Task(name, (*place, 50.0)))
                                    for name, place in stops.items()))


def take(bench, mode, by='station', n=1):
    """Change the mode as a second station, a pilot or a failsafe."""
    number, vehicle = MODES[bench.kind][mode], bench.vehicles[n]
    if by == 'pilot':
        vehicle.rc_mode(number)
    elif by == 'failsafe':
        vehicle.failsafe('radio', number)
    else:
        main, sub = (number >> 16 & 0xff, number >> 24) if number > 0xffff else (number, 0)
        bench.from_station(d.MAVLink_command_long_message(
            n, 1, d.MAV_CMD_DO_SET_MODE, 0, 1, main, sub, 0, 0, 0, 0), n)
    assert vehicle.flight.custom_mode == number


def commanded(bench, n=1):
    """Commands that came from the bridge, by the simulator events."""
    return [e.command for e in bench.truth[n] if e.name == 'command' and e.cause == US]


def left_alone(bench, seconds=40.0, n=1):
    """Check that the bridge commands nothing for a while."""
    before = len(commanded(bench, n))
    bench.run(limit=seconds)
    assert commanded(bench, n)[before:] == []


def arms(bench):
    """Arming commands that were sent."""
    return [m for m in bench.line.sent('COMMAND_LONG')
            if m.command == d.MAV_CMD_COMPONENT_ARM_DISARM and m.param1 == 1.0]


def truthful(bench, until, limit=300.0):
    """Run, and check that no task is COMPLETED that the vehicle has not reached."""
    checked_at = None

    def checked():
        nonlocal checked_at
        at = len(bench.events), len(bench.truth[1])
        if at != checked_at:  # either only grows
            checked_at = at
            assert set(bench.completed()) <= set(places(bench)), (bench.completed(), places(bench))
        return until()
    return bench.run(checked, limit)


def flown_once_each(bench, names, limit=400.0):
    """Check that all tasks are flown and reported once, none before it is flown."""
    assert truthful(bench, lambda: len(bench.completed()) >= len(names), limit), (
        bench.completed(), places(bench))
    bench.run(limit=20.0)
    assert sorted(bench.completed()) == sorted(places(bench)) == sorted(names)


def set_current(bench, index, n=1):
    """Set the current item as a second station."""
    seq = bench.onboard(n).own + index
    bench.from_station(d.MAVLink_mission_set_current_message(n, 1, seq), n)


def drop_messages(bench, lost_direction, kind, when):
    """The line loses messages of a type while `when(message)` holds."""
    bench.line.tampers.append(lambda direction, m, now: [] if (
        direction == lost_direction and m.get_type() == kind and when(m)) else None)


def distance(bench, place, n=1):
    """Distance [m] of the simulated vehicle from a position."""
    return math.dist(bench.vehicles[n].flight.body.position, place)


def happened(bench, name, n=1):
    """Whether the simulator has an event of that name."""
    return any(e.name == name for e in bench.truth[n])
