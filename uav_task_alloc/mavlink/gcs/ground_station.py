# SPDX-License-Identifier: Apache-2.0
"""The ground station for many vehicles on many links, without I/O: finds them, and keeps apart."""
from __future__ import annotations

import random
from collections.abc import Collection, Hashable, Iterable
from dataclasses import dataclass, field
from itertools import permutations
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.errors import UnknownName
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.autopilots import profile_of
from uav_task_alloc.mavlink.gcs.authority import AuthorityRecord
from uav_task_alloc.mavlink.gcs.mission_executor import MissionExecutor
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.mission.message_checks import defect
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.refused_messages import RefusedMessages, failure

RemoteKey = Hashable  # a link and the far end on it
Outgoing = list[tuple[RemoteKey, Message]]


class AuthorityStore(Protocol):
    """Keeps who has each aircraft over a restart of the bridge."""

    def load(self, uav_id: str) -> AuthorityRecord | None:
        """What was saved last; None where nothing was."""

    def save(self, uav_id: str, record: AuthorityRecord) -> None:
        """On disk when this returns."""


@dataclass(frozen=True, slots=True)
class GcsConfig:
    """Who we are and whom we serve."""

    system: int = 245
    component: int = 190
    system_ids: Collection[int] = ()  # empty: all that are heard
    uav_id_pattern: str = 'uav_{sysid}'
    autopilot: str = 'auto'
    origin: Origin = field(default_factory=lambda: Origin(0.0, 0.0))
    policy: Policy = field(default_factory=Policy)


@dataclass(slots=True)
class VehicleSession:
    """One vehicle and where it was last heard."""

    uav_id: str
    address: RemoteKey
    executor: MissionExecutor
    strays: int = 0  # frames with its system id from elsewhere
    fault: str = ''  # why the bridge could not act for it, last; '': it could


class GroundStation:
    """Routes each message to the pilot of its vehicle, and the answers back the same way."""

    def __init__(self, station: GcsConfig, rng: random.Random,
                 store: AuthorityStore | None = None) -> None:
        self._station, self._rng, self._store = station, rng, store
        self.sessions: dict[int, VehicleSession] = {}  # by system id
        self.refusals = RefusedMessages()  # messages, and lists that could not be acted on
        self._shared: list[tuple[TaskList | None, int]] = []  # lists and memories seen

    def receive(self, address: RemoteKey, message: Message, now: float) -> Outgoing:
        """Take a message that came in at `address`; one that cannot be acted on is dropped."""
        system, component = message.get_srcSystem(), message.get_srcComponent()
        why = defect(message)
        if not why:
            try:
                return self._receive(address, message, now)
            except Exception as error:
                why = failure(error)
        self.refusals.add(f'system {system}, component {component}', message.get_type(), why)
        return []

    def _receive(self, address: RemoteKey, message: Message, now: float) -> Outgoing:
        system = message.get_srcSystem()
        if message.get_srcComponent() != d.MAV_COMP_ID_AUTOPILOT1:
            return []
        session = self.sessions.get(system) or self._discover(address, message, now)
        if session is None:
            return []
        if session.address != address:
            # the same id twice would bring one plane's mission to the other
            if not session.executor.telemetry.stale(now):
                session.strays += 1
                return []
            session.address = address
            session.executor.moved_address(now)
        return self._sent(session, session.executor.receive(message, now))

    def addresses(self) -> frozenset[RemoteKey]:
        """Where the known vehicles are."""
        return frozenset(session.address for session in self.sessions.values())

    def step(self, now: float) -> Outgoing:
        """Let time pass for all."""
        out: Outgoing = []
        try:
            self._share(now)
        except Exception as error:
            self.refusals.add('all vehicles', 'compare what was flown', failure(error), 'error')
        for session in self.sessions.values():
            try:
                out += self._sent(session, session.executor.step(now))
                session.fault = ''
            except Exception as error:
                self._fault(session, 'step', error)
        return out

    def _fault(self, session: VehicleSession, what: str, error: Exception) -> None:
        """The others fly on, and nothing new is given to this one while it lasts."""
        session.fault = f'{what} failed: {failure(error)}'
        self.refusals.add(session.uav_id, what, failure(error), 'error')

    def assign(self, uav_id: str, tasks: TaskList, now: float) -> Outgoing:
        """A list for one UAV; raise UnknownName where it was not heard."""
        for session in self.sessions.values():
            if session.uav_id == uav_id:
                try:
                    return self._sent(session, session.executor.assign(tasks, now))
                except Exception as error:
                    self._fault(session, 'task_list', error)
                    return []
        raise UnknownName('uav', uav_id, [s.uav_id for s in self.sessions.values()])

    def hand_over(self, uav_id: str, operator: str, now: float) -> str:
        """An operator gives a UAV to the bridge.

        Returns:
            Why it is refused; '' where the bridge has it now.

        Raises:
            UnknownName: no such UAV was heard.
        """
        for session in self.sessions.values():
            if session.uav_id == uav_id:
                return session.executor.hand_over(operator, now)
        raise UnknownName('uav', uav_id, [s.uav_id for s in self.sessions.values()])

    def _share(self, now: float) -> None:
        """What one has flown before we listened is not flown by another who has it now."""
        executors = [(s.uav_id, s.executor) for s in self.sessions.values()]
        known: list[tuple[TaskList | None, int]] = [
            (p.onboard.tasks, len(p.onboard.resume.memory(now))) for _, p in executors]
        if known == self._shared or not any(flown for _, flown in known):
            return
        self._shared = known
        for (_, has), (other, did) in permutations(executors, 2):
            if has.onboard.tasks is not None:
                has.drop_flown(did.onboard.resume.flown(has.onboard.open_tasks(), now), other)

    def _discover(self, address: RemoteKey, message: Message, now: float) -> VehicleSession | None:
        station, system = self._station, message.get_srcSystem()
        if (message.get_type() != 'HEARTBEAT' or system in (0, station.system)
                or message.autopilot == d.MAV_AUTOPILOT_INVALID
                or message.type == d.MAV_TYPE_GCS
                or (station.system_ids and system not in station.system_ids)):
            return None
        peer = Peer(system, message.get_srcComponent(), station.system, station.component)
        uav_id, store = station.uav_id_pattern.format(sysid=system), self._store
        record = None if store is None else store.load(uav_id)

        def save(changed: AuthorityRecord) -> None:
            if store is not None:
                store.save(uav_id, changed)

        executor = MissionExecutor(peer, profile_of(message, station.autopilot), station.origin,
                      station.policy, random.Random(self._rng.random()), now, record, save)
        session = VehicleSession(uav_id, address, executor)
        self.sessions[system] = session
        return session

    @staticmethod
    def _sent(session: VehicleSession, messages: Iterable[Message]) -> Outgoing:
        return [(session.address, message) for message in messages]
