# SPDX-License-Identifier: Apache-2.0
"""PX4 in flight: a mission is checked and replaced as a whole, and ends in Hold."""
from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.model import Point
from uav_task_alloc.sim import stored_item as item_
from uav_task_alloc.sim.boot import BootTimes
from uav_task_alloc.sim.config import FlightMode, StorageChange
from uav_task_alloc.sim.dynamics import Track, metres_between
from uav_task_alloc.sim.flight import CRITICAL, VehicleFlight
from uav_task_alloc.sim.modes import PX4_MODES, Px4Auto, Px4Main, px4_auto, px4_mode
from uav_task_alloc.sim.stored_item import StoredItem

_MAX_DISTANCE = 10_000.0  # [m] MIS_DIST_1WP and MIS_DIST_WPS
_CLIMB_FROM = 0.8  # [m] NAV_MC_ALT_RAD
_KEEPS_DISARMED = (FlightMode.RETURN, FlightMode.LAND)  # modes that prevent arming
_REPEATS = 10  # repetitions of REACHED
_REPEAT_PERIOD = 1.0  # [s]


@dataclass(slots=True)
class NavigatorResult:
    """The navigator's result of the last mission, take-off or landing."""

    finished: bool = False
    reached: bool = False  # an item of the mission on board


class Px4Flight(VehicleFlight):
    """Flies the item at `seq`; a new mission begins at the flagged item at once."""

    modes = PX4_MODES
    custom_modes: ClassVar[dict[FlightMode, int]] = {
        FlightMode.MANUAL: px4_mode(Px4Main.POSCTL),
        FlightMode.TAKEOFF: px4_auto(Px4Auto.TAKEOFF),
        FlightMode.HOLD: px4_auto(Px4Auto.LOITER),
        FlightMode.MISSION: px4_auto(Px4Auto.MISSION),
        FlightMode.RETURN: px4_auto(Px4Auto.RTL),
        FlightMode.LAND: px4_auto(Px4Auto.LAND),
    }
    boot_states = (dialect.MAV_STATE_UNINIT, dialect.MAV_STATE_BOOT)
    boot_times = BootTimes(boot=4.0, position=20.0, settling=5.0)
    start_mode = FlightMode.HOLD
    return_height = 60.0
    default_radius = 10.0
    takeoff_height = 2.5

    def reboot(self, now: float) -> None:
        super().reboot(now)
        self._finished = False
        self._activated = self._disarmed = False  # the mission was flown; disarmed since
        self._climbs_first = False  # straight up, where its item is higher
        self._mode_after_disarming = self.custom_mode
        self.result = NavigatorResult()
        self.feasible = not self._infeasible()  # the mission on board
        self._last_reached: int | None = None
        self._repeats = 0
        self._repeat_at = now

    def takeoff(self, height: float) -> bool:
        if not self.positioned or not self.landed:
            return False
        self.set_mode(FlightMode.TAKEOFF)
        self.track = self.rise_to(height)
        return True

    def arm(self, force: bool = False) -> bool:
        was_armed, done = self.armed, super().arm(force)
        if done and not was_armed:
            self._disarmed = True
            if self.mode is FlightMode.MISSION:
                self._activate()
        return done

    def prearm_refusal(self) -> str:
        """Reason not to arm in its mode: that is among the checks of a PX4; '' where none."""
        if self.mode in _KEEPS_DISARMED:
            return 'Mode not suitable for arming'
        return super().prearm_refusal()

    def disarm(self, force: bool = False) -> bool:
        was_armed, done = self.armed, super().disarm(force)
        if was_armed and not self.armed:
            with self.truth.caused_by('self'):
                self._set_number(self._mode_after_disarming)
            self.track = None
        return done

    def set_custom_mode(self, number: int) -> bool:
        starts = number == self.custom_modes[FlightMode.MISSION] != self.custom_mode
        if starts and self.armed and self._finished and not self._restarts:
            self.texts.append((CRITICAL, 'No valid mission available, loitering'))
            number = self.custom_modes[FlightMode.HOLD]
        done = super().set_custom_mode(number)
        if done and self.truth.cause != 'failsafe' and self.mode not in _KEEPS_DISARMED:
            self._mode_after_disarming = number
        return done

    @property
    def _restarts(self) -> bool:
        """Whether the mission begins again, as `MissionBase::checkMissionRestart` has it."""
        return self._activated and self._disarmed and self.seq + 1 == len(self.items)

    def _activate(self) -> None:
        if self._restarts:
            self.seq, self._finished = 0, False
            self.truth.note('mission_restart', cause=self.truth.cause)
        self._activated, self._disarmed, self._climbs_first = True, False, True

    def can_fly_mission(self) -> bool:
        reason = self._infeasible()
        if reason:
            self.texts.append((CRITICAL, reason))
        return not reason

    def _infeasible(self) -> str:
        if not self.items:
            return 'Mission rejected: no valid mission'
        points = [self.home, *(self.point(i) for i in self.items
                               if i.command in item_.FLOWN_TO)]
        for number, (a, b) in enumerate(pairwise(points)):
            gap = metres_between(a, b)
            if gap > _MAX_DISTANCE:
                what = 'First waypoint' if number == 0 else 'Distance between waypoints'
                return f'{what} too far: {gap:.0f} m, {_MAX_DISTANCE:.0f} max'
        return ''

    def enter(self, mode: FlightMode) -> None:
        super().enter(mode)
        if mode in (FlightMode.TAKEOFF, FlightMode.LAND, FlightMode.MISSION):
            self.result.finished = False
        if mode is FlightMode.TAKEOFF:
            self.track = self.rise_to(max(self.body.position[2],
                                          self.home[2] + self.takeoff_height))
        if mode is FlightMode.MISSION and self.armed:
            self._activate()

    def start_mission(self) -> bool:
        return self.set_mode(FlightMode.MISSION) and self.arm()

    def set_current(self, seq: int) -> bool:
        if seq >= len(self.items):
            self.texts.append((CRITICAL, 'New mission waypoint sequence out of bounds'))
            return False
        self.seq, self._finished, self.result.finished = seq, False, False
        if self.mode is FlightMode.MISSION:
            self.track = None
        return True

    def storage_changed(self, change: StorageChange, flagged: int | None) -> None:
        if change not in (StorageChange.REPLACED, StorageChange.CLEARED):
            return
        last = max(0, len(self.items) - 1)
        self.seq = min(self.seq, last) if flagged is None else flagged
        self._finished, self.result = False, NavigatorResult()
        self._activated = self.armed and self.mode is FlightMode.MISSION
        reason = self._infeasible() if self.items else ''
        self.feasible = bool(self.items) and not reason
        if reason:
            self.texts.append((CRITICAL, reason))
        if self.mode is FlightMode.MISSION:
            self.track = None
            if reason or not self.items:
                self.set_mode(FlightMode.HOLD)

    def next_item(self) -> None:
        if self._finished:
            return  # on the ground it stays in mission mode
        item = self.items[self.seq]
        if item.command in item_.AT_ONCE:
            self.execute(item)
            self._advance(self.body.position)
        elif item.command == item_.RETURN:
            self.set_mode(FlightMode.RETURN)  # for which no REACHED is sent
        else:
            self.begin_item(self.seq)

    def leave(self, mode: FlightMode) -> None:
        if mode is FlightMode.MISSION:
            self.payload.stop_trigger()

    def change_speed(self, speed: float) -> None:
        super().change_speed(speed if speed > 0.0 else self.config.cruise_speed)

    def begin_item(self, seq: int) -> None:
        item = self.items[seq]
        if item.command == item_.WAYPOINT:
            self.turn_to(item.p4)
        super().begin_item(seq)

    def turn_to(self, compass: float) -> None:
        if not (math.isnan(compass) and self.body.fixed_heading is None):
            super().turn_to(compass)

    def item_done(self) -> None:
        self._advance(self.target)

    def _advance(self, point: Point) -> None:
        self.report_reached(self.seq, point)
        if self.seq + 1 < len(self.items):
            self.seq += 1
            return
        self._finished = self.result.finished = True
        self.truth.note('mission_end')
        if not self.landed:
            self.set_mode(FlightMode.HOLD)

    def _end_of(self, track: Track) -> None:
        if self.mode in (FlightMode.TAKEOFF, FlightMode.LAND):
            self.result.finished = True
        super()._end_of(track)

    def report_reached(self, seq: int, point: Point) -> None:
        super().report_reached(seq, point)
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
        if not track.points or track.lands:
            return track
        climbs, self._climbs_first = self._climbs_first, False
        (x, y, z), top = self.body.position, track.points[0][2]
        if self.landed:
            top = max(top, z + self.takeoff_height)
        elif not climbs or top <= z + _CLIMB_FROM:
            return track
        return Track(((x, y, top), *track.points), min(track.radius, 2.0), track.hold)

    def climb(self, target: Point) -> Track:
        return Track((target,), self.acceptance_radius)  # in the air: a waypoint

    def radius(self, item: StoredItem) -> float:
        if item.command == item_.WAYPOINT and item.p2 > 0.0:
            return item.p2
        return self.acceptance_radius
