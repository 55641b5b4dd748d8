# SPDX-License-Identifier: Apache-2.0
"""The batteries of a simulated vehicle as its autopilot reports them: per cent, charge, current.

Both count the charge used from boot. ArduPilot's per cent is counted by BATT_CAPACITY, and is not
known without a sensor of the current; PX4's follows the voltage, which is the truth here, and is
never above what BAT1_CAPACITY less the charge used leaves (`Battery::estimateStateOfCharge`).
"""
from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.sim.flight import VehicleFlight
from uav_task_alloc.sim.parameters import SimParameters

_UNKNOWN = -1
_LEAST_CAPACITY = 10.0  # [mAh]; one that is set to less is not known
_NO_SENSOR = -100  # [cA] of PX4, which sends its invalid current of -1 A


class SimBatteries:
    """The batteries of one vehicle.

    Args:
        flight: whose body drains the first one.
        parameters: with the capacities that are set.
        ardupilot: else PX4.
    """

    def __init__(self, flight: VehicleFlight, parameters: SimParameters, ardupilot: bool) -> None:
        self._flight, self._parameters, self._ardupilot = flight, parameters, ardupilot
        self._charge_at_boot = flight.body.battery

    def reboot(self) -> None:
        """Count from here."""
        self._charge_at_boot = self._flight.body.battery

    def messages(self) -> list[Message]:
        """BATTERY_STATUS of each battery."""
        return [dialect.MAVLink_battery_status_message(
            number, dialect.MAV_BATTERY_FUNCTION_ALL, dialect.MAV_BATTERY_TYPE_LIPO, 32767,
            [self.voltage(number)] + [65535] * 9, self.current(number), self._consumed(number),
            _UNKNOWN, self.percent(number)) for number in range(self._flight.config.batteries)]

    def voltage(self, number: int) -> int:
        """The voltage of a battery [mV]."""
        return round(10500 + 2100 * self._remaining(number))

    def current(self, number: int) -> int:
        """The current of a battery [cA]."""
        if not self._has_sensor(number):
            return _UNKNOWN if self._ardupilot else _NO_SENSOR
        flight = self._flight
        drain = 0.0 if flight.landed else flight.body.drain * self._share_of(number)
        return min(32767, round(360.0 * drain * flight.config.battery_capacity))

    def percent(self, number: int) -> int:
        """What remains of a battery, as the autopilot reports it [%]."""
        set_to, true = self._set_capacity(number), self._flight.config.battery_capacity
        remaining = self._remaining(number)
        counted = self._has_sensor(number) and set_to > _LEAST_CAPACITY
        if self._ardupilot:
            if not counted:
                return _UNKNOWN
            return math.floor(100.0 * max(0.0, 1.0 - (1.0 - remaining) * true / set_to) + 1e-9)
        if counted:
            remaining = min(remaining, 1.0 - self._used(number) / set_to)
        return math.floor(100.0 * max(0.0, remaining))

    def _has_sensor(self, number: int) -> bool:
        return number < self._flight.config.current_sensors

    def _set_capacity(self, number: int) -> float:
        name = 'BATT' if self._ardupilot else 'BAT'
        digit = f'{number + 1}' if number or not self._ardupilot else ''
        return self._parameters.get(f'{name}{digit}_CAPACITY')

    def _share_of(self, number: int) -> float:
        return self._flight.config.second_battery if number else 1.0

    def _remaining(self, number: int) -> float:
        return self._flight.body.battery * self._share_of(number)

    def _used(self, number: int) -> float:
        """The charge used since boot [mAh]."""
        fall = max(0.0, self._charge_at_boot - self._flight.body.battery)
        return fall * self._share_of(number) * self._flight.config.battery_capacity

    def _consumed(self, number: int) -> int:
        if self._has_sensor(number):
            return math.floor(self._used(number))
        return _UNKNOWN if self._ardupilot else 0
