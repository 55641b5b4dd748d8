# SPDX-License-Identifier: Apache-2.0
"""Announces the tasks and zones of a scenario file at their times, and lets UAVs die."""
from __future__ import annotations

import time

from rclpy.node import Node
from rclpy.task import Future
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SetAvailability

from uav_task_alloc import scenario
from uav_task_alloc.nodes.conversions.messages import (
    ANNOUNCEMENTS,
    LATCHED,
    announcement,
    from_zones,
)
from uav_task_alloc.nodes.ros.parameters import declare
from uav_task_alloc.nodes.ros.run import run
from uav_task_alloc.params import PlayerParams

_TICK = 0.02  # [s]
# the second is what a node is called while its name is still on the way
NO_ALLOCATOR = ('live_view', '_NODE_NAME_UNKNOWN_')


class ScenarioPlayer(Node):
    """The one master of scenario time; its clock starts when the allocator listens."""

    def __init__(self) -> None:
        super().__init__('scenario_player')
        params = declare(self, PlayerParams).now
        played = scenario.load(params.scenario)
        self.speedup = params.speedup
        self.planned = not params.wait_for_plan
        if params.wait_for_plan:
            self.create_subscription(m.Allocation, 'allocation', self.on_allocation, LATCHED)
        self.moments = list(scenario.timeline(played))
        self.started: float | None = None  # [s] steady
        self.tasks = self.create_publisher(m.TaskAnnouncement, 'task_announcements',
                                           ANNOUNCEMENTS)
        self.zones = self.create_publisher(m.ThreatZoneArray, 'threat_zones', LATCHED)
        self.set_alive = self.create_client(SetAvailability, 'fleet_sim/set_alive')
        self.doomed: list[str] = []  # UAVs whose death the simulator has not heard of yet
        self.create_timer(_TICK, self.tick)
        self.get_logger().info(
            f'{played.name}: {len(played.uavs)} UAVs, {len(played.tasks)} tasks, '
            f'{len(played.zones)} zones; waiting for an allocator')

    def tick(self) -> None:
        """Carry out every moment that is due."""
        if self.started is None:
            if not (self.planned and self.listened('task_announcements')
                    and self.listened('threat_zones')):
                return
            self.started = time.monotonic()
        now = (time.monotonic() - self.started) * self.speedup
        while self.moments and self.moments[0].at <= now:
            self.play(self.moments.pop(0))
            if not self.moments:
                self.get_logger().info('everything is announced')
        if self.doomed and self.set_alive.service_is_ready():
            self.kill(self.doomed.pop(0))

    def on_allocation(self, _: m.Allocation) -> None:
        """There is a first plan."""
        self.planned = True

    def listened(self, topic: str) -> bool:
        """Whether anybody who is not just watching has subscribed."""
        return any(other.node_name not in NO_ALLOCATOR
                   for other in self.get_subscriptions_info_by_topic(topic))

    def play(self, moment: scenario.Moment) -> None:
        """Publish what happens in one moment."""
        now = self.get_clock().now().nanoseconds * 1e-9
        if moment.zones is not None:
            self.zones.publish(from_zones(moment.zones, now))
        if moment.tasks:
            self.tasks.publish(announcement(m.TaskAnnouncement.ADD, moment.tasks, now))
        if moment.cancels:
            self.tasks.publish(announcement(m.TaskAnnouncement.CANCEL, moment.cancels, now))
        self.doomed += moment.deaths
        self.get_logger().info(describe(moment))

    def kill(self, uav: str) -> None:
        """Ask the simulator to let a UAV die."""
        def answered(future: Future) -> None:
            if not future.result().success:
                self.get_logger().error(f'{uav} does not die: {future.result().message}')
        request = SetAvailability.Request(uav_id=uav, available=False)
        self.set_alive.call_async(request).add_done_callback(answered)


def describe(moment: scenario.Moment) -> str:
    """One line of log: `70.0 s: 3 zones; new: a03; cancelled: t05; dies: uav_3`."""
    parts = [] if moment.zones is None else [f'{len(moment.zones)} zones']
    for word, names in (('new', [task.id for task in moment.tasks]),
                        ('cancelled', [task.id for task in moment.cancels]),
                        ('dies', list(moment.deaths))):
        parts += [f'{word}: {", ".join(names)}'] if names else []
    return f'{moment.at:.1f} s: ' + '; '.join(parts)


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run(ScenarioPlayer, args)
