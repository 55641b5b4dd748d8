# SPDX-License-Identifier: Apache-2.0
"""Connects an upload to a simulated autopilot by frames in virtual time, over a lossy line."""
import heapq
import random

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.autopilots import ARDUPILOT, PX4
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList, home_item, mission_items
from uav_task_alloc.mavlink.mission.outcomes import Mission, Verified
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.mission.upload import Upload
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.model import Task
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.vehicle import AUTOPILOTS, Vehicle

ORIGIN = Origin(47.397742, 8.545594, 488.0)
OURS, TICK = (245, 190), 0.05  # [s]
PROFILES = {'ardupilot': ARDUPILOT, 'px4': PX4}
# configs of vehicles of which a PX4 reports its mission_state
REPORTS_STATE = {n: {'reports_mission_state': True} for n in (1, 2)}


def square(n, side=100.0, z=50.0):
    """n positions [m] ENU, far enough apart not to be confused."""
    return [(side * (k % 5), side * (1 + k // 5), z) for k in range(n)]


def task_list(names, revision=1, *, side=100.0, service=0.0, returns=False, via=None, shift=0):
    """A list of tasks named by letters or words, each at the position of its name."""
    names = list(names)
    places = dict(zip('ABCDEFGHIJKLMNOPQRSTUVWXYZ', square(26, side), strict=True))
    stops = []
    for n, name in enumerate(names):
        place = places.get(name) or square(n + shift + 1, side)[-1]
        stops.append(MissionStop(Task(name, place, service_time=service),
                          tuple((via or {}).get(name, ()))))
    return TaskList(revision, tuple(stops), returns)


def make_vehicle(kind, system, **config):
    """A simulated vehicle that can arm at once and streams only requested messages."""
    config = {'arming_delay': 0.0, 'boot_delay': 0.0, 'settling_time': 0.0, 'floods': False,
              'position': (0.0, 10.0 * system, 0.0), **config}
    return Vehicle(VehicleConfig(f'uav_{system}', system, ORIGIN, **config), AUTOPILOTS[kind])


class Line:
    """Carries frames in both directions with loss and delay; `tampers` get each message first.

    A tamper takes (direction 'up' or 'down', message, now) and returns None to pass it, or a list
    of (delay, message) to carry in its place.
    """

    def __init__(self, seed=0, loss=0.0, delay=(0.0, 0.0)):
        self.rng = random.Random(seed)
        self.loss, self.delay = loss, delay
        self.cut = False
        self.tampers = []
        self.log = []  # (now, direction, message)
        self._flying, self._number = [], 0

    def send(self, direction, key, codec, message, now):
        self.log.append((now, direction, message))
        carried = [(self.rng.uniform(*self.delay), message)]
        for tamper in self.tampers:
            other = tamper(direction, message, now)
            if other is not None:
                carried = other
                break
        if not carried:
            codec.pack(message)
        for delay, m in carried:
            frame = codec.pack(m) if not isinstance(m, bytes) else m  # lost frames have a seq too
            if not self.cut and self.rng.random() >= self.loss:
                self._number += 1
                heapq.heappush(self._flying, (now + delay, self._number, direction, key, frame))

    def due(self, now):
        flying, until = self._flying, now + 1e-9
        while flying and flying[0][0] <= until:
            yield heapq.heappop(flying)[2:]

    def sent(self, kind, direction='up'):
        """Messages of a type that were sent over the line, lost ones included."""
        return [m for _, d, m in self.log if d == direction and m.get_type() == kind]


class UploadBench:
    """An `Upload` and the mission protocol of one simulated autopilot."""

    def __init__(self, kind, *, seed=0, loss=0.0, delay=(0.0, 0.0), capacity=500):
        self.profile = PROFILES[kind]
        self.now, self.line = 0.0, Line(seed, loss, delay)
        self.vehicle = make_vehicle(kind, 1, capacity=capacity)
        self.peer = Peer(1)
        self.upload = Upload(self.peer, idle_after=lambda: self.profile.idle_after,
                             rng=random.Random(seed),
                             error_when_closed=not self.profile.atomic)
        self.codecs = {'up': Codec(*OURS), 'down': Codec(1, 1)}
        self.decoders = {'up': Codec(1, 1), 'down': Codec(*OURS)}
        self.events = []

    def mission(self, names='ABC', **kwargs):
        rules = self.profile.rules
        own = int(rules.home_first)
        items = mission_items(task_list(names, **kwargs), rules, ORIGIN)
        return Mission((home_item(None, ORIGIN, rules),) * own + items, own,
                       self.profile.atomic, own)

    def replace(self, mission):
        self._up(self.upload.replace(mission, self.now))
        return mission

    def from_vehicle(self, message, system=1, component=1):
        """Receive a message as from the vehicle."""
        codec = Codec(system, component)
        for m in self.decoders['down'].parse(codec.pack(message)):
            self._up(self.upload.receive(m, self.now))

    def run(self, until=lambda: False, limit=120.0):
        """Advance time until the condition holds; whether it did."""
        end = self.now + limit
        while self.now < end:
            self._move()
            if until():
                return True
            self.now += TICK
        return until()

    def settle(self, limit=300.0):
        """Run until the upload has ended; returns its last event."""
        assert self.run(lambda: not self.upload.busy, limit)
        return self.events[-1]

    def _move(self):
        self._down(self.vehicle.step(self.now))
        self._up(self.upload.step(self.now))
        busy = True
        while busy:
            busy = False
            for direction, _, frame in self.line.due(self.now):
                busy = True
                for m in self.decoders[direction].parse(frame):
                    if direction == 'up':
                        self._down(self.vehicle.receive(m, self.now))
                    else:
                        self._up(self.upload.receive(m, self.now))
        while self.upload.events:
            self.events.append(self.upload.events.popleft())

    def _up(self, messages):
        for m in messages:
            self.line.send('up', None, self.codecs['up'], m, self.now)

    def _down(self, messages):
        for m in messages:
            self.line.send('down', None, self.codecs['down'], m, self.now)

    def holds(self, mission):
        """Whether the vehicle stores exactly this mission."""
        held = [(i.command, i.x, i.y, round(i.z, 2)) for i in self.vehicle.mission.items]
        sent = [(i.command, i.x, i.y, round(i.z, 2)) for i in mission.items]
        own = mission.own
        return len(held) == len(sent) and all(
            a[:3] == b[:3] and abs(a[3] - b[3]) < 0.02 for a, b in zip(
                held[own:], sent[own:], strict=True))


def drop(kinds, times, direction=None):
    """A tamper that drops the first `times` messages of some types."""
    left = [times]

    def tamper(sent_direction, message, now):
        if message.get_type() in kinds and direction in (None, sent_direction) and left[0]:
            left[0] -= 1
            return []
        return None
    return tamper


def ack(result, system=245, component=190, mission_type=0):
    return d.MAVLink_mission_ack_message(system, component, result, mission_type)


def request(seq, system=245, component=190, mission_type=0):
    return d.MAVLink_mission_request_int_message(system, component, seq, mission_type)


def verified(bench, mission):
    last = bench.settle()
    assert isinstance(last, Verified), last
    assert last.mission is mission
    assert bench.holds(mission)
