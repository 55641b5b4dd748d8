# SPDX-License-Identifier: Apache-2.0
"""A second station commands LAND, RTL, and LOITER or Hold: each lasts until the hand-over."""
import math
from collections import Counter
from dataclasses import replace

import pytest
from sitl_bench import Bridge, SecondStation, Visits, interferes, stops
from worlds import HOMES, SYSTEMS

from uav_task_alloc.mavlink.autopilots import ModeFunction
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task

TASKS = 8  # of each vehicle
UNDISTURBED = 15.0  # [s] of the bridge in which the bridge must not command a taken vehicle
# (main mode, sub mode) by kind of autopilot; in LOITER the sticks are centred
MODES = {'ardupilot': {'land': (9, 0), 'return': (6, 0), 'hold': (5, 0)},
         'px4': {'land': (4, 6), 'return': (4, 5), 'hold': (4, 3)}}
LANDED, RETURNED, HELD, LEFT_ALONE = SYSTEMS


class Course:
    """A row of tasks."""

    def __init__(self, system):
        x, y, _ = HOMES[system]
        self.places = {f'u{system}_{k}': (x, y + 60.0 * (k + 1), 40.0) for k in range(TASKS)}
        self.visits, self.done = Visits(self.places), []
        self.list = TaskList(
            1,
            tuple(
                MissionStop(Task(name, place, service_time=2.0))
                for name, place in self.places.items()
            ),
        )

    @property
    def ended(self):
        return set(self.done) == set(self.places)


class Watched(Bridge):
    """Records what is sent to a vehicle after a mode change by another station was received."""

    def __init__(self, world):
        super().__init__(world, {n: Course(n) for n in SYSTEMS})
        self.modes = {}  # system -> latest custom_mode
        self.awaited = {}  # system -> custom_mode set by the other station
        self.taken = {}  # system -> messages sent since it was received

    def before_receive(self, message, now):
        system = message.get_srcSystem()
        if message.get_type() != 'HEARTBEAT' or system not in SYSTEMS:
            return
        self.modes[system] = message.custom_mode
        if self.awaited.get(system) == message.custom_mode:
            del self.awaited[system]
            self.taken[system] = []

    def send(self, out):
        super().send(out)
        for _, message in out:
            if interferes(message) and message.target_system in self.taken:
                self.taken[message.target_system].append(str(message))

    def update_visits(self, system):
        if system in self.ground_station.sessions and self.executor(system).authority.held:
            super().update_visits(system)  # else it may be stopped anywhere

    def collect(self, system, session):
        super().collect(system, session)
        if not self.courses[system].done and session.executor.onboard.tasks is None:
            tasks = self.courses[system].list
            self.send(self.ground_station.assign(session.uav_id, tasks, self.now()))

    def hand_over(self, system):
        uav_id = self.ground_station.sessions[system].uav_id
        return self.ground_station.hand_over(uav_id, 'pilot', self.now())

    def executor(self, system):
        return self.ground_station.sessions[system].executor

    def telemetry(self, system):
        return self.executor(system).telemetry

    def in_mid_mission(self, system):
        """Whether it flies between two tasks."""
        course = self.courses[system]
        if len(course.done) < 2 or self.telemetry(system).mode is not ModeFunction.MISSION:
            return False
        at = self.telemetry(system).position
        return min(math.dist(at, place) for place in course.places.values()) > 12.0


class Takeover:
    """A second station that takes three of the vehicles."""

    def __init__(self, world):
        self.kind, self.bridge, self.station = world.kind, Watched(world), SecondStation(world)

    def until(self, condition, what):
        def both():
            self.station.serve()
            return condition()
        self.bridge.until(both, what)

    def take(self, system, name):
        """Set a mode, as a pilot would, until the vehicle reports it."""
        bridge, (main, sub) = self.bridge, MODES[self.kind][name]
        self.until(lambda: bridge.in_mid_mission(system), f'{system} in mid-mission')
        if name == 'hold' and self.kind == 'ardupilot':
            self.station.sticks_of.add(system)
        bridge.awaited[system] = main if self.kind == 'ardupilot' else main << 16 | sub << 24
        due = 0.0

        def taken():
            nonlocal due
            if bridge.now() >= due:
                due = bridge.now() + 1.0
                self.station.set_mode(system, main, sub)
            return system in bridge.taken
        self.until(taken, f'{system} in {name}')

    def wait(self, seconds):
        end = self.bridge.now() + seconds
        self.until(lambda: self.bridge.now() >= end, f'{seconds} s')

    def close(self):
        self.station.close()
        self.bridge.close()


@pytest.fixture
def takeover(world):
    started = Takeover(world)
    yield started
    started.close()


def test_a_mode_set_by_a_second_station_lasts_until_the_hand_over(takeover, world):
    bridge = takeover.bridge
    takeover.until(lambda: len(bridge.ground_station.sessions) == len(SYSTEMS),
                   'all vehicles discovered')
    for system, name in ((LANDED, 'land'), (RETURNED, 'return'), (HELD, 'hold')):
        takeover.take(system, name)
    held = bridge.telemetry(HELD)
    takeover.wait(3.0)
    at = held.position

    each_stays_where_it_was_sent(takeover)
    assert held.airborne
    assert math.dist(held.position, at) < 10.0
    takeover.until(lambda: bridge.courses[LEFT_ALONE].ended, 'the fourth has flown its list')

    all_fly_after_the_hand_over(takeover)
    world.close()
    for system, course in bridge.courses.items():
        assert Counter(course.done) == Counter(list(course.places)), f'{system}: reported twice'
        assert stops(world, system, course) == course.done, f'{system}: reported is not flown'


def each_stays_where_it_was_sent(takeover):
    bridge = takeover.bridge
    takeover.until(lambda: not bridge.telemetry(LANDED).armed, 'landed')
    takeover.until(lambda: not bridge.telemetry(RETURNED).armed, 'at home')
    assert math.dist(bridge.telemetry(RETURNED).position, HOMES[RETURNED]) < 5.0
    assert math.dist(bridge.telemetry(LANDED).position, HOMES[LANDED]) > 60.0
    takeover.wait(UNDISTURBED)
    for system in (LANDED, RETURNED):
        assert not bridge.telemetry(system).armed
        assert bridge.telemetry(system).height < 2.0
    assert bridge.taken == {LANDED: [], RETURNED: [], HELD: []}, '\n'.join(bridge.notes)
    assert {n: bridge.executor(n).authority.state for n in SYSTEMS} == {
        LANDED: AuthorityState.LOST,
        RETURNED: AuthorityState.LOST,
        HELD: AuthorityState.LOST,
        LEFT_ALONE: AuthorityState.HELD,
    }


def all_fly_after_the_hand_over(takeover):
    bridge = takeover.bridge
    for system in (LANDED, RETURNED):  # on the ground it takes the operator's leave to start
        executor = bridge.executor(system)
        executor.policy = replace(executor.policy, takeoff=False)
        assert 'takeoff is false' in bridge.hand_over(system)
        executor.policy = replace(executor.policy, takeoff=True)
    takeover.wait(3.0)
    assert bridge.taken == {LANDED: [], RETURNED: [], HELD: []}, '\n'.join(bridge.notes)
    takeover.station.sticks_of.clear()
    for system in (LANDED, RETURNED, HELD):
        assert bridge.hand_over(system) == ''
    takeover.until(lambda: all(course.ended for course in bridge.courses.values()), 'all flown')
