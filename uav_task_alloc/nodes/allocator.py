# SPDX-License-Identifier: Apache-2.0
"""The allocator as a node: hears UAVs, tasks and zones, publishes a list for each UAV."""
from __future__ import annotations

import gc
import time
from collections import deque

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.service import Service
from rclpy.subscription import Subscription
from std_srvs.srv import Trigger
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SetAvailability, SubmitTasks

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.leader import Role
from uav_task_alloc.allocator.persistence.persistence import Persistence
from uav_task_alloc.allocator.records import LogNote, ReplanAnswer, ReplanProblem, TaskVerdict
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.allocator.replanning.worker import Worker
from uav_task_alloc.allocator.status import facts, worries
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.nodes.conversions import allocation_messages as told, announcements
from uav_task_alloc.nodes.conversions.messages import (
    HEARD_ANNOUNCEMENTS,
    HEARD_EVENTS,
    HEARD_STATES,
    LATCHED,
    to_event,
    to_report,
)
from uav_task_alloc.nodes.ros.allocation_publisher import AllocationPublisher
from uav_task_alloc.nodes.ros.batched_subscription import subscribe_batched
from uav_task_alloc.nodes.ros.leader_election import LeaderElection
from uav_task_alloc.nodes.ros.origin_check import OriginCheck
from uav_task_alloc.nodes.ros.parameters import declare
from uav_task_alloc.nodes.ros.refusal_log import RefusalLog
from uav_task_alloc.nodes.ros.run import run
from uav_task_alloc.nodes.ros.topic_names import TASK_LIST, check_topic
from uav_task_alloc.nodes.rviz.marker_publisher import MarkerPublisher
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.zone_codec import decode_zone_array

_TICK = 0.025  # [s]
LOCK_WAIT = 5.0  # [s] for the journal of an allocator that is just ending
_PATIENCE = 1.0  # [s] that the lists of the last life wait for somebody to hear them
REST, MOST_REST = 3.0, 0.2  # times as long as a tick took the next one waits, at most [s]
MOST_LINES, MOST_ROWS = 200, 500  # logged, and saved, at once


