# SPDX-License-Identifier: Apache-2.0
"""The energy of one vehicle: feeds an estimate for each of its batteries, and asks the least."""
from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from uav_task_alloc.mavlink.gcs.battery_energy import BatteryEnergy
from uav_task_alloc.mavlink.gcs.energy_estimate import (
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
_UNKNOWN_CHARGE = 2**31 - 1  # [mAh] as some autopilots send it, others -1
_UNKNOWN_CURRENT = 2**15 - 1  # [cA] as above; also the largest that a message can hold
_LONGEST_CURRENT = 5.0  # [s] for which one value of a current counts


class VehicleEnergy:
    """Estimates range and endurance of one vehicle by what this flight used.

    Args:
        telemetry: of the vehicle; it has processed each message before.
        onboard: its mission and list.
    """

    def __init__(self, telemetry: Telemetry, onboard: OnboardMission) -> None:
        self._telemetry, self._onboard = telemetry, onboard
        self.nominal = NominalEnergy()
        self.batteries: dict[int, BatteryEnergy] = {}
        self.read_capacity: Callable[[int], float] = lambda number: math.nan  # [mAh] as it is set
        self._full: dict[int, float] = {}  # [mAh] capacities as smart batteries report them
        self._summed: dict[int, tuple[float, float]] = {}  # [mAh] by the current, and when [s]
        self._airborne = False
        self._last: tuple[float, Point] | None = None  # [s] vehicle clock, [m]
        self._found: EnergyLimits | None = None  # published last
        self._due = -math.inf  # [s]
        self._speed = 0.0  # [m/s] over ground in level flight; 0: unknown

    def restart(self) -> None:
        """Start over after a restart of the vehicle: its batteries may be others."""
        self._last, self._found = None, None
        self.batteries.clear()
        self._full.clear()
        self._summed.clear()

    def receive(self, message: Message) -> None:
        """Process a message of the vehicle that is the newest of its type."""
        kind = message.get_type()
        if kind == 'GLOBAL_POSITION_INT' and self._telemetry.has_position:
            self._moved(1e-3 * message.time_boot_ms)
        elif kind == 'BATTERY_STATUS' and message.battery_remaining >= 0:
            self.batteries.pop(_SYSTEM, None)
            self._read(message.id, message, message.current_consumed)
        elif kind == 'SYS_STATUS' and message.battery_remaining >= 0 and (
                self.batteries.keys() <= {_SYSTEM}):
            self._read(_SYSTEM, message, -1)
        elif kind == 'SMART_BATTERY_INFO' and 0 < message.capacity_full < _UNKNOWN_CHARGE:
            self._full[message.id] = float(message.capacity_full)

    def _read(self, number: int, message: Message, consumed: int) -> None:
        known, clock = self.batteries.get(number), 1e-3 * self._telemetry.boot_ms
        if known is None or known.estimate.nominal != self.nominal:
            known = self.batteries[number] = BatteryEnergy(self.nominal)
        summed = self._sum(number, message.current_battery, clock)
        used = float(consumed) if 0 <= consumed < _UNKNOWN_CHARGE else summed
        known.read(message.battery_remaining / 100.0, used,
                   self._capacity(number) if used > 0.0 else math.nan, clock)

    def _sum(self, number: int, current: int, clock: float) -> float:
        """The charge by the current [cA] since it is known [mAh]; NaN: not measured."""
        last = self._summed.pop(number, None)
        if not 0 < current < _UNKNOWN_CURRENT:
            return math.nan
        if last is None or not 0.0 <= clock - last[1] <= _LONGEST_CURRENT:
            last = 0.0, clock
        charge = last[0] + current / 360.0 * (clock - last[1])  # 1 A for 3.6 s is 1 mAh
        self._summed[number] = charge, clock
        return charge

    def _capacity(self, number: int) -> float:
        """The capacity of a battery, the least that is known [mAh]; NaN: not known."""
        number = max(0, number)
        known = [each for each in (self.read_capacity(number), self._full.get(number, math.nan))
                 if each > 0.0]
        return min(known, default=math.nan)

    @property
    def warning(self) -> str:
        """The batteries whose per cent and charge disagree; '': none."""
        return '; '.join(f'battery {max(0, number)}: {each.doubt}'
                         for number, each in self.batteries.items() if each.doubt)

    @property
    def text(self) -> str:
        """What is left in each battery, and how it is known."""
        return '; '.join(f'battery {max(0, number)}: {each.text}'
                         for number, each in self.batteries.items()) or 'none is reported'

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
            each.estimate.flew(amount)

    def _note_speed(self, speed: float, rise: float, seconds: float) -> None:
        usual = self._speed or self.nominal.cruise
        if speed > max(_STEADY * usual, abs(rise) / _LEVEL):
            self._speed = usual + (speed - usual) * min(1.0, seconds / _SMOOTHING)

    @property
    def limits(self) -> EnergyLimits | None:
        """The limits of the battery that ends first; None: this flight has not shown them yet."""
        telemetry = self._telemetry
        if not self.batteries or not telemetry.has_position or not all(
                each.estimate.known for each in self.batteries.values()):
            return None
        speed = self._speed or self.nominal.cruise
        ahead, landing = self._ahead(speed)
        return min((each.estimate.limits(ahead, speed, DEVIATIONS, landing)
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
        doubted = [each.estimate.charge for each in self.batteries.values() if each.doubt]
        battery = min([battery, *(max(0.0, charge) for charge in doubted)])
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
