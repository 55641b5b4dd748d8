# SPDX-License-Identifier: Apache-2.0
"""Interventions in a simulated vehicle without MAVLink: the pilot, failsafes, satellites."""
from __future__ import annotations

from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Point
from uav_task_alloc.sim.ardupilot.flight import ArduPilotFlight
from uav_task_alloc.sim.estimate import Estimate
from uav_task_alloc.sim.flight import CRITICAL, INFO, WARNING, VehicleFlight
from uav_task_alloc.sim.modes import AVOID_ADSB

FAILSAFE_KINDS = ('radio', 'gcs', 'battery', 'ekf', 'fence')
_ALERT = dialect.MAV_SEVERITY_ALERT
_ADSB = 'adsb'  # an avoidance sets CRITICAL too


class FailsafeTexts(NamedTuple):
    """The STATUSTEXTs of one autopilot: (severity, text)."""

    begin: dict[str, tuple[tuple[int, str], ...]]  # by kind of failsafe
    cleared: dict[str, tuple[int, str]]  # where it sends one
    kill: tuple[int, str]
    kill_cleared: tuple[int, str]


_ARDUPILOT = FailsafeTexts(
    begin={
        'radio': ((WARNING, 'Radio Failsafe'),),
        'gcs': ((WARNING, 'GCS Failsafe'),),
        'battery': ((WARNING, 'Battery 1 is low 10.50V used 100 mAh'),
                    (WARNING, 'Battery Failsafe')),
        'ekf': ((CRITICAL, 'EKF variance: over thresholds'),
                (CRITICAL, 'EKF Failsafe: changed to {mode} Mode')),
        'fence': ((CRITICAL, 'Fence Breached'),),
    },
    cleared={
        'radio': (WARNING, 'Radio Failsafe Cleared'),
        'gcs': (WARNING, 'GCS Failsafe Cleared'),
        'ekf': (CRITICAL, 'EKF Failsafe Cleared'),
        'fence': (WARNING, 'Fence Failsafe Cleared'),
    },
    kill=(INFO, 'RC7: MotorEStop HIGH'), kill_cleared=(INFO, 'RC7: MotorEStop LOW'))
_ACTIVATED = (CRITICAL, 'Failsafe activated')  # PX4 sends the reason in an EVENT only
_PX4 = FailsafeTexts(
    begin={
        'radio': ((CRITICAL, 'Manual control lost'), _ACTIVATED),
        'gcs': ((INFO, 'Connection to ground station lost'), _ACTIVATED),
        'battery': (_ACTIVATED,),
        'ekf': (_ACTIVATED,),
        'fence': (_ACTIVATED,),
    },
    cleared=dict.fromkeys(FAILSAFE_KINDS, (INFO, 'Failsafe mode deactivated')),
    kill=(CRITICAL, 'Kill engaged'), kill_cleared=(INFO, 'Kill disengaged'))


class Interventions:
    """The pilot's radio control, the failsafes and the satellites of one vehicle."""

    flight: VehicleFlight
    estimate: Estimate
    _before_avoid: int | None = None  # custom_mode

    @property
    def _is_ardupilot(self) -> bool:
        return isinstance(self.flight, ArduPilotFlight)

    @property
    def _texts(self) -> FailsafeTexts:
        return _ARDUPILOT if self._is_ardupilot else _PX4

    def rc_mode(self, custom_mode: int) -> bool:
        """The pilot's mode switch; False where the autopilot does not enter that mode."""
        self.flight.has_radio = True
        with self.flight.truth.caused_by('pilot'):
            return self.flight.set_custom_mode(custom_mode)

    def rc_arm(self, armed: bool, force: bool = False) -> bool:
        """The pilot's arm switch; False where it is refused. A forced disarm in the air falls."""
        self.flight.has_radio = True
        with self.flight.truth.caused_by('pilot'):
            return self.flight.arm(force) if armed else self.flight.disarm(force)

    def rc_stick(self, velocity: Point | None) -> None:
        """The pilot's sticks command a velocity ENU [m/s] in stick modes; None: centred."""
        self.flight.has_radio, self.flight.stick = True, velocity

    def failsafe(self, kind: str, mode: int | None) -> None:
        """Begin a failsafe.

        Args:
            kind: one of FAILSAFE_KINDS.
            mode: the custom mode that it enters; None: the mode stays.

        Raises:
            InvalidValue: `kind` is unknown.
        """
        if kind not in FAILSAFE_KINDS:
            raise InvalidValue('kind', kind, f'one of {", ".join(FAILSAFE_KINDS)}')
        flight = self.flight
        flight.failsafes[kind] = None
        name = flight.modes[flight.custom_mode if mode is None else mode].name
        flight.texts += [(severity, text.format(mode=name))
                         for severity, text in self._texts.begin[kind]]
        flight.truth.note('failsafe', cause=kind, mode=mode)
        if mode is not None:
            with flight.truth.caused_by('failsafe'):
                flight.set_custom_mode(mode)

    def failsafe_over(self) -> None:
        """End all failsafes; the mode stays.

        That of the battery ends as by MAV_CMD_BATTERY_RESET where it is ArduPilot.
        """
        flight = self.flight
        for kind in [kind for kind in flight.failsafes if kind in FAILSAFE_KINDS]:
            del flight.failsafes[kind]
            if kind in self._texts.cleared:
                flight.texts.append(self._texts.cleared[kind])
            flight.truth.note('failsafe_over', cause=kind)

    def kill_switch(self) -> None:
        """The pilot stops the motors, also in the air; disarmed until `kill_switch_off`."""
        flight = self.flight
        flight.terminated = True
        flight.texts.append(self._texts.kill)
        flight.truth.note('kill_switch', cause='pilot')
        with flight.truth.caused_by('pilot'):
            flight.disarm(force=True)

    def kill_switch_off(self) -> None:
        """The pilot releases the kill switch; nothing arms automatically."""
        self.flight.terminated = False
        self.flight.texts.append(self._texts.kill_cleared)
        self.flight.truth.note('kill_switch_off', cause='pilot')

    def avoid(self, active: bool) -> None:
        """Begin or end an avoidance (ArduPilot): AVOID_ADSB, then the mode before if unchanged."""
        flight = self.flight
        if not self._is_ardupilot or active is (_ADSB in flight.failsafes):
            return
        with flight.truth.caused_by('failsafe'):
            if active:
                flight.failsafes[_ADSB] = None
                flight.texts.append((_ALERT, 'Avoid: Performing action: 4'))
                self._before_avoid = flight.custom_mode
                flight.set_custom_mode(AVOID_ADSB)
                return
            del flight.failsafes[_ADSB]
            flight.texts.append((_ALERT, 'Avoid: Resuming with action: 1'))
            if self._before_avoid is not None and flight.custom_mode == AVOID_ADSB:
                flight.set_custom_mode(self._before_avoid)

    def glitch(self, offset: Point, seconds: float) -> None:
        """Shift the reported, not the true position by `offset` [m] ENU for some `seconds`."""
        self.estimate.glitch(offset, seconds)
        self.flight.truth.note('glitch')
