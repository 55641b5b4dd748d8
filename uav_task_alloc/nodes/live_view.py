# SPDX-License-Identifier: Apache-2.0
"""Shows a fleet in the terminal and in the browser, records it, and ends with its scenario."""
from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from uav_task_alloc_msgs import msg as m

from uav_task_alloc import scenario
from uav_task_alloc.checks import is_ros_name
from uav_task_alloc.cli.outputs import NotInstalled
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.live.scene import Scene
from uav_task_alloc.live.snapshot_store import SnapshotStore
from uav_task_alloc.live.tiles import tile_source
from uav_task_alloc.nodes.conversions.announcements import valid_tasks
from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS, EVENTS, LATCHED, STATES
from uav_task_alloc.nodes.ros.clock_watch import (
    SteadyTime,
    is_simulated,
    ros_time,
    steady_clock,
    watch_clock,
)
from uav_task_alloc.nodes.ros.held_announcements import HeldAnnouncements
from uav_task_alloc.nodes.ros.message_guard import MessageGuard
from uav_task_alloc.nodes.ros.parameters import declare
from uav_task_alloc.nodes.ros.run import run, with_flags
from uav_task_alloc.nodes.ros.terminal_status import TerminalStatus
from uav_task_alloc.nodes.ros.topic_names import TASK_LIST, check_topic
from uav_task_alloc.params import LiveViewParams
from uav_task_alloc.record import diagnostic_records, message_records
from uav_task_alloc.record.message_records import RecordBody
from uav_task_alloc.record.progress import run_is_over
from uav_task_alloc.record.run_record import RunRecord
from uav_task_alloc.record.run_state import RunState

if TYPE_CHECKING:
    from uav_task_alloc.live.server import PageServer
    from uav_task_alloc.nodes.ros.bag_recorder import BagRecorder

_Message = TypeVar('_Message')
_BEGIN_PERIOD = 0.05  # [s] between two checks whether there is a time
_PERIOD = 0.5  # [s] between updates of terminal and page
_TASKS = 'task_announcements'  # topic
_STATE_FIELDS = ('mode', 'mission_state', 'active', 'list_revision', 'available', 'authority',
                 'reason', 'fence')  # a change of one is recorded at once


