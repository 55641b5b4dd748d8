# SPDX-License-Identifier: Apache-2.0
"""The energy of one vehicle: feeds an estimate for each of its batteries, and asks the least."""
from __future__ import annotations

import math
from dataclasses import replace

from uav_task_alloc.mavlink.gcs.energy_estimate import (
    EnergyEstimate,
    EnergyLimits,
    FlownAmount,
    NominalEnergy,
    planned_amount,
)
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.model import Point

DEVIATIONS = 0.5  # of what is left: by that much less is published than is expected
_LONGEST = 2.0  # [s] between two positions that their velocity still describes
_FASTEST = 100.0  # [m/s] a larger displacement is a jump of the position
_LEVEL = 0.5  # largest rise of level flight over its horizontal speed
_SMOOTHING = 30.0  # [s] in which a new speed counts as much as those before
_STEADY = 0.75  # share of the speed below which a UAV brakes, turns or sets out
_DESCENT = 1.5  # [m/s] WPNAV_SPEED_DN, MPC_Z_V_AUTO_DN
_STOP_ACCELERATION = 2.5  # [m/s2] WPNAV_ACCEL: the time of a stop is spent near hovering
_PERIOD = 0.5  # [s] between two published limits
_LEAST = 1.0  # [m] and [s] published where there is nothing left
_SYSTEM = -1  # number of the battery of SYS_STATUS


class VehicleEnergy:
    """Estimates range and endurance of one vehicle by what this flight used.

    Args:
        telemetry: of the vehicle; it has processed each message before.
        onboard: its mission and list.
    """

    def __init__(self, telemetry: Telemetry, onboard: OnboardMission) -> None:
        self._telemetry, self._onboard = telemetry, onboard
        self.nominal = NominalEnergy()
        self.batteries: dict[int, EnergyEstimate] = {}
        self._airborne = False
        self._last: tuple[float, Point] | None = None  # [s] vehicle clock, [m]
        self._found: EnergyLimits | None = None  # published last
        self._due = -math.inf  # [s]
        self._speed = 0.0  # [m/s] over ground in level flight; 0: unknown

    def restart(self) -> None:
        """Start over after a restart of the vehicle: its batteries may be others."""
        self._last, self._found = None, None
        self.batteries.clear()

    def receive(self, message: Message) -> None:
        """Process a message of the vehicle that is the newest of its type."""
        kind = message.get_type()
        if kind == 'GLOBAL_POSITION_INT' and self._telemetry.has_position:
            self._moved(1e-3 * message.time_boot_ms)
        elif kind == 'BATTERY_STATUS' and message.battery_remaining >= 0:
            self.batteries.pop(_SYSTEM, None)
            self._read(message.id, message.battery_remaining / 100.0)
        elif kind == 'SYS_STATUS' and message.battery_remaining >= 0 and (
                self.batteries.keys() <= {_SYSTEM}):
            self._read(_SYSTEM, message.battery_remaining / 100.0)

    def _read(self, number: int, share: float) -> None:
        known = self.batteries.get(number)
        if known is None or known.nominal != self.nominal:
            known = self.batteries[number] = EnergyEstimate(self.nominal)
        known.read(share)

    def _moved(self, clock: float) -> None:
        """Add what was flown since the last position."""
        telemetry, last = self._telemetry, self._last
        self._last = clock, telemetry.position
        if telemetry.airborne and not self._airborne:
            for each in self.batteries.values():
                each.took_off()
        if not telemetry.airborne or not self._airborne or last is None or clock <= last[0]:
            self._airborne = telemetry.airborne
            return
        seconds = clock - last[0]
        vx, vy, vz = telemetry.velocity
        if seconds > _LONGEST or not telemetry.has_velocity:
            vx, vy, vz = ((b - a) / seconds for a, b in zip(last[1], telemetry.position,
                                                            strict=True))
        speed = math.hypot(vx, vy)
        if math.hypot(speed, vz) > _FASTEST:
            vx = vy = vz = speed = 0.0
        self._note_speed(speed, vz, seconds)
        amount = FlownAmount(seconds, speed * seconds, max(0.0, vz) * seconds, vx * seconds,
                             vy * seconds)
        for each in self.batteries.values():
            each.flew(amount)

    def _note_speed(self, speed: float, rise: float, seconds: float) -> None:
        usual = self._speed or self.nominal.cruise
        if speed > max(_STEADY * usual, abs(rise) / _LEVEL):
            self._speed = usual + (speed - usual) * min(1.0, seconds / _SMOOTHING)

    @property
    def limits(self) -> EnergyLimits | None:
        """The limits of the battery that ends first; None: this flight has not shown them yet."""
        telemetry = self._telemetry
        if not self.batteries or not telemetry.has_position or not all(
                each.known for each in self.batteries.values()):
            return None
        speed = self._speed or self.nominal.cruise
        ahead, landing = self._ahead(speed)
        return min((each.limits(ahead, speed, DEVIATIONS, landing)
                    for each in self.batteries.values()), key=lambda limits: limits.range)

    def limits_now(self, now: float) -> EnergyLimits:
        """The limits as published: stated ones times the charge until the flight has shown them.

        Args:
            now: steady time [s]; they are computed twice a second.

        Returns:
            Never 0, which would mean unknown; NaN where it is unknown.
        """
        if now >= self._due:
            self._found, self._due = self.limits, now + _PERIOD
        found, nominal, battery = self._found, self.nominal, self._telemetry.battery
        if found is not None:
            return replace(found, range=max(_LEAST, found.range),
                           endurance=max(_LEAST, found.endurance))
        return EnergyLimits((nominal.full_range or math.nan) * battery,
                            (nominal.endurance or math.nan) * battery,
                            nominal.full_range or math.nan)

    def _ahead(self, speed: float) -> tuple[FlownAmount, float]:
        """The rest of the list, the way home and the landing, and the time of that [s]."""
        telemetry, onboard = self._telemetry, self._onboard
        points, hover = [telemetry.position], 0.0
        if onboard.tasks is not None:
            tasks = onboard.remaining()
            for stop in tasks.stops:
                points += [*stop.via, *stop.way]
                hover += stop.task.service_time + stop.wait + speed / _STOP_ACCELERATION
            points += tasks.tail
        home = telemetry.home or telemetry.position
        points.append(home)
        landing = max(0.0, points[-2][2] - home[2]) / _DESCENT
        return planned_amount(points, speed, hover + landing), landing
