# SPDX-License-Identifier: Apache-2.0
"""The bridge as a node: flies task lists on the vehicles of its links, tells how they do."""
from __future__ import annotations

import random
import threading
import time
from dataclasses import replace

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import HandOver

from uav_task_alloc.errors import InvalidValue, UnknownName
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.gcs.authority_store import AuthorityFileStore, boot_id
from uav_task_alloc.mavlink.gcs.ground_station import GcsConfig, GroundStation, VehicleSession
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.status import PublishedStates, facts_of, state_of
from uav_task_alloc.mavlink.gcs.telemetry import WANTED
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.transport.connections import Connections
from uav_task_alloc.mavlink.transport.heartbeat import Heartbeat
from uav_task_alloc.mavlink.transport.link import open_link
from uav_task_alloc.model import ThreatZone, check_number, check_ros_name
from uav_task_alloc.nodes.conversions import bridge_messages as convert
from uav_task_alloc.nodes.conversions.message_limits import cut, printable
from uav_task_alloc.nodes.conversions.messages import EVENTS, LATCHED, STATES
from uav_task_alloc.nodes.ros.bridge_shutdown import BridgeShutdown, swapping
from uav_task_alloc.nodes.ros.origin_check import OriginCheck
from uav_task_alloc.nodes.ros.parameters import declare
from uav_task_alloc.nodes.ros.run import run
from uav_task_alloc.nodes.ros.topic_names import TASK_LIST, check_topic
from uav_task_alloc.params import BridgeParams

_TICK = 0.02  # [s] between steps of the machines; messages are acted on as they come


def policy_of(params: BridgeParams, zones: tuple[ThreatZone, ...] = (),
              grounded: str = '') -> Policy:
    """What the operator wants, as of now."""
    return Policy(params.takeoff, params.cruise_altitude, params.when_empty, params.when_foreign,
                  params.relaunch, zones, grounded)


def station_of(params: BridgeParams) -> GcsConfig:
    """Who we are; raise InvalidValue for a pattern that makes no ROS name."""
    try:
        names = {params.uav_id_pattern.format(sysid=number) for number in (1, 2)}
    except (KeyError, IndexError, ValueError):
        names = set()
    if len(names) != 2:
        raise InvalidValue('uav_id_pattern', params.uav_id_pattern, 'a text with {sysid}')
    check_ros_name('uav_id_pattern', names.pop())
    if not params.connections:
        raise InvalidValue('connections', [], 'at least one')
    for number in params.system_ids:
        check_number('system_ids', number, 1, 255)
    origin = Origin(params.origin__latitude, params.origin__longitude,
                    params.origin__altitude_amsl)
    return GcsConfig(params.system_id, params.component_id, params.system_ids,
                   params.uav_id_pattern, params.autopilot, origin, policy_of(params))