class LiveView(Node):
    """Shows and records a fleet. `--record FILE`: all topics as MCAP.

    Subscribes to:
        `uav_states` (UavState), `task_announcements` (TaskAnnouncement), `threat_zones`
        (ThreatZoneArray), `task_statuses` (TaskStatusArray), `allocation` (Allocation),
        `<uav_id>/task_list` (TaskList), `plan_proposal` (PlanProposal),
        `separation_alerts` (SeparationAlert),
        `fleet_origin` (FleetOrigin), `fence_area` (PolygonStamped), `/diagnostics`
        (DiagnosticArray).
    Parameters:
        LiveViewParams, see docs/parameters.md.
    """

    def __init__(self) -> None:
        super().__init__('live_view')
        self.params = declare(self, LiveViewParams).now
        self.played = scenario.load(self.params.scenario) if self.params.scenario else None
        self.state = RunState()
        self.with_lists: set[str] = set()  # UAVs to whose task lists it subscribes
        self.held = HeldAnnouncements(self.get_logger().info)
        self.guard = MessageGuard(self.get_logger().warning)
        self.scene, self.snapshots = Scene(self.state), SnapshotStore()
        self.terminal = TerminalStatus()
        self.record = RunRecord(self.params.out_dir, self.get_logger().warning,
                                self.get_logger().error)
        self.recorder = self._start_recorder()
        self.finished = False
        self.over_since: float | None = None  # [s] of the scenario
        self.time = SteadyTime()
        self.begun = False  # waits for the first /clock where it lives by simulated time
        self.server = self._start_server()
        self.watch = watch_clock(self, self.get_logger().warning)
        self.begin_timer = self.create_timer(_BEGIN_PERIOD, self.begin, clock=steady_clock())
        self.begin()

    def begin(self) -> None:
        """Begin to record and show, once there is a time."""
        if self.begun or not ros_time(self):
            return
        self.begun = True
        self.destroy_timer(self.begin_timer)
        self.apply({'wall': self.now(), 'kind': 'run', 'speedup': self.params.speedup,
                    'simulated': is_simulated(self)})
        if self.played:
            self.apply({'wall': self.now(), 'kind': 'origin', **asdict(self.played.origin)})
        self._create_subscriptions()
        self.create_timer(_PERIOD, self.on_timer, clock=steady_clock())

    def now(self) -> float:
        """Time of the record [unix s]: that of the node's clock, which never goes back here."""
        return self.time.at(ros_time(self))

    def _create_subscriptions(self) -> None:
        """Subscribe to all topics of a fleet; the lists of other UAVs follow their states."""
        self.create_subscription(m.TaskAnnouncement, _TASKS, self.on_announcement, ANNOUNCEMENTS)
        self.create_subscription(m.FleetOrigin, 'fleet_origin', self.on_origin, LATCHED)
        self._subscribe(m.ThreatZoneArray, 'threat_zones', LATCHED, message_records.zones_record)
        self._subscribe(PolygonStamped, 'fence_area', LATCHED, message_records.fence_area_record)
        self._subscribe(m.TaskStatusArray, 'task_statuses', LATCHED,
                        message_records.statuses_record)
        self._subscribe(m.Allocation, 'allocation', ANNOUNCEMENTS,
                        message_records.allocation_record)
        self._subscribe(m.PlanProposal, 'plan_proposal', LATCHED, message_records.proposal_record)
        self._subscribe(m.SeparationAlert, 'separation_alerts', EVENTS,
                        message_records.separation_record)
        self.create_subscription(DiagnosticArray, '/diagnostics', self.on_fleet_diagnostics, 10)
        self.create_subscription(m.UavState, 'uav_states', self.on_state, STATES)
        for uav in self.played.uavs if self.played else ():
            self.subscribe_list(uav.id)

    def _subscribe(self, msg_type: type[_Message], topic: str, qos: QoSProfile | int,
                   to_record: Callable[[_Message], RecordBody]) -> None:
        """Record every message of a topic as `to_record` converts it."""
        def on_message(msg: _Message) -> None:
            self.guard.handle(topic, lambda: self.apply(self.line(to_record(msg))))
        self.create_subscription(msg_type, topic, on_message, qos)

    def subscribe_list(self, uav_id: str) -> None:
        """Subscribe to the task lists of a UAV."""
        self.with_lists.add(uav_id)
        try:
            topic = check_topic(self, TASK_LIST, uav_id)
        except InvalidValue as error:  # its state is shown nevertheless
            return self.guard.refuse('task_list', error)
        self._subscribe(m.TaskList, topic, LATCHED, message_records.task_list_record)

    def on_announcement(self, msg: m.TaskAnnouncement) -> None:
        """Record an announcement, or hold it until the origin is known."""
        def take() -> None:
            if self.state.origin is not None or not self.held.holds(msg):
                self.apply_announcement(msg)
        self.guard.handle(_TASKS, take)

    def apply_announcement(self, msg: m.TaskAnnouncement) -> None:
        """Record what is valid of an announcement; the allocator reports the rest."""
        origin = self.state.origin
        line = message_records.announcement_record(valid_tasks(msg, origin), origin)
        self.apply(self.line(line))

    def on_origin(self, msg: m.FleetOrigin) -> None:
        """Record the origin, then the announcements that waited for it."""
        self.guard.handle('fleet_origin', lambda: self.apply(
            self.line(message_records.origin_record(msg))))
        if self.state.origin is not None:
            for each in self.held.release():
                self.on_announcement(each)

    def on_fleet_diagnostics(self, msg: DiagnosticArray) -> None:
        """Record what the nodes of this fleet report of themselves."""
        msg.status = diagnostic_records.of_namespace(msg, self.get_namespace())
        if msg.status:
            self.guard.handle('/diagnostics', lambda: self.apply(
                self.line(diagnostic_records.uploads_record(msg))))

    def on_state(self, msg: m.UavState) -> None:
        """Record the state of a UAV."""
        self.guard.handle('uav_states', lambda: self.apply_state(msg))

    def apply_state(self, msg: m.UavState) -> None:
        """Record a state that differs in more than its position at once, others twice a second."""
        if not is_ros_name(msg.uav_id):
            return  # the allocator reports it
        if msg.uav_id not in self.with_lists:
            self.subscribe_list(msg.uav_id)
        line = self.line(message_records.state_record(msg))
        last = self.state.uavs.get(msg.uav_id)
        if last is None or line['wall'] - last['wall'] >= _PERIOD * self.state.scale.second or any(
                line[key] != last[key] for key in _STATE_FIELDS):
            self.apply(line)

    def line(self, body: RecordBody) -> RecordBody:
        """The line of a message that arrives now, with all its times in that of the record."""
        wall = self.now()
        return {'wall': wall, **message_records.shifted(body, self.time.offset)}

    def apply(self, line: RecordBody) -> None:
        """Apply a line to the state of the run, and write it to the record."""
        self.scene.apply(line)
        self.record.write(line)

    def on_timer(self) -> None:
        """Update terminal and page, and finish some time after the scenario is over."""
        clock = self.clock()
        self.finished = self.is_finished(clock)
        self.guard.handle('terminal', lambda: self.terminal.update(
            self.state, self.now(), clock, self.finished))
        self.guard.handle('page', self.update_page)
        self.record.flush()

    def is_finished(self, clock: float) -> bool:
        """Whether the scenario has been over for the parameter `settle` [s]."""
        if self.played is None or not run_is_over(self.state, self.played, clock):
            self.over_since = None
            return False
        self.over_since = clock if self.over_since is None else self.over_since
        return not self.params.stay and clock - self.over_since >= self.params.settle

    def update_page(self) -> None:
        """Store what has changed for the page."""
        wall = self.now()
        ended = self.over_since is not None
        updates = self.scene.updates(wall, ended)
        if self.server:
            self.snapshots.put(wall, {'start': self.state.start(), 'live': True,
                                      'beat': self.snapshots.version,  # another each time
                                      'speedup': self.state.scale.speedup,
                                      'rate': self.state.scale.rate,
                                      'ended': ended, 'still': self.watch.still}, *updates)

    def clock(self) -> float:
        """Scenario time [s]: since the first task was announced."""
        return self.state.clock(self.now()) if self.state.tasks else 0.0

    def _start_server(self) -> PageServer | None:
        """Serve the page; None, with the reason in the log, where that is not possible."""
        if not self.params.page:
            return None
        if not self.params.host:  # would be every address
            raise InvalidValue('host', '', 'an address of this machine, 0.0.0.0 for all')
        tiles = tile_source(self.params.tiles, self.params.tiles_attribution)
        try:
            from uav_task_alloc.live.server import PageServer
            server = PageServer(self.snapshots, self.params.host, self.params.port, tiles)
        except (OSError, ImportError) as error:
            reason = str(_not_installed('page', error)) if isinstance(error, ImportError) else (
                f'host = {self.params.host}, port = {self.params.port}: {error}')
            self.get_logger().warning(f'no live page: {reason}')
            return None
        server.start()
        self.guard.handle('terminal', lambda: print(f'Live page: {server.address}', flush=True))
        return server

    def _start_recorder(self) -> BagRecorder | None:
        """Record all topics, where the parameter `record` names a file."""
        if not self.params.record:
            return None
        origin = asdict(self.played.origin) if self.played else {}
        try:
            from uav_task_alloc.nodes.ros.bag_recorder import BagRecorder
            recorder = BagRecorder(Path(self.params.record), self.get_namespace(), {
                'speedup': str(self.params.speedup),
                **({'simulated': 'true'} if is_simulated(self) else {}),
                **{f'origin.{name}': str(value) for name, value in origin.items()}},
                clock=self._bag_clock())
        except ImportError as error:
            raise _not_installed('record', error) from None
        except OSError as error:
            raise InvalidValue('record', self.params.record,
                               f'a file that can be written ({error})') from None
        recorder.start()
        return recorder

    def _bag_clock(self) -> Callable[[], int] | None:
        """Time of messages in the MCAP file [ns]; None where that is real time."""
        steady = SteadyTime()  # of the recorder's thread
        return (lambda: round(1e9 * steady.at(ros_time(self)))) if is_simulated(self) else None

    def destroy_node(self) -> None:
        """Stop the server and the recorder, close the record."""
        if self.server:
            self.server.stop()
        if self.recorder:
            self.recorder.stop()
        self.record.close()
        super().destroy_node()


def _not_installed(parameter: str, error: ImportError) -> NotInstalled:
    """The error for a parameter that needs a package, which could not be imported."""
    return NotInstalled(parameter, (error.name or str(error)).split('.')[0])


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run uav_task_alloc live_view`."""
    run(LiveView, with_flags(args or sys.argv, 'record'), params=LiveViewParams)