class AllocatorNode(Node):
    """Wires topics to the world, the world to the worker, answers to topics."""

    def __init__(self) -> None:
        super().__init__('allocator')
        self.live = declare(self, AllocatorParams)
        now = self.live.now
        self.origin = Origin(now.origin__latitude, now.origin__longitude,
                             now.origin__altitude_amsl)
        self.origins = OriginCheck(self, self.origin, lambda text: self.complain(
            'fleet_origin', '', text))
        self.keeper = Persistence(now.state_dir, self.get_logger().error, self.origin,
                             LOCK_WAIT)
        self.core = Allocator(now, time.monotonic(), self.keeper.saved)
        self.world = self.core.world
        self.complain = RefusalLog(self.get_logger().warning).say
        self.answers: deque[ReplanAnswer | None] = deque()
        self.background = False
        self.rested = 0.0  # [s] steady clock
        self.refused = ''  # which other origin was logged
        self.fault = ''  # why the last solve failed
        self.behind = False  # there is more to tell than was told
        self.inputs: list[Subscription] = []
        self.offers: list[Service] = []  # once it leads
        self.passive = False  # another allocator leads
        self.watch = LeaderElection(self, self.world.lists, self.keeper.in_use)
        self._listen()
        self._talk()
        self.arrived = self.create_guard_condition(self.on_answer)
        self.patient_until = time.monotonic() + _PATIENCE
        self.teller.prepare(self.world.lists.lists)
        self.worker = Worker(self.prepare, self.solve, self.deliver, self.failed)
        self.worker.start()

    def _listen(self) -> None:
        for kind, topic, heard, qos in (
                (m.UavState, 'uav_states', self.on_state, HEARD_STATES),
                (m.TaskAnnouncement, 'task_announcements', self.on_tasks,
                 HEARD_ANNOUNCEMENTS),
                (m.ThreatZoneArray, 'threat_zones', self.on_zones, LATCHED),
                (m.TaskEvent, 'task_events', self.on_event, HEARD_EVENTS)):
            self.inputs.append(subscribe_batched(self, kind, topic, heard, qos))
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        self.create_timer(_TICK, self.on_tick, clock=steady)
        self.create_timer(1.0, self.on_second, clock=steady)

    def _talk(self) -> None:
        self.teller = AllocationPublisher(self, self.world)
        self.painter = MarkerPublisher(self, self.world)
        self.health = self.create_publisher(DiagnosticArray, '/diagnostics', 10)

    def leads(self) -> bool:
        """Whether this allocator may publish; where another one leads it lets go of all topics."""
        role = self.watch.role()
        if role is Role.LEADING and not self.offers:
            self.offers = [
                self.create_service(SubmitTasks, '~/submit_tasks', self.on_submit),
                self.create_service(Trigger, '~/replan', self.on_replan),
                self.create_service(SetAvailability, '~/set_availability', self.on_availability)]
        if role is Role.PASSIVE and not self.passive:
            self.step_down()
        return role is Role.LEADING

    def step_down(self) -> None:
        """Hear, offer and publish nothing any more but /diagnostics; what was accepted is kept."""
        self.passive = True
        self.get_logger().error(self.watch.trouble())
        self.keeper.save(self.core, time.monotonic())
        for heard in self.inputs:
            self.destroy_subscription(heard)
        for offer in self.offers:
            self.destroy_service(offer)
        self.teller.close()
        self.painter.close()

    def stamp(self) -> float:
        """The published clock [s]."""
        return self.get_clock().now().nanoseconds * 1e-9

    # what is heard

    def on_state(self, msg: m.UavState) -> None:
        """A UAV says how it is."""
        try:
            report = to_report(msg)
            check_topic(self, TASK_LIST, report.uav_id)
            refused = self.world.hear(report, time.monotonic(), self.stamp())
            if refused:  # for want of room, which the world says once
                return
        except InvalidValue as error:
            refused = str(error)
        self.complain('uav_states', msg.uav_id, refused)

    def on_tasks(self, msg: m.TaskAnnouncement) -> list[TaskVerdict]:
        """Tasks are added, changed or withdrawn."""
        return announcements.take(self.world, msg, self.origin, self.stamp(), time.monotonic())

    def on_zones(self, msg: m.ThreatZoneArray) -> None:
        """The whole picture of the zones."""
        try:
            zones, bad = decode_zone_array(msg)
        except InvalidValue as error:
            return self.complain('threat_zones', '', str(error))
        self.complain('threat_zones', '', '')
        for zone in msg.zones:
            self.complain('threat_zones', zone.zone_id, bad.get(zone.zone_id, ''))
        self.world.set_zones(zones, bad, time.monotonic())

    def on_event(self, msg: m.TaskEvent) -> None:
        """A task was started, completed, or failed."""
        try:
            refused = self.world.event(to_event(msg), self.stamp(), time.monotonic())
        except InvalidValue as error:
            refused = str(error)
        if refused:
            self.get_logger().warning(f'task_events: {refused}: ignored')
        self.keeper.save(self.core, time.monotonic())

    def on_submit(self, request: SubmitTasks.Request,
                  response: SubmitTasks.Response) -> SubmitTasks.Response:
        """The same as an announcement, with an answer; it is on disk before that."""
        verdicts = self.on_tasks(request.announcement)
        self.keeper.save(self.core, time.monotonic())
        return announcements.answer(verdicts, response)

    def on_replan(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Somebody wants a new plan."""
        self.world.touch('replan service', time.monotonic())
        response.success, response.message = True, 'a new plan follows on `allocation`'
        return response

    def on_availability(self, request: SetAvailability.Request,
                        response: SetAvailability.Response) -> SetAvailability.Response:
        """An operator takes a UAV out, or puts it back."""
        refused = self.world.set_available(request.uav_id, request.available, time.monotonic())
        self.keeper.save(self.core, time.monotonic())
        word = 'available' if request.available else 'not available'
        response.success, response.message = not refused, refused or f'{request.uav_id} is {word}'
        return response

    # what is solved

    def on_tick(self) -> None:
        """What time brings, a solve where one is due, and what has to be told."""
        now, stamp = time.monotonic(), self.stamp()
        if not self.leads() or now < self.rested or self.waits_for_listeners(now):
            return
        if self.world.params is not self.live.now:
            self.world.params = self.live.now
            self.world.touch('parameters changed', now)
        self.core.tick(now, stamp)
        # nothing is solved while the last answer is not told: telling would never come to an end
        problem = None if self.behind or self.origins.conflict() else self.core.due(now, stamp)
        if problem is not None:
            self.background = problem.background
            self.worker.ask(problem)
        elif self.core.hurry(now, self.background):
            self.worker.hurry()
        self.tell(stamp)
        self.rest(now)

    def waits_for_listeners(self, now: float) -> bool:
        """After a restart: what is told before it is heard may take DDS 3 s to be told again."""
        if now < self.patient_until and not self.teller.is_heard():
            return True
        self.patient_until = now
        return False

    def rest(self, began: float) -> None:
        """What is heard has its turn between two pieces of work, however full the world."""
        now = time.monotonic()
        self.rested = now + min(REST * (now - began), MOST_REST)

    def prepare(self) -> None:
        """In the worker's thread: load the compiler and all it has compiled."""
        from uav_task_alloc.allocator.replanning.warm_up import warm_up
        from uav_task_alloc.solver.solve import plan
        warm_up(plan, self.live.now)

    def solve(self, problem: ReplanProblem, stop) -> ReplanAnswer:
        """In the worker's thread."""
        from uav_task_alloc.solver.solve import plan
        return planning.solve_problem(plan, problem, self.live.now, stop)

    def deliver(self, answer: ReplanAnswer | None) -> None:
        """In the worker's thread: wake the node's."""
        self.answers.append(answer)
        self.arrived.trigger()

    def failed(self, error: Exception) -> None:
        """In the worker's thread."""
        self.fault = f'{type(error).__name__}: {error}'[:500]
        self.get_logger().error(f'solver: {self.fault}', throttle_duration_sec=10.0)

    def on_answer(self) -> None:
        """The worker has an answer, or is ready for the first problem."""
        began = time.monotonic()
        while self.answers:
            if not self.world.awake:
                self.core.wake()
                self.answers.popleft()
                gc.freeze()  # a collection need not look through the compiler each time
                self.get_logger().info('ready')
                continue
            answer = self.answers.popleft()
            self.fault = self.fault if answer is None else ''
            self.core.adopt(answer, time.monotonic(), self.stamp())
        if self.leads():
            self.tell(self.stamp())
        self.rest(began)

    # what is told

    def tell(self, stamp: float) -> None:
        """On disk first, then published, while all nodes have one origin."""
        self.behind = not self.keeper.save(self.core, time.monotonic(), MOST_ROWS)
        if self.behind or self.origins.conflict():
            return
        out = self.core.collect()
        self.log(out.notes)
        self.teller.take(out)
        self.behind = self.teller.tell(stamp)
        self.painter.note(out)

    def log(self, notes: list[LogNote]) -> None:
        """A line each, of a flood the first; rclpy wants one place in the source a severity."""
        for note in notes[:MOST_LINES]:
            if note.warning:
                self.get_logger().warning(note.text)
            else:
                self.get_logger().info(note.text)
        if len(notes) > MOST_LINES:
            self.get_logger().warning(f'and {len(notes) - MOST_LINES} lines more')

    def on_second(self) -> None:
        """Say how it goes."""
        self.origins.check()
        conflict = self.origins.conflict()
        stopped = self.watch.trouble() or (conflict and f'refuses to plan: {conflict}')
        if conflict != self.refused:
            self.refused = conflict
            self.get_logger().error(stopped if conflict else 'fleet_origin: all agree')
        self.health.publish(told.from_health(
            self.get_fully_qualified_name(),
            [stopped] if stopped else worries(self.world, self.keeper.trouble, self.fault),
            {**facts(self.world), **self.watch.facts()}, self.stamp(), bool(stopped)))

    def destroy_node(self) -> None:
        """End the worker, let go of the journal."""
        self.worker.close()
        self.keeper.save(self.core, time.monotonic())
        self.keeper.close()
        super().destroy_node()


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run uav_task_alloc allocator`."""
    run(AllocatorNode, args)
