# SPDX-License-Identifier: Apache-2.0
"""The MAVLink bridge as a node: flies task lists on vehicles, and publishes their states."""
from __future__ import annotations

import math
import random
import threading
import time
from dataclasses import replace
from typing import cast

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import HandOver

from uav_task_alloc.errors import InvalidValue, UnknownName
from uav_task_alloc.mavlink.gcs.authority_store import AuthorityFileStore, boot_id
from uav_task_alloc.mavlink.gcs.energy_estimate import NominalEnergy
from uav_task_alloc.mavlink.gcs.fence_store import FenceFileStore
from uav_task_alloc.mavlink.gcs.ground_station import GroundStation, VehicleSession
from uav_task_alloc.mavlink.gcs.hold_store import HoldFileStore
from uav_task_alloc.mavlink.gcs.operator_hold import HoldRequest
from uav_task_alloc.mavlink.gcs.shared_id import hold_where_shared
from uav_task_alloc.mavlink.gcs.status import PublishedStates, state_of
from uav_task_alloc.mavlink.gcs.telemetry_messages import WANTED
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.transport.connections import Address, Connections
from uav_task_alloc.mavlink.transport.heartbeat import Heartbeat
from uav_task_alloc.mavlink.transport.link import open_link
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.nodes.conversions import bridge_messages, bridge_parameters
from uav_task_alloc.nodes.conversions.diagnostics import from_diagnostics
from uav_task_alloc.nodes.conversions.message_limits import cut
from uav_task_alloc.nodes.conversions.messages import EVENTS, LATCHED, STATES
from uav_task_alloc.nodes.ros.bridge_diagnostics import BridgeDiagnostics
from uav_task_alloc.nodes.ros.bridge_shutdown import BridgeShutdown, held_for_upload
from uav_task_alloc.nodes.ros.clock_watch import is_simulated, ros_time, steady_clock, watch_clock
from uav_task_alloc.nodes.ros.hold_inputs import HoldInputs
from uav_task_alloc.nodes.ros.leveled_log import LeveledLog
from uav_task_alloc.nodes.ros.origin_check import OriginCheck
from uav_task_alloc.nodes.ros.other_bridges import OtherBridges
from uav_task_alloc.nodes.ros.parameters import declare
from uav_task_alloc.nodes.ros.run import run
from uav_task_alloc.nodes.ros.task_list_inputs import TaskListInputs
from uav_task_alloc.nodes.ros.unheard_publishers import unheard_publishers
from uav_task_alloc.params import BridgeParams

_STEP_PERIOD = 0.02  # [s] between steps of the protocols; messages are handled on arrival


