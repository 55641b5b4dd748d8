# SPDX-License-Identifier: Apache-2.0
"""Hostile byte streams: the bridge survives, reports refusals, and serves the next vehicle.

`pytest test/mavlink/transport/test_hostile_streams.py --streams 2000` sets the number of streams;
the seeds are fixed.
"""
import random

import pytest
from hostile_streams import stream
from mission_bench import ORIGIN, make_vehicle
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.energy_estimate import NominalEnergy
from uav_task_alloc.mavlink.gcs.ground_station import GcsConfig, GroundStation
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.status import PublishedStates, state_of
from uav_task_alloc.mavlink.gcs.telemetry_messages import WANTED
from uav_task_alloc.mavlink.gcs.vehicle_diagnostics import diagnostics_of
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.mavlink.transport.codec import Codec, make_signing
from uav_task_alloc.mavlink.transport.connections import Connections
from uav_task_alloc.model import Task

LENGTH = 400  # datagrams in a stream
GOOD = 200  # system id of the correct vehicle
EXPECTED = 'expected a'  # in a refusal that names a field; all others are unexpected errors


class Wire:
    """A link without a socket: `incoming` is received next, `sent` was sent."""

    name, opened, trouble = 'wire', 1, ''

    def __init__(self, datagrams):
        self.datagrams, self.incoming, self.sent = datagrams, [], []

    def fileno(self):
        return -1

    def read(self):
        incoming, self.incoming = self.incoming, []
        return incoming

    def write(self, remote, data):
        self.sent.append((remote, data))

    def step(self, now):
        """Nothing to do."""

    def remotes(self):
        return ['remote']

    def keep(self, remotes):
        """Nothing to do: all are kept."""

    def close(self):
        """Nothing to do."""


class Bridge:
    """Connections and ground station as in the node, in virtual time."""

    def __init__(self, seed, datagrams):
        self.rng = random.Random(seed)
        self.wire = Wire(datagrams)
        self.connections = Connections([self.wire], 245, 190, wall=lambda: 1.8e9, wanted=WANTED)
        self.ground_station = GroundStation(GcsConfig(origin=ORIGIN, policy=Policy(
            takeoff=True, when_foreign=self.rng.choice(['yield', 'reassert']))),
            random.Random(seed))
        self.now, self.step_at, self.revision = 0.0, 0.0, 0
        self.published, self.states = PublishedStates(), set()

    def receive(self, remote, data):
        """As `receive` of the node, without waiting."""
        out = []
        for address, message in self.connections._parse((0, remote), data):
            out += self.ground_station.receive(address, message, self.now)
        self.connections.send(out)

    def pass_time(self, pause):
        self.now += pause
        if self.now >= self.step_at:
            self.connections.send(self.ground_station.step(self.now))
            self.connections.keep(self.ground_station.addresses())
            self.connections.step(self.now)
            self.step_at = self.now + 0.02
        for session in self.ground_station.sessions.values():
            session.executor.energy.nominal = NominalEnergy(20_000.0)
            status = state_of(session, self.now)
            self.published.is_due(status, session.executor.telemetry.position_at, self.now, 5.0)
            diagnostics_of(session, self.now)
            self.states |= {status.mission_state.name, status.authority.name}
            session.executor.notes.clear()
            session.executor.events.clear()

    def command(self):
        """In one of ten calls, assign a list to a known vehicle, or hand it over."""
        if not self.ground_station.sessions or self.rng.random() > 0.1:
            return
        session = self.rng.choice(list(self.ground_station.sessions.values()))
        self.revision += 1
        names = self.rng.sample(range(8), self.rng.randint(0, 5))
        distance = self.rng.choice([300.0, 30_000.0])
        tasks = TaskList(self.revision, tuple(
            MissionStop(Task(f't{k}', (distance * k, distance, 50.0), service_time=k / 2))
            for k in names),
            self.rng.random() < 0.5)
        self.connections.send(self.ground_station.assign(session.uav_id, tasks, self.now))
        if self.rng.random() < 0.3:
            self.ground_station.hand_over(session.uav_id, 'test', self.now)

    def unexpected(self):
        """Refusals by an unexpected error."""
        return [note.text for refusals in (self.ground_station.refusals, self.connections.refusals)
                for note in refusals.notes if EXPECTED not in note.text]

    def flies(self, guest):
        """Whether a correct vehicle that appears after the stream is served."""
        # the stream may have used its system id
        self.ground_station.sessions.pop(guest.system, None)
        end = self.now + 120.0
        while self.now < end:
            self.pass_time(0.1)
            guest.step(self)
            session = self.ground_station.sessions.get(guest.system)
            if session is None:
                continue
            if session.executor.onboard.tasks is None:
                self.connections.send(self.ground_station.assign(session.uav_id, TaskList(1, (
                    MissionStop(Task('good', (0.0, 2060.0, 50.0))),)), self.now))
            if 'good' in session.executor.onboard.progress.completed:
                return True
        return False


