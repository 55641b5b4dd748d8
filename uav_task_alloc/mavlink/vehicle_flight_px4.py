# SPDX-License-Identifier: Apache-2.0
"""PX4 in flight: a mission that is checked as a whole, swapped as a whole, and ends in Hold."""
from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink import vehicle_item as item_
from uav_task_alloc.mavlink.vehicle_body import Track, distance
from uav_task_alloc.mavlink.vehicle_boot import BootTimes
from uav_task_alloc.mavlink.vehicle_config import Change, Mode
from uav_task_alloc.mavlink.vehicle_flight import CRITICAL, Flight
from uav_task_alloc.mavlink.vehicle_item import StoredItem
from uav_task_alloc.mavlink.vehicle_modes import PX4_MODES, px4_mode
from uav_task_alloc.model import Point

_FARTHEST = 10_000.0  # [m] MIS_DIST_1WP and MIS_DIST_WPS
_REPEATS = 10  # times REACHED is sent again
_REPEAT_PERIOD = 1.0  # [s]


@dataclass(slots=True)
class Result:
    """What the navigator says of its last mission, take-off or landing."""

    finished: bool = False
    reached: bool = False  # an item of the mission on board


class Px4Flight(Flight):
    """Flies the item at `seq`; a swap goes to the flagged one at once."""

    modes = PX4_MODES
    custom_modes: ClassVar[dict[Mode, int]] = {
        Mode.MANUAL: px4_mode(3), Mode.TAKEOFF: px4_mode(4, 2), Mode.HOLD: px4_mode(4, 3),
        Mode.MISSION: px4_mode(4, 4), Mode.RETURN: px4_mode(4, 5), Mode.LAND: px4_mode(4, 6),
    }
    boot_states = (dialect.MAV_STATE_UNINIT, dialect.MAV_STATE_BOOT)
    boot_times = BootTimes(boot=4.0, position=20.0, settling=5.0)
    start_mode = Mode.HOLD
    return_height = 60.0
    real_radius = 10.0
    takeoff_height = 2.5

    def reboot(self, now: float) -> None:
        super().reboot(now)
        self._finished = False
        self.result = Result()
        self.feasible = not self._infeasible()  # the mission on board
        self._last_reached: int | None = None
        self._repeats = 0
        self._repeat_at = now

    def takeoff(self, height: float) -> bool:
        if not self.positioned or not self.landed:
            return False
        self.set_mode(Mode.TAKEOFF)
        self.track = self._rise_to(height)
        return True

    def _rise_to(self, height: float) -> Track:
        x, y, _ = self.body.position
        return Track(((x, y, height),), 0.3)

    def disarm(self, force: bool = False) -> bool:
        was_armed, done = self.armed, super().disarm(force)
        if was_armed and self.landed and self.mode in (Mode.RETURN, Mode.LAND):
            self.set_mode(Mode.HOLD)
        return done

    def can_fly_mission(self) -> bool:
        reason = self._infeasible()
        if reason:
            self.texts.append((CRITICAL, reason))
        return not reason

    def _infeasible(self) -> str:
        if not self.items:
            return 'Mission rejected: no valid mission'
        points = [self.home, *(self.point(i) for i in self.items
                               if i.command in item_.POSITIONAL)]
        for number, (a, b) in enumerate(pairwise(points)):
            gap = distance(a, b)
            if gap > _FARTHEST:
                what = 'First waypoint' if number == 0 else 'Distance between waypoints'
                return f'{what} too far: {gap:.0f} m, {_FARTHEST:.0f} max'
        return ''

    def enter(self, mode: Mode) -> None:
        super().enter(mode)
        if mode in (Mode.TAKEOFF, Mode.LAND, Mode.MISSION):
            self.result.finished = False
        if mode is Mode.TAKEOFF:
            self.track = self._rise_to(max(self.body.position[2],
                                           self.home[2] + self.takeoff_height))
        if mode is Mode.MISSION and self._finished:
            self.seq, self._finished = 0, False

    def start_mission(self) -> bool:
        return self.set_mode(Mode.MISSION) and self.arm()

    def set_current(self, seq: int) -> bool:
        if seq >= len(self.items):
            self.texts.append((CRITICAL, 'New mission waypoint sequence out of bounds'))
            return False
        self.seq, self._finished, self.result.finished = seq, False, False
        if self.mode is Mode.MISSION:
            self.track = None
        return True

    def changed(self, change: Change, flagged: int | None) -> None:
        if change not in (Change.SWAPPED, Change.CLEARED):
            return
        last = max(0, len(self.items) - 1)
        self.seq = min(self.seq, last) if flagged is None else flagged
        self._finished, self.result = False, Result()
        reason = self._infeasible() if self.items else ''
        self.feasible = bool(self.items) and not reason
        if reason:
            self.texts.append((CRITICAL, reason))
        if self.mode is Mode.MISSION:
            self.track = None
            if reason or not self.items:
                self.set_mode(Mode.HOLD)

    def next_item(self) -> None:
        item = self.items[self.seq]
        if item.command in (item_.CHANGE_SPEED,):
            self.do(item)
            self._advance(self.body.position)
        elif item.command == item_.RETURN:
            self.set_mode(Mode.RETURN)  # which is never told as reached
        else:
            self.begin(self.seq)

    def item_done(self) -> None:
        self._advance(self.target)

    def _advance(self, point: Point) -> None:
        self.tell_reached(self.seq, point)
        if self.seq + 1 < len(self.items):
            self.seq += 1
            return
        self._finished = self.result.finished = True
        self.note('mission_end')
        self.set_mode(Mode.HOLD)

    def _end_of(self, track: Track) -> None:
        if self.mode in (Mode.TAKEOFF, Mode.LAND):
            self.result.finished = True
        super()._end_of(track)

    def tell_reached(self, seq: int, point: Point) -> None:
        super().tell_reached(seq, point)
        self.result.reached = True
        self._last_reached, self._repeats = seq, 0
        self._repeat_at = self.now + _REPEAT_PERIOD

    def step(self, now: float) -> None:
        super().step(now)
        while (self._last_reached is not None and self._repeats < _REPEATS
               and self._repeat_at <= now):
            self.reached.append(self._last_reached)
            self._repeats += 1
            self._repeat_at += _REPEAT_PERIOD

    def make_track(self, item: StoredItem) -> Track:
        track = super().make_track(item)
        if not self.landed or not track.points or track.lands:
            return track
        x, y, z = self.body.position
        top = max(track.points[0][2], z + self.takeoff_height)
        return Track(((x, y, top), *track.points), min(track.radius, 2.0), track.hold)

    def climb(self, target: Point) -> Track:
        return Track((target,), self.acceptance_radius)  # in the air: a waypoint

    def radius(self, item: StoredItem) -> float:
        if item.command == item_.WAYPOINT and item.p2 > 0.0:
            return item.p2
        return self.acceptance_radius
