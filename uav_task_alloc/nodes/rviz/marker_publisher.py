# SPDX-License-Identifier: Apache-2.0
"""Publishes the picture of the world for RViz: only while somebody looks, and never for long."""
from __future__ import annotations

import time

from nav_msgs.msg import Path
from rclpy.node import Node
from rclpy.publisher import Publisher
from visualization_msgs.msg import MarkerArray

from uav_task_alloc.allocator.records import Outbox, UavList
from uav_task_alloc.allocator.replanning.plan_diff import changed_tasks
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Point
from uav_task_alloc.nodes.conversions.messages import LATCHED
from uav_task_alloc.nodes.conversions.path_messages import path
from uav_task_alloc.nodes.ros.topic_names import PATH, check_topic
from uav_task_alloc.nodes.rviz.markers import Picture, markers

_LOOK = 0.2  # [s] between two looks at what is new
MOVED = 1.0  # [s] between two pictures where only UAVs moved
REST = 20.0  # times as long as a picture took nothing is drawn after it: 5 % of a core at most


class MarkerPublisher:
    """Markers on `allocation_markers`, and a nav_msgs/Path on `<uav_id>/path` for each list."""

    def __init__(self, node: Node, world: World) -> None:
        self.node, self.world = node, world
        self.publisher = node.create_publisher(MarkerArray, 'allocation_markers', LATCHED)
        self.paths: dict[str, Publisher] = {}
        self.untold: set[str] = set()  # UAVs whose path nobody has seen yet
        self.before: tuple[UavList, ...] = ()  # of the plan before the last
        self.after: tuple[UavList, ...] = ()  # of the last plan
        self.trigger = ''
        self.new = True  # more than positions
        self.zones: list[object] = []
        self.places: dict[str, Point] = {}  # of UAVs as drawn
        self.drawn = self.rested = 0.0  # [s] steady clock
        self.timer = node.create_timer(_LOOK, self.on_look)

    def close(self) -> None:
        """Draw nothing any more."""
        self.node.destroy_timer(self.timer)
        for made in (*self.paths.values(), self.publisher):
            self.node.destroy_publisher(made)

    def note(self, out: Outbox) -> None:
        """What the allocator told; it costs next to nothing."""
        for uav_id in out.forgotten & self.paths.keys():
            self.untold.discard(uav_id)
            self.node.destroy_publisher(self.paths.pop(uav_id))
        for uav_id in out.lists:
            if uav_id not in self.paths:
                try:
                    topic = check_topic(self.node, PATH, uav_id)
                except InvalidValue:
                    continue  # whoever publishes its list says so
                self.paths[uav_id] = self.node.create_publisher(Path, topic, LATCHED)
            self.untold.add(uav_id)
        if out.allocation is not None:
            self.before, self.after = self.after, out.allocation.lists
            self.trigger = out.allocation.trigger
        self.new |= bool(out.lists or out.statuses or out.allocation)

    def on_look(self) -> None:
        """Draw what is new where somebody looks."""
        now = time.monotonic()
        if now < self.rested:
            return
        self.tell_paths()
        if self.publisher.get_subscription_count() and self.is_due(now):
            self.draw(now)
        self.rested = now + REST * (time.monotonic() - now)

    def tell_paths(self) -> None:
        """Publish the paths that changed; a later listener gets the last one all the same."""
        for uav_id in [u for u in self.untold if self.paths[u].get_subscription_count()]:
            self.untold.remove(uav_id)
            self.paths[uav_id].publish(path(self.world.lists.get(uav_id),
                                            self.world.fleet.records.get(uav_id)))

    def is_due(self, now: float) -> bool:
        """Whether the picture that is out is no longer true."""
        zones = list(self.world.zones.values())
        return (self.new or zones != self.zones
                or (now - self.drawn >= MOVED and self.places != self.positions()))

    def positions(self) -> dict[str, Point]:
        """Where the UAVs are [m]."""
        return {uav_id: record.report.position
                for uav_id, record in self.world.fleet.records.items()}

    def draw(self, now: float) -> None:
        """Publish the whole picture."""
        world = self.world
        self.new, self.drawn = False, now
        self.zones, self.places = list(world.zones.values()), self.positions()
        self.publisher.publish(markers(Picture(
            self.node.get_clock().now().nanoseconds * 1e-9, list(world.lists.lists.values()),
            list(world.tasks.records.values()), world.fleet.records, list(world.zones.values()),
            changed_tasks(self.before, self.after), self.trigger)))