class Guest:
    """A simulated vehicle as a remote."""

    def __init__(self, kind, system, remote):
        self.system, self.remote, self.vehicle = system, remote, make_vehicle(kind, system)
        self.codec, self.decoder = Codec(system, 1), Codec(system, 1)

    def step(self, bridge):
        """Receive what was sent to it, and send its messages."""
        sent, bridge.wire.sent = bridge.wire.sent, []
        replies = self.vehicle.step(bridge.now)
        for to, data in sent:
            for message in self.decoder.parse(data) if to == self.remote else ():
                replies += self.vehicle.receive(message, bridge.now)
        for message in replies:
            bridge.receive(self.remote, self.codec.pack(message))


def attacked(seed):
    """A bridge after a stream; every second stream shares its system id with a flying vehicle."""
    bridge = Bridge(seed, datagrams=seed % 4 != 0)
    guest = Guest(bridge.rng.choice(['px4', 'ardupilot']), 1, 0) if seed % 2 else None
    for pause, remote, data in stream(seed, LENGTH):
        bridge.receive(remote if bridge.wire.datagrams else 'remote', data)
        bridge.pass_time(pause)
        bridge.command()
        if guest is not None:
            guest.step(bridge)
    return bridge


@pytest.fixture(scope='module')
def attacks(request):
    """By seed: the bridge after each stream, and after every 20th whether it flies a vehicle."""
    results = {}
    for seed in range(request.config.getoption('--streams')):
        bridge = attacked(seed)
        flown = seed % 20 or bridge.flies(Guest('px4', GOOD, 'good'))
        refused = bridge.ground_station.refusals.count
        results[seed] = (bridge.unexpected(), bridge.states, refused, flown)
    return results


def test_no_stream_ends_the_bridge_or_is_refused_by_an_unexpected_error(attacks):
    assert {seed: errors for seed, (errors, *_) in attacks.items() if errors} == {}


def test_after_a_hostile_stream_a_correct_vehicle_is_flown(attacks):
    assert [seed for seed, (*_, flown) in attacks.items() if not flown] == []


def test_the_streams_reach_most_states_of_the_bridge(attacks):
    assert set().union(*(states for _, states, *_ in attacks.values())) >= {
        'UNKNOWN', 'UPLOADING', 'VERIFIED', 'NONE', 'HELD', 'LOST', 'SUSPENDED'}
    assert sum(refused for _, _, refused, _ in attacks.values()) > 10 * len(attacks)


def test_frames_signed_with_another_key_are_dropped_without_an_error(tmp_path):
    tmp_path.joinpath('key').write_bytes(bytes(32))
    connections = Connections([Wire(True)], 245, 190, wall=lambda: 1.8e9,
                              signing_key_file=str(tmp_path / 'key'))
    forger = Codec(1, 1, signing=make_signing(b'x' * 32, 10**14))
    rng = random.Random(1)
    for pause, remote, data in stream(1, LENGTH):
        signed = forger.pack(d.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))
        cut = signed[:rng.randrange(len(signed))]
        assert connections._parse((0, remote), rng.choice([data, signed, cut])) == [], pause
    assert connections.refusals.count == 0
