# SPDX-License-Identifier: Apache-2.0
"""Connects a ground station to simulated vehicles by frames in virtual time."""
import random

from bench_copy import kept
from mission_bench import ORIGIN, OURS, Line, make_vehicle, task_list

from uav_task_alloc.mavlink.gcs.ground_station import GcsConfig, GroundStation
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.status import state_of
from uav_task_alloc.mavlink.gcs.telemetry_messages import WANTED
from uav_task_alloc.mavlink.transport.codec import Codec


class FlightBench:
    """A ground station with simulated vehicles, each on a line of its own."""

    def __init__(self, *kinds, seed=0, loss=0.0, delay=(0.0, 0.0), takeoff=True, configs=None,
                 tick=0.1, store=None, **policy):
        self.store = store or Store()
        self.now, self.tick = 0.0, tick
        self.seed, self.policy = seed, Policy(takeoff=takeoff, **policy)
        self.vehicles = {n: make_vehicle(kind, n, **(configs or {}).get(n, {}))
                         for n, kind in enumerate(kinds, 1)}
        self.line = Line(seed, loss, delay)
        self.codecs = {('down', n): Codec(n, 1) for n in self.vehicles}
        self.decoders = {('up', n): Codec(*OURS) for n in self.vehicles}
        self.truth = {n: [] for n in self.vehicles}  # events of the simulator
        self.start()

    def start(self):
        """A new ground station, as after kill -9, with what the `store` holds."""
        self.ground_station = GroundStation(GcsConfig(origin=ORIGIN, policy=self.policy),
                             random.Random(self.seed), self.store)
        for n in self.vehicles:
            self.codecs['up', n] = Codec(*OURS)
            self.decoders['down', n] = Codec(*OURS, wanted=WANTED)  # as the node does
        for n in self.vehicles:
            self.decoders['up', n] = Codec(n, 1)
        self.events, self.notes = [], []

    def executor(self, n=1):
        return self.ground_station.sessions[n].executor

    def onboard(self, n=1):
        return self.executor(n).onboard

    def assign(self, tasks, n=1):
        self._up(self.ground_station.assign(f'uav_{n}', tasks, self.now))

    def from_vehicle(self, message, n=1):
        """Receive a message as from a vehicle."""
        self._up(self.ground_station.receive(n, self.decoders['down', n].parse(
            self.codecs['down', n].pack(message))[0], self.now))
        self._collect()

    def from_station(self, message, n=1, system=255):
        """Send a message to a vehicle from another ground station."""
        for m in self.decoders['up', n].parse(Codec(system, 190).pack(message)):
            self._down(n, self.vehicles[n].receive(m, self.now))

    def run(self, until=lambda: False, limit=300.0):
        """Advance time until the condition holds; whether it did."""
        end = self.now + limit
        while self.now < end:
            self._move()
            if until():
                return True
            self.now += self.tick
        return bool(until())

    def discover(self):
        """Run until all vehicles are discovered."""
        assert self.run(lambda: len(self.ground_station.sessions) == len(self.vehicles), 30.0)
        return self

    def completed(self, n=1):
        return [e.task for u, e in self.events if u == f'uav_{n}' and e.event == 'COMPLETED']

    def started(self, n=1):
        return [e.task for u, e in self.events if u == f'uav_{n}' and e.event == 'STARTED']

    def failed(self, n=1):
        return [e.task for u, e in self.events if u == f'uav_{n}' and e.event == 'FAILED']

    def hand_over(self, n=1):
        """Hand over as an operator; returns why it is refused."""
        return self.ground_station.hand_over(f'uav_{n}', 'test', self.now)

    def authority(self, n=1):
        return self.executor(n).authority.state

    def state(self, n=1):
        return state_of(self.ground_station.sessions[n], self.now)

    def flown(self, n=1, radius=3.0):
        """Positions [m] at which the vehicle reached an item in the simulator, in order."""
        return [tuple(round(c) for c in e.point) for e in self.truth[n]
                if e.name == 'item_reached']

    def _move(self):
        for n, vehicle in self.vehicles.items():
            self._down(n, vehicle.step(self.now))
        self._up(self.ground_station.step(self.now))
        busy = True
        while busy:
            busy = False
            for direction, n, frame in self.line.due(self.now):
                busy = True
                for m in self.decoders[direction, n].parse(frame):
                    if direction == 'up':
                        self._down(n, self.vehicles[n].receive(m, self.now))
                    else:
                        self._up(self.ground_station.receive(n, m, self.now))
        self._collect()

    def _collect(self):
        for session in self.ground_station.sessions.values():
            while session.executor.events:
                self.events.append((session.uav_id, session.executor.events.popleft()))
            while session.executor.notes:
                self.notes.append(session.executor.notes.popleft().text)
        for n, vehicle in self.vehicles.items():
            self.truth[n] += vehicle.take_events()

    def _up(self, outgoing):
        for n, m in outgoing:
            self.line.send('up', n, self.codecs['up', n], m, self.now)

    def _down(self, n, messages):
        for m in messages:
            self.line.send('down', n, self.codecs['down', n], m, self.now)


@kept
def flying(kind, names='ABC', **kwargs):
    """A vehicle flying to the first of some tasks."""
    service = kwargs.pop('service', 0.0)
    bench = FlightBench(kind, **kwargs).discover()
    bench.assign(task_list(names, service=service))
    assert bench.run(lambda: bench.started() == [names[0]])
    return bench


def places(bench, n=1):
    """Tasks by the positions reached in the simulator, as letters of the grid."""
    return [to_letter(p) for p in bench.flown(n)]


def to_letter(p):
    return 'ABCDEFGHIJKLMNOPQRSTUVWXYZ'[round(p[0] / 100.0) + 5 * (round(p[1] / 100.0) - 1)]


class Store:
    """An AuthorityStore in memory."""

    def __init__(self):
        self.records, self.saved = {}, 0

    def load(self, uav_id):
        return self.records.get(uav_id)

    def save(self, uav_id, record):
        self.records[uav_id] = record
        self.saved += 1
