# SPDX-License-Identifier: Apache-2.0
"""ArduCopter in flight: a mission that stops, resumes and completes, and stays in AUTO."""
from __future__ import annotations

from enum import Enum
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.model import Point
from uav_task_alloc.sim import stored_item as item_
from uav_task_alloc.sim.boot import BootTimes
from uav_task_alloc.sim.config import FlightMode, StorageChange
from uav_task_alloc.sim.flight import CRITICAL, WARNING, VehicleFlight
from uav_task_alloc.sim.modes import COPTER_MODES, COPTER_NOT_ARMABLE
from uav_task_alloc.sim.stored_item import StoredItem

_GUIDED = {dialect.COPTER_MODE_GUIDED, dialect.COPTER_MODE_GUIDED_NOGPS}
# commands on the way whose end ArduCopter reports; AP_Mission carries out the others itself
_REPORTED = {item_.CHANGE_SPEED, item_.YAW, item_.ROI, dialect.MAV_CMD_DO_SET_ROI_NONE,
             dialect.MAV_CMD_DO_MOUNT_CONTROL}
_SINKS: Point = (0.0, 0.0, -2.5)  # [m/s] ENU: PILOT_SPEED_UP, which is that down by default
_OVERRIDE_TIME = 3.0  # [s]: RC_OVERRIDE_TIME, its default
_FIRST_PREARM, _PREARM_PERIOD = 15.0, 30.0  # [s] after power-up; between texts


class MissionRunState(Enum):
    """State of the mission."""

    NOT_STARTED = 'not started'
    ACTIVE = 'active'
    STOPPED = 'stopped'
    COMPLETE = 'complete'


# of MISSION_CURRENT: a stopped mission is reported as one that has not started
_REPORTED_STATES = {
    MissionRunState.NOT_STARTED: dialect.MISSION_STATE_NOT_STARTED,
    MissionRunState.ACTIVE: dialect.MISSION_STATE_ACTIVE,
    MissionRunState.STOPPED: dialect.MISSION_STATE_NOT_STARTED,
    MissionRunState.COMPLETE: dialect.MISSION_STATE_COMPLETE,
}


