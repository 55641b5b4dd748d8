# SPDX-License-Identifier: Apache-2.0
"""The bridge without ROS on the links of a world, and a second ground station."""
import math
import random
import time

from pymavlink.dialects.v20 import ardupilotmega as d
from worlds import ORIGIN, SYSTEMS

from uav_task_alloc.mavlink.gcs.ground_station import GcsConfig, GroundStation
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.transport.connections import Connections
from uav_task_alloc.mavlink.transport.heartbeat import Heartbeat

READS = {d.MAV_CMD_SET_MESSAGE_INTERVAL, d.MAV_CMD_REQUEST_MESSAGE}
COMMANDS = {'COMMAND_LONG', 'COMMAND_INT', 'SET_MODE', 'MISSION_SET_CURRENT'}
CHANGES = {'MISSION_COUNT', 'MISSION_ITEM', 'MISSION_ITEM_INT', 'MISSION_CLEAR_ALL'}


class Visits:
    """The places at which a vehicle came to rest, by its own positions: where it serves tasks."""

    def __init__(self, places):
        self.places, self.visited, self._at = places, [], None

    def update(self, position, velocity):
        if self._at is not None and math.dist(position, self.places[self._at]) > 10.0:
            self._at = None
        if math.hypot(*velocity) > 1.0:
            return
        for name, place in self.places.items():
            if name != self._at and math.dist(position, place) < 5.0:
                self.visited.append(name)
                self._at = name


def stops(world, system, course):
    """The places at which a vehicle stopped, in order; after `world.close()`.

    By the simulator's log where there is one: its positions may be received seconds apart."""
    reached = world.reached(system)
    if reached is None:
        return course.visits.visited
    places = course.places
    return [min(places, key=lambda name, at=point: math.dist(places[name], at))
            for point in reached]


class Bridge:
    """Serves the vehicles of a world; a course has `visits`, and the completed tasks in order."""

    def __init__(self, world, courses):
        self.world, self.courses = world, courses
        self.connections = Connections(world.links, 245, 190, wall=time.time)
        self.heartbeat = Heartbeat(self.connections.send_to_all)
        policy = Policy(takeoff=True, cruise_altitude=30.0)
        self.ground_station = GroundStation(GcsConfig(
            origin=ORIGIN, system_ids=SYSTEMS, policy=policy), random.Random(1))
        self.events, self.notes = [], []
        self.began = self.now()
        self.heartbeat.start()

    def now(self):
        return self.world.now()

    def before_receive(self, message, now):
        """Hook: called before the bridge processes a message of a vehicle."""

    def send(self, out):
        self.connections.send(out)

    def serve(self):
        """Receive messages, and advance time."""
        self.world.serve()
        now = self.now()
        for address, message in self.connections.receive(0.01):
            self.before_receive(message, now)
            self.send(self.ground_station.receive(address, message, now))
            if message.get_type() == 'GLOBAL_POSITION_INT':
                self.update_visits(message.get_srcSystem())
        self.send(self.ground_station.step(now))
        self.connections.step(now)
        for system, session in self.ground_station.sessions.items():
            self.collect(system, session)

    def update_visits(self, system):
        session = self.ground_station.sessions.get(system)
        if session and session.executor.telemetry.airborne:
            telemetry = session.executor.telemetry
            self.courses[system].visits.update(telemetry.position, telemetry.velocity)

    def collect(self, system, session):
        while session.executor.events:
            event = session.executor.events.popleft()
            self.events.append((system, event))
            if event.event == 'COMPLETED':
                self.courses[system].done.append(event.task)
        while session.executor.notes:
            note = session.executor.notes.popleft()
            self.notes.append(f'{self.now() - self.began:6.1f} {session.uav_id}: '
                              f'{note.level}: {note.text}')

    def until(self, condition, what):
        """Serve until `condition()`; fail where that takes longer than the limit."""
        end = time.monotonic() + self.world.limit
        while not condition():
            assert time.monotonic() < end, '\n'.join(
                [f'timed out: {what}', *self.notes, *(
                    f'{system}: done {course.done}' for system, course in self.courses.items())])
            self.serve()

    def close(self):
        self.heartbeat.close()
        self.connections.close()


class SecondStation:
    """Another ground station, with links of its own to the vehicles; it sets modes."""

    def __init__(self, world):
        self.connections = Connections(world.second_links(), 255, 190, wall=time.time)
        self.heartbeat = Heartbeat(self.connections.send_to_all)
        self.sticks_of = set()  # systems whose sticks it keeps centred
        self._at = 0.0
        self.heartbeat.start()

    def serve(self):
        """Drop received messages; repeat the sticks, as their end would trigger a failsafe."""
        now = time.monotonic()
        self.connections.receive(0.0)
        self.connections.step(now)
        if now < self._at:
            return
        self._at = now + 0.1
        for system in self.sticks_of:
            self._send(system, d.MAVLink_rc_channels_override_message(
                system, 1, 1500, 1500, 1500, 1500, *[0xffff] * 4))

    def set_mode(self, system, main, sub=0):
        self._send(system, d.MAVLink_command_long_message(
            system, 1, d.MAV_CMD_DO_SET_MODE, 0, d.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            main, sub, 0, 0, 0, 0))

    def _send(self, system, message):
        number = SYSTEMS.index(system)
        link = self.connections.links[number]
        self.connections.send(((number, remote), message) for remote in link.remotes())

    def close(self):
        self.heartbeat.close()
        self.connections.close()


def interferes(message):
    """Whether a message changes anything on a vehicle."""
    kind = message.get_type()
    return kind in CHANGES or (
        kind in COMMANDS and getattr(message, 'command', None) not in READS)