class MavlinkBridge(Node):
    """Wires topics to the ground station, and that to the links."""

    def __init__(self) -> None:
        super().__init__('mavlink_bridge')
        self.live = declare(self, BridgeParams)
        params = self.live.now
        self.station = station_of(params)
        self.capabilities = convert.to_capabilities(params.capabilities)
        self.full_ranges = convert.to_full_ranges(params.full_ranges)
        logger = self.get_logger()
        self.log = {'info': lambda text: logger.info(text),  # rclpy wants a line each
                    'warning': lambda text: logger.warning(text),
                    'error': lambda text: logger.error(text)}
        self.store = AuthorityFileStore(params.state_dir, self.log['error'],
                               boot_id()) if params.state_dir else None
        self.ground_station = GroundStation(
            self.station, random.Random(time.time_ns()), self.store)
        self.zones: tuple[ThreatZone, ...] = ()
        self.connections = Connections(
            map(open_link, params.connections), params.system_id, params.component_id,
            wall=time.time, wanted=WANTED, signing_key_file=params.signing_key_file,
            tlog=params.tlog)
        self.refusals, self.refused = (self.ground_station.refusals, self.connections.refusals), 0
        self.lock = threading.Lock()  # of the ground station
        self.published = PublishedStates()
        self.lists: dict[str, object] = {}
        self.troubles: dict[str, str] = {}  # logged, by link or topic
        self.states = self.create_publisher(m.UavState, 'uav_states', STATES)
        self.task_events = self.create_publisher(m.TaskEvent, 'task_events', EVENTS)
        self.health = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.create_subscription(m.ThreatZoneArray, 'threat_zones', self.on_zones, LATCHED)
        self.origins = OriginCheck(self, self.station.origin, lambda text: self.log['warning'](
            f'fleet_origin: {text}: ignored'))
        self.waiting: dict[str, TaskList] = {}  # lists until the origins agree
        self.create_service(HandOver, '~/hand_over', self.on_hand_over)
        self.create_timer(0.05, self.on_tick)
        self.create_timer(1.0, self.on_second)
        self.closing, self.end = False, BridgeShutdown()
        self.heartbeat = Heartbeat(self.connections.send_to_all)
        self.receiver = threading.Thread(target=self.receive, name='receive', daemon=True)
        self.heartbeat.start()
        self.receiver.start()

    def receive(self) -> None:
        """Messages to the machines as they come, and time in between."""
        step_at = 0.0
        while not self.closing:
            got, now, out = self.connections.receive(_TICK), time.monotonic(), []
            with self.lock:
                for address, message in got:
                    out += self.ground_station.receive(address, message, now)
                if now >= step_at:
                    out += self.ground_station.step(now)
                    self.connections.keep(self.ground_station.addresses())
                    self.connections.step(now)
                    step_at = now + _TICK
            self.connections.send(out)
            self.tell(now)

    def tell(self, now: float) -> None:
        """Publish what is new."""
        for refusals in self.refusals:
            while refusals.notes:
                note = refusals.notes.popleft()
                self.log[note.level](printable(note.text))
        for session in list(self.ground_station.sessions.values()):
            with self.lock:
                status = state_of(session, now, self.full_ranges.get(
                    session.uav_id, self.live.now.full_range))
            self.tell_events(session)
            seen = session.executor.telemetry.position_at
            conflict = self.origins.conflict()
            if conflict:
                status = replace(status, available=False, reason=conflict)
            if self.published.is_due(status, seen, now, self.live.now.state_rate):
                self.states.publish(convert.from_uav_status(
                    status, self.capabilities.get(session.uav_id, ()), self.stamp() - now + seen))

    def tell_events(self, session: VehicleSession) -> None:
        """Publish progress, log notes."""
        executor = session.executor
        while executor.events:
            self.task_events.publish(convert.from_progress(
                session.uav_id, executor.events.popleft(), self.stamp()))
        while executor.notes:
            note = executor.notes.popleft()
            self.log[note.level](printable(f'{session.uav_id}: {note.text}'))

    def on_tick(self) -> None:
        """Listen for the lists of UAVs that were found; pass parameters on."""
        if not self.receiver.is_alive():
            raise RuntimeError('the receiver has died: better no bridge than a deaf one')
        self.heartbeat.watch(time.monotonic())
        self.tell_trouble('heartbeat', self.heartbeat.trouble)
        conflict = self.origins.conflict()
        policy = policy_of(
            self.live.now, self.zones, (conflict and 'nodes with one origin')
            or ('another bridge, as this one ends' if self.end.asked is not None else ''))
        for session in list(self.ground_station.sessions.values()):
            session.executor.policy = policy
            if session.uav_id not in self.lists:
                self.log['info'](f'found {session.uav_id}: {session.executor.profile.name}')
                try:
                    topic = check_topic(self, TASK_LIST, session.uav_id)
                except InvalidValue as error:
                    self.lists[session.uav_id] = None
                    self.log['error'](f'it gets no task lists: {error}')
                    continue
                self.lists[session.uav_id] = self.create_subscription(
                    m.TaskList, topic,
                    lambda msg, uav_id=session.uav_id: self.on_list(uav_id, msg), LATCHED)
        self.take_lists()

    def on_list(self, uav_id: str, msg: m.TaskList) -> None:
        """A new list for a UAV; a bad one leaves the one before."""
        try:
            self.waiting[uav_id] = convert.to_list(msg, uav_id, self.station.origin,
                                                   self.live.now.acceptance_radius)
        except InvalidValue as error:
            self.log['warning'](f'{uav_id}/task_list: {error}: ignored')
        self.take_lists()

    def take_lists(self) -> None:
        """Fly the lists that wait, unless somebody has another origin, or this bridge ends."""
        if (self.waiting and self.end.asked is None and not self.origins.conflict()
                and self.origins.settled()):
            waiting, self.waiting = self.waiting, {}
            for uav_id, tasks in waiting.items():
                with self.lock:
                    out = self.ground_station.assign(uav_id, tasks, time.monotonic())
                self.connections.send(out)

    def on_zones(self, msg: m.ThreatZoneArray) -> None:
        """The whole picture of the zones; one whose new form is bad stays as it was."""
        try:
            self.zones, trouble = convert.to_zones(msg, self.zones)
        except InvalidValue as error:
            trouble = str(error)
        if trouble and trouble != self.troubles.get('threat_zones'):
            self.log['warning'](f'threat_zones: {trouble}: ignored')
        self.troubles['threat_zones'] = trouble

    def on_hand_over(self, request: HandOver.Request,
                     response: HandOver.Response) -> HandOver.Response:
        """An operator gives a UAV to the bridge."""
        uav_id, operator = cut(request.uav_id), cut(request.operator_name) or 'unnamed'
        try:
            with self.lock:
                refused = self.ground_station.hand_over(uav_id, operator, time.monotonic())
        except UnknownName as error:
            refused = str(error)
        response.success = not refused
        response.message = f'refused: {refused}' if refused else f'the bridge has {uav_id} now'
        self.log['warning' if refused else 'info'](
            f'hand_over of {uav_id} by {operator}: {response.message}')
        return response

    def on_second(self) -> None:
        """How all are, for people."""
        now = time.monotonic()
        with self.lock:
            if self.store is not None:
                self.store.retry()
            facts = [(s.uav_id, *facts_of(s, now)) for s in self.ground_station.sessions.values()]
        self.origins.check()
        conflict = self.origins.conflict()
        self.tell_trouble('fleet_origin', conflict and f'refuses to fly new lists: {conflict}')
        if conflict:
            facts.append(('fleet_origin', 2, f'refuses to fly new lists: {conflict}', {}))
        for link in self.connections.links:
            self.tell_trouble(link.name, link.trouble)
            facts.append((link.name, 2 if link.trouble else 0, link.trouble or 'open', {}))
        if self.connections.signing is not None:
            trouble = self.connections.signing.trouble
            self.tell_trouble('signing', trouble, 'warning')
            facts.append(('signing', int(bool(trouble)), trouble or 'timestamp kept', {}))
        facts += [self.heartbeat_facts(), self.message_facts()]
        self.health.publish(convert.diagnostics(facts, self.stamp()))

    def heartbeat_facts(self) -> tuple[str, int, str, dict[str, str]]:
        """Whether vehicles are told that we are here."""
        beat = self.heartbeat
        return 'heartbeat', 2 if beat.trouble else 0, beat.trouble or f'{beat.sent} sent', {
            'thread_restarts': str(beat.restarts)}

    def message_facts(self) -> tuple[str, int, str, dict[str, str]]:
        """What was refused of all that came; a warning while more of it comes."""
        count, before = sum(refusals.count for refusals in self.refusals), self.refused
        self.refused = count
        return 'messages', int(count > before), f'{count} messages refused', {
            'messages_refused': str(count), 'frames_refused': str(self.connections.errors()),
            'last_refused': '; '.join(printable(r.last) for r in self.refusals if r.last)}

    def tell_trouble(self, name: str, trouble: str, level: str = 'error') -> None:
        """Log what is wrong with a link or the like, once, and that it is over."""
        if trouble != self.troubles.get(name, ''):
            self.log[level if trouble else 'info'](f'{name}: {trouble or "works"}')
            self.troubles[name] = trouble

    def stamp(self) -> float:
        """The published clock [s]."""
        return self.get_clock().now().nanoseconds * 1e-9

    def waits_to_end(self) -> bool:
        """Asked to end: whether a swap under way comes first; no other is begun."""
        first = self.end.asked is None
        with self.lock:
            fleet = list(self.ground_station.sessions.values())
            waits = self.end.waits(fleet, time.monotonic())
        if first and waits:
            self.log['warning'](f'ends after the swap of {", ".join(swapping(fleet))}')
        return waits

    def destroy_node(self) -> None:
        """Say who is in the air, and stop both threads before what they use is gone."""
        for words in self.end.words(self.ground_station.sessions.values()):
            self.log['warning'](words)
        self.closing = True
        self.heartbeat.close()
        self.receiver.join(5.0)
        self.connections.close()
        super().destroy_node()


def main() -> None:
    """Entry point."""
    run(MavlinkBridge)
