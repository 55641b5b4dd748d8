# SPDX-License-Identifier: Apache-2.0
"""The ground station for many vehicles on many links, without I/O: discovery and routing."""
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
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityRecord
from uav_task_alloc.mavlink.gcs.early_messages import EarlyMessages
from uav_task_alloc.mavlink.gcs.fence_store import FenceStore
from uav_task_alloc.mavlink.gcs.hold_store import HoldStore
from uav_task_alloc.mavlink.gcs.mission_executor import MissionExecutor
from uav_task_alloc.mavlink.gcs.operator_hold import HoldRequest
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.vehicle_fence import FenceMemory
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.mission.message_checks import defect
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.refused_messages import RefusedMessages, failure

_READ_TIME = 10.0  # [s] after the start in which the missions on board are read, as a rule
OPERATOR = 'operator'  # source of a hold that outlives a restart
RemoteKey = Hashable  # link and remote, see `transport.connections.Address`
Outgoing = list[tuple[RemoteKey, Message]]


class AuthorityStore(Protocol):
    """Stores the authority records over a restart of the bridge."""

    def load(self, uav_id: str) -> AuthorityRecord | None:
        """The record of a UAV saved last; None if there is none."""

    def save(self, uav_id: str, record: AuthorityRecord) -> None:
        """Save a record; it is on disk when this returns."""


@dataclass(frozen=True, slots=True)
class GcsConfig:
    """Identity of the ground station, and the vehicles it serves."""

    system: int = 245  # MAVLink system id of the ground station
    component: int = 190  # MAVLink component id of the ground station
    system_ids: Collection[int] = ()  # of vehicles to serve; empty: all
    uav_id_pattern: str = 'uav_{sysid}'  # `{sysid}` is replaced by the vehicle's system id
    autopilot: str = 'auto'  # 'auto': by the heartbeat; else a name of `profile_of`
    origin: Origin = field(default_factory=lambda: Origin(0.0, 0.0))  # of the ENU frame
    policy: Policy = field(default_factory=Policy)  # what executors may do


@dataclass(slots=True)
class VehicleSession:
    """One vehicle, its address and its executor."""

    uav_id: str  # from the pattern of ids
    address: RemoteKey  # link and remote address of its frames
    executor: MissionExecutor  # flies its list
    strays: int = 0  # frames with its system id from other addresses
    fault: str = ''  # error of the latest call of the executor; '': none


