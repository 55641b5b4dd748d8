# SPDX-License-Identifier: Apache-2.0
"""The allocator as a node: takes UAV states, tasks and zones, publishes a list for each UAV."""
from __future__ import annotations

import gc
import time
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.service import Service
from rclpy.subscription import Subscription
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator.core import FASTEST_CLOCK, REAL_CLOCK, Allocator
from uav_task_alloc.allocator.leader import Role
from uav_task_alloc.allocator.persistence.persistence import Persistence
from uav_task_alloc.allocator.records import LogNote, TaskVerdict
from uav_task_alloc.allocator.state.ground import read_ground
from uav_task_alloc.errors import InvalidValue, counted
from uav_task_alloc.geometry.fence_area import area_corners
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.nodes.conversions import announcements
from uav_task_alloc.nodes.conversions.messages import (
    INPUT_ANNOUNCEMENTS,
    INPUT_EVENTS,
    INPUT_STATES,
    LATCHED,
    to_event,
    to_report,
)
from uav_task_alloc.nodes.ros.allocation_publisher import AllocationPublisher
from uav_task_alloc.nodes.ros.allocator_diagnostics import AllocatorDiagnostics
from uav_task_alloc.nodes.ros.allocator_services import AllocatorServices
from uav_task_alloc.nodes.ros.batched_subscription import subscribe_batched
from uav_task_alloc.nodes.ros.clock_watch import is_simulated
from uav_task_alloc.nodes.ros.leader_election import LeaderElection
from uav_task_alloc.nodes.ros.leveled_log import LeveledLog
from uav_task_alloc.nodes.ros.order_services import OrderServices
from uav_task_alloc.nodes.ros.origin_check import OriginCheck
from uav_task_alloc.nodes.ros.parameters import declare
from uav_task_alloc.nodes.ros.refusal_log import RefusalLog
from uav_task_alloc.nodes.ros.run import run
from uav_task_alloc.nodes.ros.solver_thread import SolverThread
from uav_task_alloc.nodes.ros.step_pacing import StepPacing
from uav_task_alloc.nodes.ros.topic_names import TASK_LIST, check_topic
from uav_task_alloc.nodes.rviz.marker_publisher import MarkerPublisher
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.record.message_records import from_stamp
from uav_task_alloc.zone_codec import decode_zone_array, refused_text

_STEP_PERIOD = 0.025  # [s]
_LOCK_TIMEOUT = 5.0  # [s] for the journal of an allocator that is exiting
_SUBSCRIBER_TIMEOUT = 1.0  # [s] that the lists of the previous run wait for subscribers
_MOST_LINES, _MOST_ROWS = 200, 500  # logged, and saved, per step


