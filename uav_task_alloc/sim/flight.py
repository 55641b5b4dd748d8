# SPDX-License-Identifier: Apache-2.0
"""Flight of a simulated autopilot: modes, arming, and the mission read from its storage."""
from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.model import Point
from uav_task_alloc.sim import stored_item as item_
from uav_task_alloc.sim.boot import Boot, BootTimes
from uav_task_alloc.sim.config import FlightMode, StorageChange, VehicleConfig
from uav_task_alloc.sim.dynamics import Track
from uav_task_alloc.sim.modes import CustomMode
from uav_task_alloc.sim.navigation import Navigation
from uav_task_alloc.sim.payload import Payload
from uav_task_alloc.sim.stored_item import StoredItem
from uav_task_alloc.sim.truth_log import TruthLog

_MAX_STEP = 0.1  # [s] of the body
_MAX_STRIDE = 1.0  # [m] of the body in one step: well inside the acceptance radius
_GROUND_IDLE = 10.0  # [s] armed on the ground until it disarms itself
_FALL = 1.5  # [s] from any height to the ground, motors off
CRITICAL = dialect.MAV_SEVERITY_CRITICAL
WARNING = dialect.MAV_SEVERITY_WARNING
INFO = dialect.MAV_SEVERITY_INFO


class VehicleFlight(Navigation):
    """Behaviour of both autopilots; subclasses handle a changed mission and its end.

    The owner sends and clears `reached` and `texts`; `truth` is the ground truth.

    Args:
        config: of the vehicle.
        items: mission storage, shared with the mission server.

    Arguments of methods:
        now: [s].
        seq: of an item.
        mode: FlightMode; of `note`: a custom_mode.
        height: [m] ENU.
        point: target of the item [m] ENU.
        force: as of MAV_CMD_COMPONENT_ARM_DISARM.
        reason: text of the autopilot.
    """

    modes: ClassVar[dict[int, CustomMode]]  # by custom_mode
    custom_modes: ClassVar[dict[FlightMode, int]]  # the custom_mode that `set_mode` enters
    boot_states: ClassVar[tuple[int, int]]  # MAV_STATE in the two halves of the boot
    boot_times: ClassVar[BootTimes]
    start_mode: ClassVar[FlightMode]
    takeoff_height: float  # [m] above the ground where no height is given

    def __init__(self, config: VehicleConfig, items: Sequence[StoredItem]) -> None:
        super().__init__(config, items)
        self.boot = Boot(config, self.boot_times)
        self.reached: list[int] = []
        self.texts: list[tuple[int, str]] = []
        self.truth = TruthLog(lambda: (self.now, self.body.position))
        self.payload = Payload(lambda name, text: self.truth.note(name, command=text))
        self.arming_fault = ''  # an injected reason to refuse arming; '': none
        self.terminated = False  # the kill switch is on
        self.stick: Point | None = None  # [m/s] ENU commanded by the pilot
        self.has_radio = False  # the pilot has a radio control on
        self.now = 0.0  # [s]
        self.custom_mode = self.custom_modes[self.start_mode]
        self.armed, self.landed = False, True
        self.reboot(0.0)

    def reboot(self, now: float) -> None:
        """Reset to power-up: disarmed, at the start of the mission; in the air it falls."""
        self.now = self.booted = now
        self.boot.elapsed = 0.0
        self.truth.note('reboot')
        self.payload.reset()
        self.body.fixed_heading = None
        self._set_number(self.custom_modes[self.start_mode])
        self.failsafes: dict[str, None] = {}  # the kinds that are active, oldest first
        self.seq = 0
        self.speed = self.config.cruise_speed  # [m/s]
        self.track, self.next_point = None, None
        self.target = self.body.position
        self._idle_since = now
        self._fall_speed = 0.0  # [m/s]
        if self.landed:
            self.body.land_at(self.body.position[2])
        self._stop_motors()

    @property
    def mode(self) -> FlightMode:
        """The flight mode of the custom mode."""
        return self.modes[self.custom_mode].mode

    @property
    def positioned(self) -> bool:
        """Whether there is a position estimate, without which it does not arm."""
        return self.boot.positioned

    # commands

    def arm(self, force: bool = False) -> bool:
        """Arm; False where it is refused, with the autopilot's report of the reason."""
        refusal = self._never_arms() if force else self.arming_refusal()
        if refusal:
            self.report_refusal(refusal)
            return False
        if not self.armed:
            self.armed, self._idle_since = True, self.now
            self.truth.note('armed', cause=self.truth.cause)
        return True

    def _never_arms(self) -> str:
        """Reason not to arm even when forced; '' where there is none."""
        if self.boot.booting:
            return 'System not initialised'
        if self.terminated:
            return 'Motors Emergency Stopped'
        return 'Leaning' if self._fall_speed > 0.0 else ''

    def prearm_refusal(self) -> str:
        """Reason not to arm in any mode; '' where there is none."""
        reason = self._never_arms() or self.arming_fault
        if reason:
            return reason
        if not self.positioned:
            return 'Need Position Estimate'
        return 'Battery low' if self.body.battery < 0.05 else ''

    def arming_refusal(self) -> str:
        """Reason not to arm now; '' where there is none."""
        return self.prearm_refusal()

    def report_refusal(self, reason: str) -> None:
        """Send the reason why it does not arm."""

    def disarm(self, force: bool = False) -> bool:
        """Disarm; refused in the air unless forced: then it falls."""
        if not self.landed and not force:
            return False
        self._stop_motors()
        return True

    def _stop_motors(self) -> None:
        if self.armed:
            self.armed = False
            self.truth.note('disarmed', cause=self.truth.cause)
        if not self.landed and self._fall_speed == 0.0:
            self.track = None
            self._fall_speed = max(1.0, (self.body.position[2] - self.home[2]) / _FALL)
            self._fall_cause = self.truth.cause

    def takeoff(self, height: float) -> bool:
        """Climb to `height` [m] ENU from the ground."""
        raise NotImplementedError

    def set_mode(self, mode: FlightMode) -> bool:
        """Change the mode; False where it is unknown or not possible now."""
        return mode in self.custom_modes and self.set_custom_mode(self.custom_modes[mode])

    def set_custom_mode(self, number: int) -> bool:
        """Change the mode; False where it is unknown or not possible now.

        Args:
            number: `custom_mode` of its autopilot.
        """
        if number not in self.modes:
            return False
        mode = self.modes[number].mode
        if mode is FlightMode.MISSION and not self.can_fly_mission():
            return False
        if number != self.custom_mode:
            self.leave(self.mode)
            self._set_number(number)
            self.track, self.next_point = None, None
            self.speed = self.config.cruise_speed
            self.body.fixed_heading = None
            self.enter(mode)
        return True

    def _set_number(self, number: int) -> None:
        if number != self.custom_mode:
            self.custom_mode = number
            self.truth.note('mode', mode=number, cause=self.truth.cause)

    def can_fly_mission(self) -> bool:
        """Whether the mission mode can be entered now; a text reports why not."""
        raise NotImplementedError

    def start_mission(self) -> bool:
        """MISSION_START."""
        raise NotImplementedError

    def set_current(self, seq: int) -> bool:
        """Fly this item next; False where there is none."""
        raise NotImplementedError

    def storage_changed(self, change: StorageChange, flagged: int | None) -> None:
        """Handle a changed mission; `flagged`: the seq that was uploaded with current=1."""
        raise NotImplementedError

    def leave(self, mode: FlightMode) -> None:
        """Called before a mode is left."""

    def enter(self, mode: FlightMode) -> None:
        """Called after a mode was entered."""
        if mode in (FlightMode.RETURN, FlightMode.LAND) and self.landed:
            self.disarm()
        elif mode is FlightMode.RETURN:
            self.track = self.path_home()
        elif mode is FlightMode.LAND:
            self.track = self.descent(self.body.position)

    # motion

    def step(self, now: float) -> None:
        """Fly until `now` [s], in steps short enough that no point is missed."""
        while self.now < now - 1e-9 and (self.armed or not self.landed):
            dt = min(_MAX_STEP, _MAX_STRIDE / self.speed, now - self.now)
            self._set_time(self.now + dt)
            if self.armed:
                self._move(dt)
            else:
                self._fall(dt)
        self._set_time(max(self.now, now))

    def _set_time(self, now: float) -> None:
        self.now = now
        self.boot.elapsed = now - self.booted

    def _fall(self, dt: float) -> None:
        self.body.fall(dt, self._fall_speed)
        if self.body.position[2] <= self.home[2]:
            self._touch_down()
            self.truth.note('crashed', cause=self._fall_cause)

    def settle_on_ground(self) -> None:
        """Put it on the ground below its position."""
        if not self.landed:
            self._touch_down()

    def _touch_down(self) -> None:
        self.body.land_at(self.home[2])
        self.landed, self._idle_since, self._fall_speed = True, self.now, 0.0

    def _move(self, dt: float) -> None:
        if self.mode is FlightMode.MISSION and self.track is None:
            self.next_item()
        stick = self.stick_velocity() if self.modes[self.custom_mode].stick else None
        if self.landed:
            climbs = stick is not None and stick[2] > 0.0
            if not climbs and (self.track is None or self.track.target is None):
                self._stay()
                return
            self.landed = False
            self.truth.note('takeoff')
        if stick is None:
            self._follow(dt)
        else:
            self._steer(dt, stick)
        self.payload.step(self.body.position, self.now)
        if self.body.battery <= 0.0 and self.mode is not FlightMode.LAND and not self.landed:
            self.texts.append((CRITICAL, 'Battery empty: landing'))
            with self.truth.caused_by('failsafe'):
                self.set_mode(FlightMode.LAND)

    def override_sticks(self) -> None:
        """Take centred sticks from a message of a station, where it does so at all."""

    def stick_velocity(self) -> Point | None:
        """Velocity [m/s] ENU in a stick mode; None: it hovers."""
        return self.stick

    def _steer(self, dt: float, velocity: Point) -> None:
        self.body.steer(dt, velocity)
        if self.body.position[2] <= self.home[2] and velocity[2] <= 0.0:
            self._touch_down()

    def _follow(self, dt: float) -> None:
        track, target, exit_speed = self.track, None, 0.0
        if track is not None:
            target = track.target
            exit_speed = min(self.speed, track.exit_speed(
                self.body.position, self.next_point, self.config.acceleration))
        self.body.step(dt, target, self.speed, exit_speed)
        if track is not None and track.finished(self.body.position, self.now):
            self._end_of(track)

    def _stay(self) -> None:
        if self.now - self._idle_since > _GROUND_IDLE:
            self.disarm()

    def _end_of(self, track: Track) -> None:
        self.track = None
        if track.lands:
            self._touch_down()
        if self.mode is FlightMode.MISSION:
            self.item_done()
        elif self.mode is FlightMode.TAKEOFF:
            self.set_mode(FlightMode.HOLD)
        if track.lands:
            self.disarm()

    # mission

    def next_item(self) -> None:
        """Begin the next item, or end the mission."""
        raise NotImplementedError

    def item_done(self) -> None:
        """The item at `seq` has been flown."""
        raise NotImplementedError

    def execute(self, item: StoredItem) -> None:
        """Execute an `item` that is not flown, or a command of the same number."""
        place = self.point(item) if item.command == item_.ROI else None
        if not self.payload.execute(item, place, self.body.position, self.now):
            super().execute(item)

    def change_speed(self, speed: float) -> None:
        super().change_speed(speed)
        self.truth.note('speed', command=f'{self.speed:g}')

    def turn_to(self, compass: float) -> None:
        super().turn_to(compass)
        self.truth.note('yaw', command=f'{compass:g}')

    def report_reached(self, seq: int, point: Point) -> None:
        """Send MISSION_ITEM_REACHED, and record it in the ground truth."""
        self.reached.append(seq)
        self.truth.note('item_reached', point=point, seq=seq)