class GroundStation:
    """Routes messages to the executor of their vehicle, and its messages to the vehicle's address.

    Args:
        config: identity and policy.
        rng: seeds the executors.
        store: of authority records; None: not stored.
        hold_store: of operators' holds; None: not stored.
        fence_store: of the fences of the bridge on board; None: not stored.

    Arguments of methods:
        uav_id: of a vehicle, or of one to come.
        tasks: its list.
        operator: free text for the log.
        request: a hold, or its end.
        now: steady time [s].
    """

    def __init__(self, config: GcsConfig, rng: random.Random,
                 store: AuthorityStore | None = None,
                 hold_store: HoldStore | None = None,
                 fence_store: FenceStore | None = None) -> None:
        self._config, self._rng, self._store = config, rng, store
        self._hold_store, self._fence_store = hold_store, fence_store
        self.sessions: dict[int, VehicleSession] = {}  # by system id
        self._early = EarlyMessages()
        self.refusals = RefusedMessages()  # messages and lists whose processing failed
        self._compared: list[tuple[TaskList | None, int]] = []  # lists and flown items
        self._read_until: float | None = None  # [s]; None: before the first step

    def receive(self, address: RemoteKey, message: Message, now: float) -> Outgoing:
        """Process a message; one that is invalid or cannot be processed is dropped and counted.

        Args:
            address: the address it was received from.
            message: of any vehicle or station.
            now: steady time [s].

        Returns:
            Messages to send, with their addresses.
        """
        system, component = message.get_srcSystem(), message.get_srcComponent()
        reason = defect(message)
        if not reason:
            try:
                return self._receive(address, message, now)
            except Exception as error:
                reason = failure(error)
        self.refusals.add(f'system {system}, component {component}', message.get_type(), reason)
        return []

    def _receive(self, address: RemoteKey, message: Message, now: float) -> Outgoing:
        system = message.get_srcSystem()
        if message.get_srcComponent() != d.MAV_COMP_ID_AUTOPILOT1:
            return []
        if message.get_type() == 'HEARTBEAT' and not _is_of_autopilot(message):
            # its mode and arming are not those of the vehicle
            if system in self.sessions:
                self.refusals.add(
                    f'system {system}, component 1', 'HEARTBEAT', f'type = {message.type}, '
                    f'autopilot = {message.autopilot}: expected an autopilot')
            return []
        session = self.sessions.get(system) or self._discover(address, message, now)
        if session is None:
            self._early.keep(address, message, now)
            return []
        if session.address != address:
            # with a duplicate id, one vehicle would get the mission of the other
            if not session.executor.telemetry.link.silent(now):
                session.strays += 1
                return []
            session.address = address
            session.executor.moved_address(now)
        return self._addressed(session, session.executor.receive(message, now))

    def addresses(self) -> frozenset[RemoteKey]:
        """Addresses of the known vehicles."""
        return frozenset(session.address for session in self.sessions.values())

    def step(self, now: float) -> Outgoing:
        """Advance the time of all executors; returns messages to send, with their addresses."""
        out: Outgoing = []
        if self._read_until is None:
            self._read_until = now + _READ_TIME
        try:
            self._note_unread(now)
            self._drop_flown_by_others(now)
        except Exception as error:
            self.refusals.add('all vehicles', 'compare flown tasks', failure(error), 'error')
        for session in self.sessions.values():
            try:
                out += self._addressed(session, session.executor.step(now))
                session.fault = ''
            except Exception as error:
                self._fault(session, 'step', error)
        return out

    def _fault(self, session: VehicleSession, what: str, error: Exception) -> None:
        """Record an error of one executor: its UAV is unavailable, the others continue."""
        session.fault = f'{what} failed: {failure(error)}'
        self.refusals.add(session.uav_id, what, failure(error), 'error')

    def assign(self, uav_id: str, tasks: TaskList, now: float) -> Outgoing:
        """Assign a task list to one UAV.

        Returns:
            Messages to send, with their addresses.

        Raises:
            UnknownName: no such UAV was discovered.
        """
        for session in self.sessions.values():
            if session.uav_id == uav_id:
                try:
                    self._note_unread(now)
                    return self._addressed(session, session.executor.assign(tasks, now))
                except Exception as error:
                    self._fault(session, 'task_list', error)
                    return []
        raise UnknownName('uav', uav_id, [s.uav_id for s in self.sessions.values()])

    def hold(self, uav_id: str, request: HoldRequest, now: float) -> None:
        """Hold a UAV, or end a hold; that of an operator is stored before anything is sent.

        Raises:
            UnknownName: no such UAV was discovered.
        """
        for session in self.sessions.values():
            if session.uav_id == uav_id:
                if self._hold_store is not None and request.source == OPERATOR:
                    self._hold_store.save_hold(uav_id, request.reason if request.hold else '')
                session.executor.holds.request(request, now)
                return
        raise UnknownName('uav', uav_id, [s.uav_id for s in self.sessions.values()])

    def hand_over(self, uav_id: str, operator: str, now: float) -> str:
        """An operator gives control of a UAV to the bridge.

        Returns:
            Why it is refused; '' on success.

        Raises:
            UnknownName: no such UAV was discovered.
        """
        for session in self.sessions.values():
            if session.uav_id == uav_id:
                return session.executor.hand_over(operator, now)
        raise UnknownName('uav', uav_id, [s.uav_id for s in self.sessions.values()])

    def _note_unread(self, now: float) -> None:
        """Note for each UAV the tasks that another one may have flown while the bridge was down.

        They are the next ones that the previous run recorded, of UAVs whose missions are not read
        yet: their flown tasks become known in a moment, and are then not flown by others.
        """
        executors = [session.executor for session in self.sessions.values()]
        if self._read_until is None or now >= self._read_until:
            for executor in executors:
                executor.onboard.list.perhaps_flown = frozenset()
            return
        unread = [executor for executor in executors if not (
            executor.onboard.resume.located or executor.telemetry.link.stale(now))]
        for executor in executors:
            executor.onboard.list.perhaps_flown = frozenset(
                task for other in unread if other is not executor
                for task in other.onboard.resume.flown.ahead)

    def _drop_flown_by_others(self, now: float) -> None:
        """Complete tasks of a list that another UAV has flown while the bridge was down."""
        executors = [(s.uav_id, s.executor) for s in self.sessions.values()]
        known: list[tuple[TaskList | None, int]] = [
            (executor.onboard.tasks, executor.onboard.resume.flown.count(now))
            for _, executor in executors]
        if known == self._compared or not any(flown for _, flown in known):
            return
        self._compared = known
        for (_, assigned), (other, executor) in permutations(executors, 2):
            if assigned.onboard.tasks is not None:
                allowed = [task for task in assigned.onboard.list.open_tasks()
                           if task.allowed_uavs is None or other in task.allowed_uavs]
                assigned.drop_flown(executor.onboard.resume.flown.tasks_among(allowed, now), other)

    def _discover(self, address: RemoteKey, message: Message, now: float) -> VehicleSession | None:
        config, system = self._config, message.get_srcSystem()
        if (message.get_type() != 'HEARTBEAT' or system in (0, config.system)
                or (config.system_ids and system not in config.system_ids)):
            return None
        peer = Peer(system, message.get_srcComponent(), config.system, config.component)
        uav_id, store = config.uav_id_pattern.format(sysid=system), self._store
        record = None if store is None else store.load(uav_id)

        def save(changed: AuthorityRecord) -> None:
            if store is not None:
                store.save(uav_id, changed)

        executor = MissionExecutor(peer, profile_of(message, config.autopilot), config.origin,
                                   config.policy, random.Random(self._rng.random()), now,
                                   record, save, self._fence_memory(uav_id))
        held = '' if self._hold_store is None else self._hold_store.load_hold(uav_id)
        if held:
            executor.holds.request(HoldRequest(OPERATOR, True, held), now)
        session = VehicleSession(uav_id, address, executor)
        self.sessions[system] = session
        for early, at in self._early.take(system, address, now):
            executor.receive(early, at)
        return session

    def _fence_memory(self, uav_id: str) -> FenceMemory:
        store = self._fence_store
        if store is None:
            return FenceMemory()
        return FenceMemory(store.load_fence(uav_id), lambda own: store.save_fence(uav_id, own))

    @staticmethod
    def _addressed(session: VehicleSession, messages: Iterable[Message]) -> Outgoing:
        return [(session.address, message) for message in messages]


def _is_of_autopilot(heartbeat: Message) -> bool:
    return bool(heartbeat.autopilot != d.MAV_AUTOPILOT_INVALID
                and heartbeat.type != d.MAV_TYPE_GCS)
