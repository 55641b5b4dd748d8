# SPDX-License-Identifier: Apache-2.0
"""How a simulated autopilot flies: modes, arming, and the mission as it stands in storage."""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

from uav_task_alloc.geometry.frames import to_enu, to_geodetic
from uav_task_alloc.mavlink import vehicle_item as item_
from uav_task_alloc.mavlink.vehicle_body import Body, Track
from uav_task_alloc.mavlink.vehicle_config import Change, Event, Mode, VehicleConfig
from uav_task_alloc.mavlink.vehicle_item import StoredItem
from uav_task_alloc.model import Point

_STEP = 0.1  # [s] longest step of the body
_STRIDE = 1.0  # [m] longest step of the body: well inside the acceptance radius
_GROUND_IDLE = 10.0  # [s] armed on the ground until it disarms itself
_NEAR = 0.3  # [m] end of a climb, of a landing
CRITICAL, WARNING, INFO = 2, 4, 6  # MAV_SEVERITY


class Flight:
    """What both autopilots share; subclasses decide what a mission change or its end means.

    `reached` and `texts` fill for the owner to send and empty; `events` are the ground truth.
    """

    custom_modes: ClassVar[dict[Mode, int]]
    arming_delay: float  # [s]
    return_height: float  # [m] above home
    takeoff_height: float  # [m] above the ground where no height is given

    def __init__(self, config: VehicleConfig, items: Sequence[StoredItem]) -> None:
        self.config = config
        self.items = items
        self.body = Body(config)
        self.home: Point = config.position if config.home is None else config.home
        self.home_amsl = to_geodetic(config.origin, self.home)[2]  # [m]
        self.seq = 0  # current item, as MISSION_CURRENT says
        self.reached: list[int] = []
        self.texts: list[tuple[int, str]] = []
        self.events: list[Event] = []
        self.now = 0.0  # [s]
        self.reboot(0.0)

    def reboot(self, now: float) -> None:
        """As after power-up: on the ground, disarmed, at the start of the mission."""
        self.now = self.booted = now
        self.mode = Mode.HOLD
        self.armed = False
        self.landed = True
        self.seq = 0
        self.speed = self.config.cruise_speed  # [m/s]
        self.body.land_at(self.body.position[2])
        self.track: Track | None = None
        self.target: Point = self.body.position  # [m] of the item being flown
        self._then: Point | None = None  # where the next item is
        self._idle_since = now

    @property
    def positioned(self) -> bool:
        """Whether there is a position estimate, without which it does not arm."""
        delay = self.config.arming_delay
        return self.now - self.booted >= (self.arming_delay if delay is None else delay)

    # commands

    def arm(self) -> bool:
        """False, and a text that says why, where it may not."""
        refusal = self.arming_refusal()
        if refusal:
            self.texts.append((CRITICAL, refusal))
            return False
        if not self.armed:
            self.armed, self._idle_since = True, self.now
            self.note('armed')
        return True

    def arming_refusal(self) -> str:
        """Why it does not arm; empty where it does."""
        if not self.positioned:
            return 'Arm: Need Position Estimate'
        return 'Arm: Battery low' if self.body.battery < 0.05 else ''

    def disarm(self, force: bool = False) -> bool:
        """Motors off; refused in the air."""
        if not self.landed and not force:
            return False
        if self.armed:
            self.armed = False
            self.note('disarmed')
        return True

    def takeoff(self, height: float) -> bool:
        """Climb to `height` [m] ENU from the ground."""
        raise NotImplementedError

    def set_mode(self, mode: Mode) -> bool:
        """Change the mode; False where it is unknown or not possible now."""
        if mode not in self.custom_modes or (mode is Mode.MISSION and not self.can_fly_mission()):
            return False
        if mode is not self.mode:
            self.leave(self.mode)
            self.mode, self.track, self._then = mode, None, None
            self.speed = self.config.cruise_speed
            self.enter(mode)
        return True

    def can_fly_mission(self) -> bool:
        """Whether the mission mode is open now; a text says why not."""
        raise NotImplementedError

    def start_mission(self) -> bool:
        """MISSION_START."""
        raise NotImplementedError

    def set_current(self, seq: int) -> bool:
        """Fly this item next; False where there is none."""
        raise NotImplementedError

    def changed(self, change: Change, flagged: int | None) -> None:
        """The storage has changed; `flagged`: the seq that the station marked as current."""
        raise NotImplementedError

    def leave(self, mode: Mode) -> None:
        """About to leave a mode."""

    def enter(self, mode: Mode) -> None:
        """Entered a mode."""
        if mode in (Mode.RETURN, Mode.LAND) and self.armed and self.landed:
            self.disarm()
        elif mode is Mode.RETURN:
            self.track = self.way_home()
        elif mode is Mode.LAND:
            self.track = self.descent(self.body.position)

    # motion

    def step(self, now: float) -> None:
        """Fly until `now` [s], in steps short enough to pass no point unseen."""
        if not self.armed:
            self.now = now
            return
        while self.now < now - 1e-9:
            dt = min(_STEP, _STRIDE / self.speed, now - self.now)
            self.now += dt
            self._move(dt)

    def _move(self, dt: float) -> None:
        if self.mode is Mode.MISSION and self.track is None:
            self.next_item()
        track = self.track
        if self.landed:
            if track is None or track.target is None:
                self._stay()
                return
            self.landed = False
            self.note('takeoff')
        target, exit_speed = None, 0.0
        if track is not None:
            target = track.target
            exit_speed = min(self.speed, track.exit_speed(
                self.body.position, self._then, self.config.acceleration))
        self.body.step(dt, target, self.speed, exit_speed)
        if track is not None and track.done(self.body.position, self.now):
            self._end_of(track)
        if self.body.battery <= 0.0 and self.mode is not Mode.LAND and not self.landed:
            self.texts.append((CRITICAL, 'Battery empty: landing'))
            self.set_mode(Mode.LAND)

    def _stay(self) -> None:
        if self.now - self._idle_since > _GROUND_IDLE:
            self.disarm()

    def _end_of(self, track: Track) -> None:
        self.track = None
        if track.lands:
            self.body.land_at(self.home[2])
            self.landed, self._idle_since = True, self.now
        if self.mode is Mode.MISSION:
            self.item_done()
        elif self.mode is Mode.TAKEOFF:
            self.set_mode(Mode.HOLD)
        if track.lands:
            self.disarm()

    # mission

    def next_item(self) -> None:
        """Begin the item whose turn it is, or end the mission."""
        raise NotImplementedError

    def item_done(self) -> None:
        """The item at `seq` has been flown."""
        raise NotImplementedError

    def begin(self, seq: int) -> None:
        """Copy an item out of the storage and fly it, whatever happens to the storage."""
        self.seq = seq
        item = self.items[seq]
        self.track = self.make_track(item)
        self.target = self.track.points[-1] if self.track.points else self.body.position
        after = (i for i in self.items[seq + 1:] if i.command in item_.POSITIONAL)
        following = next(after, None)
        self._then = None if following is None else self.point(following)

    def make_track(self, item: StoredItem) -> Track:
        """How an item is flown from here."""
        if item.command == item_.RETURN:
            return self.way_home()
        if item.command == item_.DELAY:
            return Track((), self.config.acceptance_radius, item.p1)
        target = self.point(item)
        if item.command == item_.LAND:
            x, y, z = target[0], target[1], self.body.position[2]
            return Track(((x, y, z), (x, y, self.home[2])), _NEAR, lands=True)
        if item.command == item_.TAKEOFF:
            return self.climb(target)
        hold = math.inf if item.command == item_.LOITER_UNLIMITED else item.p1
        return Track((target,), self.radius(item), hold)

    def climb(self, target: Point) -> Track:
        """How NAV_TAKEOFF is flown: straight up."""
        x, y, z = self.body.position
        return Track(((x, y, max(z, target[2])),), _NEAR)

    def radius(self, item: StoredItem) -> float:
        """[m] at which an item counts as reached."""
        return self.config.acceptance_radius

    def point(self, item: StoredItem) -> Point:
        """ENU of an item's place; without one it is here."""
        base = self.home_amsl if item.frame in item_.RELATIVE_FRAMES else 0.0
        if item.x == 0 and item.y == 0:
            x, y, _ = self.body.position
            return x, y, base + item.z - self.home_amsl + self.home[2]
        return to_enu(self.config.origin, item.x * 1e-7, item.y * 1e-7, base + item.z)

    def home_item(self) -> StoredItem:
        """Home as an item: what HOME_POSITION says, and ArduPilot's seq 0."""
        latitude, longitude, altitude = to_geodetic(self.config.origin, self.home)
        return StoredItem(0, item_.WAYPOINT, 0.0, 0.0, 0.0, 0.0, round(latitude * 1e7),
                          round(longitude * 1e7), round(altitude, 2))

    def do(self, item: StoredItem) -> None:
        """Carry out an item that is not flown."""
        if item.command == item_.CHANGE_SPEED and item.p2 > 0.0:
            self.speed = item.p2

    def tell_reached(self, seq: int, point: Point) -> None:
        """MISSION_ITEM_REACHED, and the ground truth of it."""
        self.reached.append(seq)
        self.events.append(Event(self.now, 'item_reached', point, seq))

    def note(self, name: str) -> None:
        """An event for the ground truth, where the vehicle is now."""
        self.events.append(Event(self.now, name, self.body.position))

    def way_home(self) -> Track:
        """Up, over home, down."""
        x, y, z = self.body.position
        top = max(z, self.home[2] + self.return_height)
        hx, hy, hz = self.home
        return Track(((x, y, top), (hx, hy, top), (hx, hy, hz)), _NEAR, lands=True)

    def descent(self, point: Point) -> Track:
        """Straight down."""
        return Track(((point[0], point[1], self.home[2]),), _NEAR, lands=True)