class AllocatorNode(Node):
    """Allocates tasks to UAVs, and plans again whenever something has changed.

    Publishes:
        `<uav_id>/task_list` (TaskList), `task_statuses` (TaskStatusArray), `allocation`
        (Allocation), `allocation_markers` (MarkerArray), `<uav_id>/path` (nav_msgs/Path),
        `fence_area` (PolygonStamped), `fleet_origin` (FleetOrigin), `<uav_id>/hold` (UavHold),
        `plan_proposal` (PlanProposal), all latched; `separation_alerts` (SeparationAlert);
        `/diagnostics` (DiagnosticArray).
    Subscribes to:
        `uav_states` (UavState), `task_announcements` (TaskAnnouncement), `threat_zones`
        (ThreatZoneArray), `task_events` (TaskEvent), `fleet_origin`, `/diagnostics`.
    Services:
        `~/submit_tasks` (SubmitTasks), `~/replan` (Trigger), `~/set_availability`
        (SetAvailability), `~/forget_demand` (Trigger); for orders of operators
        `~/pin_task`, `~/forbid_task`, `~/order_tasks`, `~/pause_uav`, `~/resume_uav`,
        `~/return_uav`, `~/undo_order`, `~/approve_plan`.
    Parameters:
        AllocatorParams, see docs/parameters.md.
    """

    def __init__(self) -> None:
        super().__init__('allocator')
        self.live = declare(self, AllocatorParams)
        params = self.live.now
        self.log = LeveledLog(self)
        self.refusals = RefusalLog(self.get_logger().warning)
        self.origin = Origin(params.origin__latitude, params.origin__longitude,
                             params.origin__altitude_amsl)
        self.origins = OriginCheck(self, self.origin, lambda reason: self.refusals.report(
            'fleet_origin', '', reason))
        terrain = read_ground(params, self.origin)
        self.persistence = Persistence(params.state_dir, self.get_logger().error, self.origin,
                                       _LOCK_TIMEOUT)
        self.core = Allocator(params, time.monotonic(), self.persistence.saved, terrain)
        self.world = self.core.world
        self.solver = SolverThread(self, lambda: self.live.now, self.on_results)
        self.pacing = StepPacing(time.monotonic())
        self.pending = False  # something is not yet saved or published
        self.passive = False  # another allocator leads
        self.election = LeaderElection(self, self.world.lists, self.persistence.in_use)
        self._create_topics()
        self.subscribers_by = time.monotonic() + _SUBSCRIBER_TIMEOUT
        self.solver.start()

    def _create_topics(self) -> None:
        self.publisher = AllocationPublisher(self, self.world)
        self.publisher.prepare(self.world.lists_in_force())
        self.markers = MarkerPublisher(self, self.world, area_corners(
            self.live.now.fence_area, self.origin))
        self.orders = OrderServices(self, self.core, self.save, self.stamp,
                                    self.origins.conflict)
        self.requests = AllocatorServices(self, self.world, self.on_tasks, self.save,
                                          self.origins.conflict)
        self.diagnostics = AllocatorDiagnostics(self, self.core, self.persistence, self.origins,
                                                self.election, self.solver)
        self.inputs: list[Subscription[Any]] = [
            subscribe_batched(self, m.UavState, 'uav_states', self.on_state, INPUT_STATES),
            subscribe_batched(self, m.TaskAnnouncement, 'task_announcements', self.on_tasks,
                              INPUT_ANNOUNCEMENTS),
            subscribe_batched(self, m.ThreatZoneArray, 'threat_zones', self.on_zones, LATCHED),
            subscribe_batched(self, m.TaskEvent, 'task_events', self.on_event, INPUT_EVENTS)]
        self.offered: list[Service] = []  # while it leads
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may be paused
        self.create_timer(_STEP_PERIOD, self.on_step, clock=steady)
        self.create_timer(1.0, self.publish_diagnostics, clock=steady)

    # which allocator leads

    def leads(self) -> bool:
        """Whether this allocator may publish; it offers its services from then on."""
        role = self.election.role()
        if role is Role.LEADING and not self.offered:
            self.offered = [*self.requests.offer(), *self.orders.offer()]
        if role is Role.PASSIVE and not self.passive:
            self.step_down()
        return role is Role.LEADING

    def step_down(self) -> None:
        """Destroy all topics and services but /diagnostics; what was accepted is saved."""
        self.passive = True
        self.get_logger().error(self.election.trouble())
        self.save()
        for subscription in self.inputs:
            self.destroy_subscription(subscription)
        for service in self.offered:
            self.destroy_service(service)
        self.publisher.close()
        self.orders.close()
        self.markers.close()

    # topics

    def on_state(self, msg: m.UavState) -> None:
        """Take the state of a UAV."""
        try:
            report, now, stamp = to_report(msg), time.monotonic(), self.stamp()
            check_topic(self, TASK_LIST, report.uav_id)
            if self.world.update_uav(report, now, stamp):
                return  # there are too many UAVs, which the world reports once
            if not is_simulated(self):  # that clock is late, by as much as it is faster
                self.diagnostics.offsets.add(
                    report.uav_id, from_stamp(msg.header.stamp), stamp, now)
            refusal = ''
        except InvalidValue as error:
            refusal = str(error)
        self.refusals.report('uav_states', msg.uav_id, refusal)

    def on_tasks(self, msg: m.TaskAnnouncement) -> list[TaskVerdict]:
        """Add, update or cancel tasks."""
        return announcements.announce(self.world, msg, self.origin, self.stamp(),
                                      time.monotonic())

    def on_zones(self, msg: m.ThreatZoneArray) -> None:
        """Replace all zones; one that is invalid stays as it was."""
        try:
            zones, invalid = decode_zone_array(msg)
        except InvalidValue as error:
            self.diagnostics.refused_zones = f'threat_zones refused: {error}'
            return self.refusals.report('threat_zones', '', str(error))
        self.diagnostics.refused_zones = refused_text(invalid)
        self.refusals.report('threat_zones', '', '')
        for zone in msg.zones:
            self.refusals.report('threat_zones', zone.zone_id, invalid.get(zone.zone_id, ''))
        self.world.set_zones(zones, invalid, time.monotonic())

    def on_event(self, msg: m.TaskEvent) -> None:
        """Take the start, the completion or the failure of a task."""
        try:
            refusal = self.world.event(to_event(msg), self.stamp(), time.monotonic())
        except InvalidValue as error:
            refusal = str(error)
        self.refusals.report('task_events', msg.task_id, refusal)
        self.save()

    # steps

    def on_step(self) -> None:
        """Let time pass, start a solve where one is due, and publish changes."""
        now, stamp = time.monotonic(), self.stamp()
        due = self.pacing.is_due(now)
        if not self.leads() or not due or self.waits_for_subscribers(now):
            return
        if not self.pending:  # each step would look at all tasks again, and nothing be published
            self.world.set_params(self.live.now, now)
            self.core.clock_rate = FASTEST_CLOCK if is_simulated(self) else REAL_CLOCK
            self.core.tick(now, stamp)
        self.start_solve(now, stamp)
        self.publish(stamp)
        self.pacing.pause_after(now, time.monotonic())

    def start_solve(self, now: float, stamp: float) -> None:
        """Give the solver a problem that is due, or end a background solve for it."""
        # not before the last result is published: under load that would never complete
        blocked = self.pending or self.origins.conflict()
        problem = None if blocked else self.core.due(now, stamp)
        if problem is not None:
            self.solver.submit(problem)
        elif self.core.stop_early(now, self.solver.background):
            self.solver.stop_early()

    def waits_for_subscribers(self, now: float) -> bool:
        """Whether the lists of the previous run still wait for subscribers.

        What is published before a subscriber is matched may reach it 3 s later.
        """
        if now < self.subscribers_by and not self.publisher.all_subscribed():
            return True
        self.subscribers_by = now
        return False

    def on_results(self) -> None:
        """Adopt the solver's results; the first one means that the solver is loaded."""
        started = time.monotonic()
        for result in self.solver.results():
            if not self.world.kernels_ready:
                self.core.set_kernels_ready()
                gc.freeze()  # collections need not traverse the compiler's objects
                self.get_logger().info('ready')
                continue
            self.core.adopt(result, time.monotonic(), self.stamp())
        if self.leads():
            self.publish(self.stamp())
        self.pacing.pause_after(started, time.monotonic())

    def publish(self, stamp: float) -> None:
        """Save changes, then publish them; only holds while the origins of nodes differ.

        Holds that keep UAVs apart do not wait for the disk.
        """
        self.orders.separate(self.core.separate(time.monotonic(), stamp))
        self.pending = not self.persistence.save(self.core, time.monotonic(), _MOST_ROWS)
        if self.pending:
            return
        conflict = self.origins.conflict()
        outbox = self.core.collect_holds() if conflict else self.core.collect()
        self.log_notes(outbox.notes)
        self.publisher.enqueue(outbox)
        self.orders.publish(outbox)
        if conflict:
            return
        self.pending = self.publisher.publish_some(stamp)
        self.markers.update(outbox)

    def save(self) -> None:
        """Save all changes."""
        self.persistence.save(self.core, time.monotonic())

    def log_notes(self, notes: list[LogNote]) -> None:
        """Log the first notes."""
        for note in notes[:_MOST_LINES]:
            self.log.write(note.level, note.text)
        if len(notes) > _MOST_LINES:
            self.get_logger().warning(f'and {counted(len(notes) - _MOST_LINES, "line")} more')

    def publish_diagnostics(self) -> None:
        """Publish warnings and figures, and compare the origins of the nodes."""
        self.origins.check()
        self.diagnostics.publish(self.stamp())

    def stamp(self) -> float:
        """The published clock [s]."""
        return self.get_clock().now().nanoseconds * 1e-9

    def destroy_node(self) -> None:
        """End the solver, save, and release the journal."""
        self.solver.close()
        self.orders.close()
        self.persistence.save_last(self.core)
        self.persistence.close()
        super().destroy_node()


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run uav_task_alloc allocator`."""
    run(AllocatorNode, args, params=AllocatorParams)
