# SPDX-License-Identifier: Apache-2.0
"""Publishes the world for RViz: only while subscribed, and at 5 % of a core at most."""
from __future__ import annotations

import time

from geometry_msgs.msg import PolygonStamped
from nav_msgs.msg import Path
from rclpy.node import Node
from rclpy.publisher import Publisher
from visualization_msgs.msg import MarkerArray

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import Outbox
from uav_task_alloc.allocator.replanning.plan_diff import changed_tasks
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.fence_area import AreaCorners
from uav_task_alloc.model import Point, ThreatZone
from uav_task_alloc.nodes.conversions.messages import LATCHED
from uav_task_alloc.nodes.conversions.path_messages import area_message, path_message
from uav_task_alloc.nodes.ros.clock_watch import steady_clock
from uav_task_alloc.nodes.ros.topic_names import PATH, check_topic
from uav_task_alloc.nodes.rviz.markers import MarkerScene, markers

_PERIOD = 0.2  # [s] between two checks for changes
POSITION_PERIOD = 1.0  # [s] between two publications where only positions have changed
_PAUSE_FACTOR = 20.0  # times the CPU time of a publication: 5 % of a core at most


class MarkerPublisher:
    """Publishes what RViz draws of the world.

    Publishes:
        `allocation_markers` (MarkerArray), `<uav_id>/path` (nav_msgs/Path) and `fence_area`
        (PolygonStamped, without points where there is none); latched.

    Args:
        node: publishes.
        world: is read at each publication.
        area: corners of `fence_area` [m].

    Arguments of methods:
        outbox: what the allocator wants published.
        now: [s] steady clock.
    """

    def __init__(self, node: Node, world: World, area: AreaCorners = ()) -> None:
        self.node, self.world = node, world
        self.area_publisher = node.create_publisher(PolygonStamped, 'fence_area', LATCHED)
        self.area_publisher.publish(area_message(area, node.get_clock().now().nanoseconds * 1e-9))
        self.publisher = node.create_publisher(MarkerArray, 'allocation_markers', LATCHED)
        self.paths: dict[str, Publisher[Path]] = {}
        self.unpublished_paths: set[str] = set()  # UAVs
        self.previous_lists: tuple[UavList, ...] = ()  # of the plan before the last
        self.last_lists: tuple[UavList, ...] = ()  # of the last plan
        self.trigger = ''  # of the last plan
        self.changed = True  # more than positions
        self.published_zones: list[ThreatZone] = []
        self.published_positions: dict[str, Point] = {}  # [m] of UAVs
        self.published_at = self.pause_until = 0.0  # [s] steady clock
        self.timer = node.create_timer(_PERIOD, self.on_timer, clock=steady_clock())

    def close(self) -> None:
        """Destroy the timer and all publishers."""
        self.node.destroy_timer(self.timer)
        for publisher in self.paths.values():
            self.node.destroy_publisher(publisher)
        self.node.destroy_publisher(self.publisher)
        self.node.destroy_publisher(self.area_publisher)

    def update(self, outbox: Outbox) -> None:
        """Take what the allocator publishes; nothing is converted here. O(lists)."""
        for uav_id in outbox.forgotten & self.paths.keys():
            self.unpublished_paths.discard(uav_id)
            self.node.destroy_publisher(self.paths.pop(uav_id))
        for uav_id in outbox.lists:
            if uav_id not in self.paths:
                try:
                    topic = check_topic(self.node, PATH, uav_id)
                except InvalidValue:
                    continue  # the publisher of its list has logged that
                self.paths[uav_id] = self.node.create_publisher(Path, topic, LATCHED)
            self.unpublished_paths.add(uav_id)
        if outbox.allocation is not None:
            self.previous_lists, self.last_lists = self.last_lists, outbox.allocation.lists
            self.trigger = outbox.allocation.trigger
        self.changed |= bool(outbox.lists or outbox.statuses or outbox.allocation)

    def on_timer(self) -> None:
        """Publish changes where there are subscribers."""
        now = time.monotonic()
        if now < self.pause_until:
            return
        spent = time.thread_time()  # not the clock: other threads may have held this one up
        self.publish_paths()
        if self.publisher.get_subscription_count() and self.is_due(now):
            self.publish_markers(now)
        self.pause_until = now + _PAUSE_FACTOR * (time.thread_time() - spent)

    def publish_paths(self) -> None:
        """Publish the paths that changed and are subscribed; the others wait for a subscriber."""
        for uav_id in [uav_id for uav_id in self.unpublished_paths
                       if self.paths[uav_id].get_subscription_count()]:
            self.unpublished_paths.remove(uav_id)
            self.paths[uav_id].publish(path_message(self.world.list_of(uav_id),
                                                    self.world.uav_record(uav_id)))

    def is_due(self, now: float) -> bool:
        """Whether the published markers are out of date."""
        moved = (now - self.published_at >= POSITION_PERIOD
                 and self.published_positions != self.positions())
        zones = list(self.world.airspace.zones.values())
        return self.changed or moved or zones != self.published_zones

    def positions(self) -> dict[str, Point]:
        """Last reported positions of the UAVs [m]."""
        return {uav_id: record.report.position
                for uav_id, record in self.world.uav_records().items()}

    def publish_markers(self, now: float) -> None:
        """Publish all markers."""
        world = self.world
        self.changed, self.published_at = False, now
        self.published_zones = list(world.airspace.zones.values())
        self.published_positions = self.positions()
        self.publisher.publish(markers(MarkerScene(
            self.node.get_clock().now().nanoseconds * 1e-9, list(world.lists_in_force().values()),
            list(world.task_records().values()), world.uav_records(), self.published_zones,
            changed_tasks(self.previous_lists, self.last_lists), self.trigger)))
