# SPDX-License-Identifier: Apache-2.0
"""One simulated vehicle, a link that may fail, a bridge that may be killed; virtual time."""
from __future__ import annotations

import heapq
import itertools
import random
from collections.abc import Iterator

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityRecord, AuthorityState
from uav_task_alloc.mavlink.gcs.ground_station import GcsConfig, GroundStation
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.status import UavStatus, state_of
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress
from uav_task_alloc.mavlink.transport.codec import Codec, Message
from uav_task_alloc.sim.config import TruthEvent, VehicleConfig
from uav_task_alloc.sim.vehicle import AUTOPILOTS, Vehicle

ORIGIN = Origin(47.397742, 8.545594, 488.0)
BRIDGE, OTHER = (245, 190), (255, 190)  # system, component
TICK = 0.1  # [s]
LATE = 0.05  # share of frames that a lossy link delays by up to 5 s
LATEST = 5.0  # [s]


class Link:
    """Carries frames both ways: in order, or with loss, delay and reordering."""

    def __init__(self, rng: random.Random, lossy: bool) -> None:
        self._rng = rng
        self.loss = rng.uniform(0.0, 0.2) if lossy else 0.0
        self.delay = rng.uniform(0.0, 0.3) if lossy else rng.uniform(0.0, 0.1)
        self._lossy, self.cut_until = lossy, 0.0  # [s]
        self._frames: list[tuple[float, int, str, float, bytes]] = []
        self._number = itertools.count()

    def send(self, direction: str, frame: bytes, now: float) -> None:
        """Send a frame; an ordered link keeps the order, a lossy one does not."""
        if now < self.cut_until or self._rng.random() < self.loss:
            return
        delay = self.delay
        if self._lossy:
            delay *= self._rng.random()
            if self._rng.random() < LATE:
                delay = self._rng.uniform(0.0, LATEST)
        heapq.heappush(self._frames, (now + delay, next(self._number), direction, now, frame))

    def due(self, now: float) -> Iterator[tuple[str, float, bytes]]:
        """Direction, time of sending [s] and frame of each frame that arrives by `now`."""
        while self._frames and self._frames[0][0] <= now + 1e-9:
            _, _, direction, sent, frame = heapq.heappop(self._frames)
            yield direction, sent, frame


class Store:
    """The bridge's state_dir."""

    def __init__(self) -> None:
        self.records: dict[str, AuthorityRecord] = {}

    def load(self, uav_id: str) -> AuthorityRecord | None:
        return self.records.get(uav_id)

    def save(self, uav_id: str, record: AuthorityRecord) -> None:
        self.records[uav_id] = record


class World:
    """Moves everything by a tick; the judge reads `arrivals` and `sent`."""

    def __init__(self, kind: str, rng: random.Random, lossy: bool, policy: Policy,
                 **config: object) -> None:
        self.rng, self.now, self.policy = rng, 0.0, policy
        self.vehicle = Vehicle(VehicleConfig('uav_1', 1, ORIGIN, (0.0, 0.0, 0.0), floods=False,
                                             **config), AUTOPILOTS[kind])  # type: ignore[arg-type]
        self.link, self.store = Link(rng, lossy), Store()
        self._down = Codec(1, 1)
        self.events: list[TaskProgress] = []
        self.truth: list[TruthEvent] = []  # of the last tick
        self.delivered: list[tuple[float, Message]] = []  # in the last tick: sent at [s], frame
        self.arrivals: list[float] = []  # when heartbeats of the last tick were sent [s]
        self.sent: list[tuple[float, Message]] = []  # by the bridge, in the last tick
        self.notes: list[str] = []
        self.errors: list[str] = []  # in the bridge, which it has caught
        self.started_at = 0.0  # [s] the bridge
        self.tasks: TaskList | None = None
        self.start()

    def start(self, keep: bool = True) -> None:
        """A new bridge, after a kill -9; `keep`: it has a state_dir."""
        if not keep:
            self.store = Store()
        self.ground_station = GroundStation(GcsConfig(origin=ORIGIN, policy=self.policy),
                             random.Random(self.rng.random()), self.store)
        self._up, self._ear, self._vehicle_ear = Codec(*BRIDGE), Codec(*BRIDGE), Codec(1, 1)
        self.started_at, self._assigned = self.now, False

    @property
    def state(self) -> UavStatus | None:
        """The published state of the UAV; None before the bridge has found it."""
        session = self.ground_station.sessions.get(1)
        return None if session is None else state_of(session, self.now)

    @property
    def authority(self) -> AuthorityState:
        """That of `state`, at a tenth of its CPU time; UNKNOWN before the bridge has found it."""
        session = self.ground_station.sessions.get(1)
        authority = None if session is None else session.executor.authority
        return AuthorityState.UNKNOWN if authority is None or authority.undecided else (
            authority.state)

    def assign(self, tasks: TaskList) -> None:
        """A list for the UAV, again after a restart of the bridge."""
        self.tasks, self._assigned = tasks, False

    def hand_over(self) -> str:
        """Call the hand-over service; returns an error text, '' on success."""
        if 1 not in self.ground_station.sessions:
            return 'not found'
        return self.ground_station.hand_over('uav_1', 'operator', self.now)

    def station(self, message: Message) -> None:
        """Another ground station, on a link of its own."""
        for m in Codec(1, 1).parse(Codec(*OTHER).pack(message)):
            self._send_down(self.vehicle.receive(m, self.now))

    def step(self) -> None:
        """Step the world by one TICK."""
        self.now += TICK
        self.arrivals, self.sent, self.delivered = [], [], []
        self._send_down(self.vehicle.step(self.now))
        self._send_up(self.ground_station.step(self.now))
        if self.tasks is not None and not self._assigned and 1 in self.ground_station.sessions:
            self._assigned = True
            self._send_up(self.ground_station.assign('uav_1', self.tasks, self.now))
        for direction, sent, frame in self.link.due(self.now):
            if direction == 'up':
                for m in self._vehicle_ear.parse(frame):
                    self._send_down(self.vehicle.receive(m, self.now))
            else:
                for m in self._ear.parse(frame):
                    self.delivered.append((sent, m))
                    if m.get_type() == 'HEARTBEAT':
                        self.arrivals.append(sent)
                    self._send_up(self.ground_station.receive('link', m, self.now))
        self.truth = self.vehicle.take_events()
        for session in self.ground_station.sessions.values():
            while session.executor.events:
                self.events.append(session.executor.events.popleft())
            while session.executor.notes:
                self.notes.append(f'{self.now:.1f} {session.executor.notes.popleft().text}')

        refused = self.ground_station.refusals.notes
        while refused:
            if 'Error: ' in (text := refused.popleft().text):
                self.errors.append(f'{self.now:.1f} errors: {text}')

    def _send_down(self, messages: list[Message]) -> None:
        for m in messages:
            self.link.send('down', self._down.pack(m), self.now)

    def _send_up(self, outgoing: list[tuple[object, Message]]) -> None:
        for _, m in outgoing:
            self.sent.append((self.now, m))
            self.link.send('up', self._up.pack(m), self.now)