class ArduPilotFlight(VehicleFlight):
    """Flies from seq 1 on; the current item is a copy, which a changed storage restarts."""

    modes = COPTER_MODES
    custom_modes: ClassVar[dict[FlightMode, int]] = {
        FlightMode.MANUAL: dialect.COPTER_MODE_STABILIZE,
        FlightMode.MISSION: dialect.COPTER_MODE_AUTO,
        FlightMode.GUIDED: dialect.COPTER_MODE_GUIDED,
        FlightMode.HOLD: dialect.COPTER_MODE_LOITER,
        FlightMode.RETURN: dialect.COPTER_MODE_RTL,
        FlightMode.LAND: dialect.COPTER_MODE_LAND,
        FlightMode.BRAKE: dialect.COPTER_MODE_BRAKE,
    }
    boot_states = (dialect.MAV_STATE_BOOT, dialect.MAV_STATE_CALIBRATING)
    boot_times = BootTimes(boot=8.0, position=41.0, settling=0.0)
    start_mode = FlightMode.MANUAL
    return_height = 15.0
    default_radius = 2.0
    takeoff_height = 10.0

    def reboot(self, now: float) -> None:
        super().reboot(now)
        self.run = MissionRunState.NOT_STARTED
        self._upcoming = 1  # seq where the search for the next flown item begins
        self._waiting: list[int] = []  # commands still to be carried out on this leg
        self._prearm_at = now + _FIRST_PREARM
        self._overridden_until = now  # [s] sticks by messages of a station

    @property
    def mission_state(self) -> int:
        """MISSION_STATE of the stored mission."""
        return int(_REPORTED_STATES[self.run])

    def arm(self, force: bool = False) -> bool:
        was_armed, armed = self.armed, super().arm(force)
        if armed and not was_armed and self.landed:  # AP_Arming_Copter: home is where it arms
            x, y, _ = self.body.position
            self.home = x, y, self.home[2]
        return armed

    def arming_refusal(self) -> str:
        mode, number = self.modes[self.custom_mode], self.custom_mode
        armable = number in _GUIDED or (mode.stick and number not in COPTER_NOT_ARMABLE)
        return super().arming_refusal() if armable else f'{mode.name} mode not armable'

    def report_refusal(self, reason: str) -> None:
        self.texts.append((CRITICAL, f'Arm: {reason}'))

    def step(self, now: float) -> None:
        super().step(now)
        if now < self._prearm_at:
            return
        self._prearm_at = now + _PREARM_PERIOD
        reason = '' if self.armed else self.prearm_refusal()
        if reason:
            self.texts.append((CRITICAL, f'PreArm: {reason}'))

    def override_sticks(self) -> None:
        self._overridden_until = self.now + _OVERRIDE_TIME

    def stick_velocity(self) -> Point | None:
        has_radio = self.has_radio or self.now < self._overridden_until
        return self.stick if has_radio else _SINKS  # the throttle of no radio is the lowest

    def _stop_motors(self) -> None:
        was_armed = self.armed
        super()._stop_motors()
        if was_armed:
            self._reset_mission()

    def _reset_mission(self) -> None:
        """Go back to the start of the mission; one that is active in AUTO begins again."""
        self.track, self._upcoming, self._waiting = None, 1, []
        begins = self.mode is FlightMode.MISSION and self.run is MissionRunState.ACTIVE
        self.seq = (self._flown_from(1) if begins else None) or 0

    def takeoff(self, height: float) -> bool:
        if self.mode is not FlightMode.GUIDED or not self.armed or not self.landed:
            return False
        if height <= self.body.position[2]:
            return False
        self.track = self.rise_to(height)
        return True

    def can_fly_mission(self) -> bool:
        if len(self.items) < 2:
            self.texts.append((WARNING, 'Mode change to AUTO failed: no mission'))
            return False
        if self.armed and self.landed and self._first_flown() != item_.TAKEOFF:
            self.texts.append((CRITICAL, 'Auto: Missing Takeoff Cmd'))
            return False
        return True

    def _first_flown(self) -> int | None:
        """Command that it would fly next: of the current item, or after a reset of the first."""
        return next((i.command for i in self.items[max(self.seq, 1):]
                     if i.command not in item_.AT_ONCE | {item_.DELAY}), None)

    def leave(self, mode: FlightMode) -> None:
        if mode is FlightMode.MISSION and self.run is MissionRunState.ACTIVE:
            self.run = MissionRunState.STOPPED
            if self.track is not None:
                self._upcoming = self.seq  # what was interrupted is flown again

    def enter(self, mode: FlightMode) -> None:
        super().enter(mode)
        if mode is FlightMode.MISSION:
            self._resume()

    def start_mission(self) -> bool:
        if not self.set_mode(FlightMode.MISSION):
            return False
        if self.run is not MissionRunState.ACTIVE:
            self._resume()
        return True

    def _resume(self) -> None:
        begun = self.run in (MissionRunState.ACTIVE, MissionRunState.STOPPED)
        if not begun or self.seq >= len(self.items):  # complete, or its item is not stored
            self._upcoming = 1
        self.run = MissionRunState.ACTIVE

    def set_current(self, seq: int) -> bool:
        if len(self.items) < 2 or seq >= len(self.items):
            return False
        upcoming = max(seq, 1)
        flown = self._flown_from(upcoming)
        if flown is None:
            return False
        self.seq, self._upcoming, self._waiting = flown, upcoming, []
        if self.mode is FlightMode.MISSION:
            self.track = None
        if self.run is not MissionRunState.ACTIVE:
            self.run = MissionRunState.STOPPED
        return True

    def _flown_from(self, seq: int) -> int | None:
        return next((i for i in range(seq, len(self.items))
                     if self.items[i].command not in item_.AT_ONCE), None)

    def storage_changed(self, change: StorageChange, flagged: int | None) -> None:
        if change is StorageChange.CLEARED:
            self.seq, self._upcoming, self.run = 0, 1, MissionRunState.NOT_STARTED
        if (
            change is StorageChange.WRITTEN
            and self.mode is FlightMode.MISSION
            and self.track is not None
        ):
            self._restart()

    def _restart(self) -> None:
        if self.seq < len(self.items):
            self.begin_item(self.seq)
            self.texts.append((CRITICAL, 'Auto mission changed, restarted command'))
        else:  # it flies on to where the old item was
            self.texts.append((CRITICAL, 'Auto mission changed but failed to restart command'))

    def next_item(self) -> None:
        if self.run is not MissionRunState.ACTIVE:
            return
        flown = self._flown_from(self._upcoming)
        if self._waiting:  # not begun when the point after them was reached
            self._waiting.clear()
        commands = [*range(self._upcoming, len(self.items) if flown is None else flown)]
        if flown is None:
            commands = commands[:1]
        self.body.fixed_heading = None  # each waypoint begins with the default
        if commands:  # the first one at once, one of the others in each cycle from then on
            self._carry_out(commands[0])
        if flown is None:
            self.run = MissionRunState.COMPLETE
            self.truth.note('mission_end')
            return
        self._upcoming = flown + 1
        self.begin_item(flown)
        self._waiting = commands[1:]

    def _carry_out(self, seq: int) -> None:
        self.execute(self.items[seq])
        if self.items[seq].command in _REPORTED:
            self.report_reached(seq, self.body.position)

    def _follow(self, dt: float) -> None:
        if self._waiting and self.mode is FlightMode.MISSION and self._waiting[0] < len(
                self.items):
            self._carry_out(self._waiting.pop(0))
        super()._follow(dt)

    def begin_item(self, seq: int) -> None:
        self._landing = self.items[seq].command == item_.LAND
        super().begin_item(seq)

    def item_done(self) -> None:
        if self._landing:  # it disarms before REACHED would be sent
            return
        self.report_reached(self.seq, self.target)
        self._upcoming = self.seq + 1
        self.next_item()

    def radius(self, item: StoredItem) -> float:
        return self.acceptance_radius  # WPNAV_RADIUS; param2 is ignored