class MavlinkBridge(Node):
    """Connects MAVLink vehicles to the topics of a fleet.

    Publishes:
        `uav_states` (UavState), `task_events` (TaskEvent), `fleet_origin` (FleetOrigin, latched),
        `/diagnostics` (DiagnosticArray).
    Subscribes to:
        `<uav_id>/task_list` (TaskList) and `<uav_id>/hold` (UavHold) of each vehicle,
        `threat_zones` (ThreatZoneArray), `fleet_origin`.
    Services:
        `~/hand_over` (HandOver).
    Parameters:
        BridgeParams, see docs/parameters.md.
    """

    def __init__(self) -> None:
        super().__init__('mavlink_bridge')
        self.live = declare(self, BridgeParams)
        params = self.live.now
        self.config = bridge_parameters.to_gcs_config(params)
        self.capabilities = bridge_parameters.to_capabilities(params.capabilities)
        self.full_ranges = bridge_parameters.to_full_ranges(params.full_ranges)
        self.limits = bridge_parameters.to_uav_limits(params.uav_limits)
        self.fence_area = bridge_parameters.to_fence_area(params.fence_area, self.config.origin)
        self.rally = bridge_parameters.to_rally_points(
            params.rally_points, self.config.origin, params.cruise_altitude)
        self.log = LeveledLog(self)
        self.zones: tuple[ThreatZone, ...] = ()
        self.zones_known = False
        self.closing, self.shutdown = False, BridgeShutdown()
        self._open_ground_station(params)
        self._create_topics()
        self.report.log_start(params.system_ids, time.monotonic())
        self.heartbeat.start()
        self.receiver.start()

    def _open_ground_station(self, params: BridgeParams) -> None:
        """Open the links, and prepare the threads that receive and send heartbeats."""
        self.lock = threading.Lock()  # of the ground station
        self.store = AuthorityFileStore(params.state_dir, self.log.levels['error'],
                                        boot_id()) if params.state_dir else None
        if self.store is not None:
            self.store.lock()
        self.ground_station = GroundStation(
            self.config, random.Random(time.time_ns()), self.store, HoldFileStore(
                params.state_dir, self.log.levels['error']) if params.state_dir else None,
            FenceFileStore(params.state_dir, self.log.levels['error']) if params.state_dir
            else None)
        self.connections = Connections(
            map(open_link, params.connections), params.system_id, params.component_id,
            wall=time.time, wanted=WANTED, signing_key_file=params.signing_key_file,
            tlog=params.tlog)
        self.heartbeat = Heartbeat(self.connections.send_to_all)
        self.receiver = threading.Thread(target=self.receive, name='receive', daemon=True)
        self.report = BridgeDiagnostics(
            self.get_fully_qualified_name(), self.ground_station, self.connections,
            self.heartbeat, self.log)

    def _create_topics(self) -> None:
        self.published = PublishedStates()
        self.states = self.create_publisher(m.UavState, 'uav_states', STATES)
        self.task_events = self.create_publisher(m.TaskEvent, 'task_events', EVENTS)
        self.diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.create_subscription(m.ThreatZoneArray, 'threat_zones', self.on_zones, LATCHED)
        self.origins = OriginCheck(self, self.config.origin, lambda reason: self.log.write(
            'warning', f'fleet_origin: {reason}: ignored'))
        self.lists = TaskListInputs(self, self.log, self.to_list, self.assign_lists)
        self.others = OtherBridges(self)
        self.holds = HoldInputs(  # the clock of a computer may leap
            self, self.log, self.stamp, self.on_hold,
            lambda: self.stamp() if is_simulated(self) else time.monotonic())
        self.create_service(HandOver, '~/hand_over', self.on_hand_over)
        steady = steady_clock()  # links and vehicles do not wait for simulated time
        self.create_timer(0.05, self.on_timer, clock=steady)
        self.create_timer(1.0, self.publish_diagnostics, clock=steady)
        self.clock_watch = watch_clock(self, self.log.levels['warning'])

    # the receiver thread

    def receive(self) -> None:
        """Handle messages on arrival, and step the protocols, until the node is destroyed."""
        step_at = 0.0
        while not self.closing:
            received, now = self.connections.receive(_STEP_PERIOD), time.monotonic()
            out = []
            with self.lock:
                for address, message in received:
                    out += self.ground_station.receive(address, message, now)
                if now >= step_at:
                    out += self.ground_station.step(now)
                    self.connections.keep(cast('frozenset[Address]',
                                               self.ground_station.addresses()))
                    self.connections.step(now)
                    step_at = now + _STEP_PERIOD
            self.connections.send(out)
            self.publish(now)

    def publish(self, now: float) -> None:
        """Publish states and events that are due; `now` is the steady clock [s]."""
        self.report.log_refusals()
        for session in list(self.ground_station.sessions.values()):
            self.publish_events(session)
            self.publish_state(session, now)

    def publish_events(self, session: VehicleSession) -> None:
        """Publish the task events of a UAV, and log its notes."""
        executor = session.executor
        while executor.events:
            self.task_events.publish(bridge_messages.from_progress(
                session.uav_id, executor.events.popleft(), self.stamp()))
        while executor.notes:
            note = executor.notes.popleft()
            self.log.write(note.level, f'{session.uav_id}: {note.text}')

    def publish_state(self, session: VehicleSession, now: float) -> None:
        """Publish the state of a UAV where it is due."""
        session.executor.energy.nominal = self.nominal_energy(session.uav_id)
        with self.lock:
            status = state_of(session, now)
        measured_at = session.executor.telemetry.position_at
        if conflict := self.origins.conflict() or self.others.shared(session.uav_id, now):
            status = replace(status, available=False, reason=conflict)
        if self.published.is_due(status, measured_at, now, self.live.now.state_rate):
            with self.lock:
                session.executor.watch.save_record()  # what is reported is stored before
            msg = bridge_messages.from_uav_status(
                status, self.capabilities.get(session.uav_id, ()),
                self.stamp() - self.rate(session) * (now - measured_at),
                self.limits.get(session.uav_id))
            self.others.note_own(msg)
            self.states.publish(msg)

    def nominal_energy(self, uav_id: str) -> NominalEnergy:
        """What the parameters state about range, endurance and speed of a UAV."""
        limits = self.limits.get(uav_id, {})
        return NominalEnergy(self.full_ranges.get(uav_id, self.live.now.full_range),
                             limits.get('endurance', 0.0), limits.get('cruise_speed', 0.0))

    def rate(self, session: VehicleSession) -> float:
        """Seconds of the node's clock in one second of the steady clock, as a vehicle shows it."""
        rate = session.executor.telemetry.clock_rate.value
        return rate if is_simulated(self) and math.isfinite(rate) else 1.0

    # the node's thread

    def on_timer(self) -> None:
        """Pass parameters and zones on, and subscribe to the lists of new UAVs."""
        if not self.receiver.is_alive():
            raise RuntimeError('receiver thread died; exiting')
        self.heartbeat.watch(time.monotonic())
        self.others.search(time.monotonic())
        self.log.report_trouble('heartbeat', self.heartbeat.trouble)
        policy = bridge_parameters.to_policy(self.live.now, self.zones, self.grounded(),
                                             self.stamp(), zones_known=self.zones_known,
                                             fence_area=self.fence_area, rally=self.rally,
                                             settling=self.others.settling(time.monotonic()))
        for session in list(self.ground_station.sessions.values()):
            session.executor.policy = policy
            if session.uav_id not in self.lists.known:
                self.report.search_over = True
                self.log.write('info', f'found {session.uav_id}: {session.executor.profile.name}')
                self.holds.subscribe(session.uav_id)
                self.lists.subscribe(session.uav_id)
        self.report.log_search(time.monotonic())
        self.holds.step()
        self.assign_lists()
        self.hold_shared()

    def grounded(self) -> str:
        """What a UAV on the ground waits for before a take-off; '' where it waits for nothing."""
        if self.origins.conflict():
            return 'nodes with one origin'
        if self.exiting():
            return 'another bridge, as this one exits'
        return self.others.grounded(time.monotonic())

    def exiting(self) -> bool:
        """Whether this bridge was asked to exit."""
        return self.shutdown.requested_at is not None

    def to_list(self, msg: m.TaskList, uav_id: str) -> TaskList:
        """The list of a message; raise InvalidValue."""
        return bridge_messages.to_list(msg, uav_id, self.config.origin,
                                       self.live.now.acceptance_radius)

    def assign_lists(self) -> None:
        """Fly the waiting lists, once all origins are known and agree, and ids are not shared."""
        now = time.monotonic()
        self.lists.keep_back(lambda uav_id: self.others.shared(uav_id, now))
        if (not self.lists.pending or self.exiting() or self.origins.conflict()
                or not self.origins.settled()):
            return
        for uav_id, tasks in self.lists.take().items():
            with self.lock:
                out = self.ground_station.assign(uav_id, tasks, time.monotonic())
            self.connections.send(out)

    def hold_shared(self) -> None:
        """Hold UAVs in flight that another node reports, too; the lists of before come first."""
        with self.lock:
            now = time.monotonic()
            for session in self.ground_station.sessions.values():
                hold_where_shared(session.executor, self.others.shared(session.uav_id, now), now)

    def on_hold(self, uav_id: str, request: HoldRequest) -> None:
        """Hold a UAV, or end a hold."""
        with self.lock:
            self.ground_station.hold(uav_id, request, time.monotonic())

    def on_zones(self, msg: m.ThreatZoneArray) -> None:
        """Replace the zones; one that is invalid stays as it was."""
        try:
            self.zones, refusal = bridge_messages.to_zones(msg, self.zones)
            self.zones_known = True
        except InvalidValue as error:
            refusal = str(error)
        self.log.report_refusal('threat_zones', refusal)

    def on_hand_over(self, request: HandOver.Request,
                     response: HandOver.Response) -> HandOver.Response:
        """Let the bridge fly a UAV, as an operator asks."""
        uav_id, operator = cut(request.uav_id), cut(request.operator_name) or 'unnamed'
        try:
            with self.lock:
                refusal = self.ground_station.hand_over(uav_id, operator, time.monotonic())
        except UnknownName as error:
            refusal = str(error)
        response.success = not refusal
        response.message = f'refused: {refusal}' if refusal else f'the bridge has {uav_id} now'
        self.log.write('warning' if refusal else 'info',
                       f'hand_over of {uav_id} by {operator}: {response.message}')
        return response

    def publish_diagnostics(self) -> None:
        """Publish the state of vehicles, links and threads."""
        now, stamp = time.monotonic(), self.stamp()
        with self.lock:
            if self.store is not None:
                self.store.retry()
            rows = self.report.vehicle_rows(now)
        self.origins.check()
        unheard = unheard_publishers(self, {'threat_zones': LATCHED, 'fleet_origin': LATCHED})
        rows += self.report.part_rows(self.origins.conflict(), unheard,
                                      self.holds.late.warning(now),
                                      self.others.warning(now),
                                      self.clock_watch.warning(now))
        self.diagnostics.publish(from_diagnostics(rows, stamp))

    def stamp(self) -> float:
        """The published clock [s]."""
        return ros_time(self)

    def delays_exit(self) -> bool:
        """Whether a running upload is waited for before the exit; no other one is started."""
        first = not self.exiting()
        with self.lock:
            fleet = list(self.ground_station.sessions.values())
            waits = self.shutdown.waits(fleet, time.monotonic())
        if first and waits:
            self.log.write('warning',
                           f'exits after the upload to {", ".join(held_for_upload(fleet))}')
        return waits

    def destroy_node(self) -> None:
        """Log which UAVs are airborne, and end both threads before the links are closed."""
        for line in self.shutdown.warnings(self.ground_station.sessions.values()):
            self.log.write('warning', line)
        self.closing = True
        self.heartbeat.close()
        self.receiver.join(5.0)
        self.connections.close()
        if self.store is not None:
            self.store.close()
        super().destroy_node()


def main() -> None:
    """Entry point of `ros2 run uav_task_alloc mavlink_bridge`."""
    run(MavlinkBridge, params=BridgeParams)
