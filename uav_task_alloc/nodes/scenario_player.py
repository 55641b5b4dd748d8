# SPDX-License-Identifier: Apache-2.0
"""Announces tasks and zones of a scenario file at their times, gives its orders, fails UAVs."""
from __future__ import annotations

import time
from dataclasses import replace

from rclpy.node import Node
from rclpy.task import Future
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SetAvailability

from uav_task_alloc import scenario
from uav_task_alloc.errors import counted, first_of
from uav_task_alloc.nodes.conversions.messages import (
    ANNOUNCEMENTS,
    LATCHED,
    announcement,
    from_zones,
)
from uav_task_alloc.nodes.ros.clock_publisher import ClockPublisher
from uav_task_alloc.nodes.ros.clock_watch import (
    SteadyTime,
    is_simulated,
    ros_time,
    steady_clock,
    watch_clock,
)
from uav_task_alloc.nodes.ros.parameters import declare, given
from uav_task_alloc.nodes.ros.run import run
from uav_task_alloc.nodes.ros.scenario_orders import ScenarioOrders
from uav_task_alloc.params import PlayerParams
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.values import Kind

_PERIOD = 0.02  # [s]
# the second is the name of a node that is not fully discovered yet
_OBSERVERS = ('live_view', '_NODE_NAME_UNKNOWN_')
_MOST_NAMED = 20  # of each kind in one line of the log


class ScenarioPlayer(Node):
    """Plays a scenario; its time starts when an allocator has subscribed.

    Publishes:
        `task_announcements` (TaskAnnouncement), `threat_zones` (ThreatZoneArray); both latched;
        `/clock` (Clock) where the parameter `clock` is true.
    Subscribes to:
        `allocation` (Allocation), where `wait_for_plan` is set or the scenario has orders;
        `task_statuses` (TaskStatusArray), where it has orders.
    Service clients:
        `fleet_sim/set_alive` (SetAvailability);
        `allocator/pin_task` (PinTask), `allocator/forbid_task` (ForbidTask),
        `allocator/order_tasks` (OrderTasks), where the scenario has orders.
    Parameters:
        PlayerParams, see docs/parameters.md.
    """

    def __init__(self) -> None:
        super().__init__('scenario_player')
        params = declare(self, PlayerParams).now
        played = scenario.load(given('scenario', params.scenario, 'a scenario file'))
        self.speedup = params.speedup
        self.has_plan = not params.wait_for_plan
        if params.wait_for_plan:
            self.create_subscription(m.Allocation, 'allocation', self.on_allocation, LATCHED)
        self.moments = list(scenario.timeline(played))
        self.time = SteadyTime()
        self.epoch, self.began = time.time(), time.monotonic()  # [unix s], [s]
        self.leads = params.clock and not is_simulated(self)  # /clock is its own time
        self.started_at: float | None = None  # [s] of `now`
        self.tasks = self.create_publisher(m.TaskAnnouncement, 'task_announcements',
                                           ANNOUNCEMENTS)
        self.zones = self.create_publisher(m.ThreatZoneArray, 'threat_zones', LATCHED)
        self.set_alive = self.create_client(SetAvailability, 'fleet_sim/set_alive')
        self.failing: list[str] = []  # UAVs whose failure is not yet requested
        self.orders = ScenarioOrders(self) if played.orders else None
        if self.leads:
            self.clock_publisher = ClockPublisher(self, self.now, yields=True)
        watch_clock(self, self.get_logger().warning)
        self.create_timer(_PERIOD, self.on_timer, clock=steady_clock())
        self.get_logger().info(
            f'{played.name}: {counted(len(played.uavs), "UAV")}, '
            f'{counted(len(played.tasks), "task")}, {counted(len(played.zones), "zone")}; '
            'waiting for an allocator')
        if ignored := played.keys_of_plan_only():
            self.get_logger().warning(
                f'{played.name}: flights ignore {", ".join(ignored)}; only plan uses them')

    def on_timer(self) -> None:
        """Play every moment that is due."""
        if self.started_at is None:
            if not (self.has_plan and self.stamp() > 0.0
                    and self.is_subscribed('task_announcements')
                    and self.is_subscribed('threat_zones')):
                return
            self.started_at = self.now()
        now = self.now() - self.started_at
        while self.moments and self.moments[0].at <= now:
            self.play(self.moments.pop(0))
            if not self.moments:
                self.get_logger().info('everything is announced')
        if self.failing and self.set_alive.service_is_ready():
            self.request_failure(self.failing.pop(0))
        if self.orders:
            self.orders.step()

    def now(self) -> float:
        """Time of the scenario's clock [s]: /clock, or `speedup` times the steady clock."""
        if is_simulated(self):
            return self.time.at(ros_time(self))
        return self.epoch + (time.monotonic() - self.began) * self.speedup

    def stamp(self) -> float:
        """The ROS time of messages [s]."""
        return self.now() if self.leads else ros_time(self)

    def on_allocation(self, _: m.Allocation) -> None:
        """Note that there is a plan."""
        self.has_plan = True

    def is_subscribed(self, topic: str) -> bool:
        """Whether a node other than an observer has subscribed."""
        return any(info.node_name not in _OBSERVERS
                   for info in self.get_subscriptions_info_by_topic(topic))

    def play(self, moment: scenario.Moment) -> None:
        """Publish what changes in one moment."""
        now = self.stamp()
        if moment.zones is not None:
            self.zones.publish(from_zones(moment.zones, now))
        if moment.works:
            zero = now - (self.now() - (self.started_at or 0.0))  # ROS time of second 0
            works = [replace(work, task=scenario.from_zero(work.task, zero))
                     for work in moment.works]
            self.tasks.publish(announcement(m.TaskAnnouncement.ADD, works, now))
        if moment.cancels:
            self.tasks.publish(announcement(m.TaskAnnouncement.CANCEL, moment.cancels, now))
        self.failing += moment.deaths
        if self.orders:
            self.orders.waiting += moment.orders
        self.get_logger().info(describe(moment))

    def request_failure(self, uav_id: str) -> None:
        """Ask the simulator to stop a UAV."""
        def on_response(future: Future[SetAvailability.Response]) -> None:
            response = future.result()
            if response is None or not response.success:
                self.get_logger().error(
                    f'{uav_id} does not fail: {response.message if response else "no response"}')
        request = SetAvailability.Request(uav_id=uav_id, available=False)
        self.set_alive.call_async(request).add_done_callback(on_response)


def work_text(work: Work) -> str:
    """The id of a task, with its kind where it is no point."""
    return work.task.id if work.kind is Kind.POINT else f'{work.task.id} ({work.kind.name})'


def describe(moment: scenario.Moment) -> str:
    """A moment in one log line: `70.0 s: 3 zones; new: a03; cancelled: t05; dies: uav_3`."""
    parts = [] if moment.zones is None else [counted(len(moment.zones), 'zone')]
    for word, names in (('new', [work_text(work) for work in moment.works]),
                        ('cancelled', [task.id for task in moment.cancels]),
                        ('dies', list(moment.deaths)),
                        ('orders', [order.text for order in moment.orders])):
        parts += [f'{word}: {first_of(names, _MOST_NAMED)}'] if names else []
    return f'{moment.at:.1f} s: ' + '; '.join(parts)


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run uav_task_alloc scenario_player`."""
    run(ScenarioPlayer, args, params=PlayerParams)
