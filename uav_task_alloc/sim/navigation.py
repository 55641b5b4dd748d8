# SPDX-License-Identifier: Apache-2.0
"""Turns mission items, landings and returns into tracks for a simulated autopilot."""
from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.geometry.frames import Origin, to_enu, to_geodetic
from uav_task_alloc.model import Point
from uav_task_alloc.sim import stored_item as item_
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.dynamics import PointMass, Track
from uav_task_alloc.sim.stored_item import StoredItem

_NEAR = 0.3  # [m] end of a climb, of a landing
_CACHED = 256  # homes, which are sent and compared each second


@functools.lru_cache(_CACHED)
def _geodetic(origin: Origin, point: Point) -> tuple[float, float, float]:
    return to_geodetic(origin, point)


class Navigation:
    """The body, its home and the stored items; subclasses override how an item is flown.

    Args:
        config: of the vehicle.
        items: the storage, shared with the mission server.
    """

    return_height: float  # [m] above home
    default_radius: float  # [m] WPNAV_RADIUS or NAV_ACC_RAD, unless configured

    def __init__(self, config: VehicleConfig, items: Sequence[StoredItem]) -> None:
        self.config = config
        self.items = items
        radius = config.acceptance_radius
        self.acceptance_radius = self.default_radius if radius is None else radius  # [m]
        self.body = PointMass(config)
        self.home: Point = config.position if config.home is None else config.home
        self.base = self.home  # of the local frame; where the crew is
        self.home_amsl = to_geodetic(config.origin, self.home)[2]  # [m]
        self.seq = 0  # of MISSION_CURRENT
        self.track: Track | None = None
        self.target: Point = self.body.position  # [m] of the item being flown
        self.next_point: Point | None = None  # of the next item
        self.speed = config.cruise_speed  # [m/s]
        # points of a return between two points at its height, [m] ENU
        self.rally_points: Callable[[], Sequence[Point]] = lambda: ()
        self.way_home: Callable[[Point, Point], Sequence[Point]] = lambda start, end: ()

    def begin_item(self, seq: int) -> None:
        """Copy an item out of the storage and fly that copy."""
        self.seq = seq
        item = self.items[seq]
        self.track = self.make_track(item)
        self.target = self.track.points[-1] if self.track.points else self.body.position
        after = (i for i in self.items[seq + 1:] if i.command in item_.FLOWN_TO)
        following = next(after, None)
        self.next_point = None if following is None else self.point(following)

    def execute(self, item: StoredItem) -> None:
        """Execute an item that is not flown."""
        if item.command == item_.CHANGE_SPEED:
            self.change_speed(item.p2)
        elif item.command == item_.YAW:
            self.turn_to(item.p1)

    def change_speed(self, speed: float) -> None:
        """Fly at a speed [m/s] from now on."""
        if speed > 0.0:
            self.speed = speed

    def turn_to(self, compass: float) -> None:
        """Keep a heading [deg] clockwise from north, or none where it is NaN."""
        self.body.fixed_heading = None if math.isnan(compass) else math.radians(90.0 - compass)

    def make_track(self, item: StoredItem) -> Track:
        """The track of an item from the present position."""
        if item.command == item_.RETURN:
            return self.path_home()
        if item.command == item_.DELAY:
            return Track((), self.acceptance_radius, item.p1)
        target = self.point(item)
        if item.command == item_.LAND:
            x, y, z = target[0], target[1], self.body.position[2]
            return Track(((x, y, z), (x, y, self.home[2])), _NEAR, lands=True)
        if item.command == item_.TAKEOFF:
            return self.climb(target)
        hold = math.inf if item.command == item_.LOITER_UNLIMITED else item.p1
        return Track((target,), self.radius(item), hold)

    def climb(self, target: Point) -> Track:
        """The track of NAV_TAKEOFF: straight up."""
        return self.rise_to(max(self.body.position[2], target[2]))

    def rise_to(self, height: float) -> Track:
        """The track of a take-off straight up to `height` [m] ENU."""
        x, y, _ = self.body.position
        return Track(((x, y, height),), _NEAR, takes_off=True)

    def radius(self, item: StoredItem) -> float:
        """Acceptance radius of an item [m]."""
        return self.acceptance_radius

    def point(self, item: StoredItem) -> Point:
        """Position of an item, ENU [m]; the present one where it has none."""
        base = self.home_amsl if item.frame in item_.RELATIVE_FRAMES else 0.0
        if item.x == 0 and item.y == 0:
            x, y, _ = self.body.position
            return x, y, base + item.z - self.home_amsl + self.home[2]
        return to_enu(self.config.origin, item.x * 1e-7, item.y * 1e-7, base + item.z)

    def home_item(self) -> StoredItem:
        """Home as an item: as in HOME_POSITION, and ArduPilot's seq 0."""
        latitude, longitude, altitude = _geodetic(self.config.origin, self.home)
        return StoredItem(dialect.MAV_FRAME_GLOBAL, item_.WAYPOINT, 0.0, 0.0, 0.0, 0.0,
                          round(latitude * 1e7), round(longitude * 1e7), round(altitude, 2))

    def path_home(self) -> Track:
        """The track of a return: up, over home or a nearer rally point, down."""
        x, y, z = self.body.position
        top = max(z, self.home[2] + self.return_height)
        hx, hy, _ = min((self.home, *self.rally_points()),
                        key=lambda place: math.dist(place[:2], (x, y)))
        hz = self.home[2]
        above = hx, hy, top
        return Track(((x, y, top), *self.way_home((x, y, top), above), above, (hx, hy, hz)),
                     _NEAR, lands=True)

    def descent(self, point: Point) -> Track:
        """The track of a landing: straight down."""
        return Track(((point[0], point[1], self.home[2]),), _NEAR, lands=True)
