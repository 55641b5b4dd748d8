# SPDX-License-Identifier: Apache-2.0
"""Batteries that a crew changes at the base: the vehicle is powered off and boots again."""
from __future__ import annotations

import math

from uav_task_alloc.sim.dynamics import metres_between
from uav_task_alloc.sim.flight import VehicleFlight

_AT_HOME = 5.0  # [m] from home at most
_FIRST_STEP = 5.0  # [s] disarmed until the crew unplugs the battery
_SHORTEST = 5.0  # [s] without power
_FULL = 0.98  # of a battery that is not changed


class BatteryChange:
    """Decides when one vehicle is without power.

    The turnaround lasts from the landing until the vehicle can arm again, its boot included; a
    boot that takes longer prolongs it.

    Args:
        flight: of the vehicle; its configuration has the turnaround.
    """

    def __init__(self, flight: VehicleFlight) -> None:
        self._flight = flight
        self._flown = 0.0  # [m] at the last change
        self._landed_at: float | None = None  # [s] disarmed at home since, with a used battery
        self._until: float | None = None  # [s] without power

    @property
    def unpowered(self) -> bool:
        """Whether the battery is out."""
        return self._until is not None

    def cancel(self) -> None:
        """Forget a change that is going on, after the vehicle was switched on by other means."""
        self._landed_at = self._until = None

    def step(self, now: float) -> str:
        """Let time pass until `now` [s].

        Returns:
            'off' and 'on' at the moments when the power is cut and is back with a full battery,
            else ''.
        """
        if self._until is not None:
            if now < self._until:
                return ''
            self.cancel()
            self._flown = self._flight.body.flown
            return 'on'
        if not self._due():
            self._landed_at = None
            return ''
        if self._landed_at is None:
            self._landed_at = now
        if now - self._landed_at < _FIRST_STEP:
            return ''
        boot = self._flight.boot.times
        ready = self._landed_at + self._flight.config.turnaround - boot.position - boot.settling
        self._until = max(now + _SHORTEST, ready)
        return 'off'

    def _due(self) -> bool:
        flight = self._flight
        return (math.isfinite(flight.config.turnaround) and flight.landed and not flight.armed
                and flight.body.battery < _FULL and flight.body.flown > self._flown
                and metres_between(flight.body.position, flight.base) <= _AT_HOME)
