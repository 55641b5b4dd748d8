# SPDX-License-Identifier: Apache-2.0
"""How far an autopilot has come since power-up: booting, without a position, settling, ready."""
from __future__ import annotations

from typing import NamedTuple

from uav_task_alloc.sim.config import VehicleConfig


class BootTimes(NamedTuple):
    """How long the real autopilot takes."""

    boot: float  # [s] until it is initialised
    position: float  # [s] from power-up to a position estimate
    settling: float  # [s] for which the first estimate jumps


class Boot:
    """The times of one vehicle; those that are not configured are at most its arming delay."""

    def __init__(self, config: VehicleConfig, real: BootTimes) -> None:
        position = real.position if config.arming_delay is None else config.arming_delay
        given, settling = config.boot_delay, config.settling_time
        boot = min(real.boot, position) if given is None else given
        self.times = BootTimes(
            boot, max(boot, position), min(real.settling, position) if settling is None
            else settling)
        self.elapsed = 0.0  # [s] since power-up

    @property
    def initialising(self) -> bool:
        """The first half of the boot: nothing is calibrated."""
        return self.elapsed < self.times.boot / 2.0

    @property
    def booting(self) -> bool:
        """Whether it still boots."""
        return self.elapsed < self.times.boot

    @property
    def positioned(self) -> bool:
        """Whether there is a position estimate."""
        return self.elapsed >= self.times.position

    @property
    def settling(self) -> bool:
        """Whether there is an estimate, but one that jumps."""
        return self.positioned and self.elapsed < self.times.position + self.times.settling
