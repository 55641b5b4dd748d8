# SPDX-License-Identifier: Apache-2.0
"""Boot phases of an autopilot: booting, without a position, settling estimate, ready."""
from __future__ import annotations

from typing import NamedTuple

from uav_task_alloc.sim.config import VehicleConfig


class BootTimes(NamedTuple):
    """Boot times of the real autopilot."""

    boot: float  # [s] until it is initialised
    position: float  # [s] from power-up to a position estimate
    settling: float  # [s] for which the first estimate jumps


class Boot:
    """Boot phase of one vehicle.

    Args:
        config: boot times; those that are None are the real ones, at most the arming delay.
        real: times of the real autopilot.
    """

    def __init__(self, config: VehicleConfig, real: BootTimes) -> None:
        position = real.position if config.arming_delay is None else config.arming_delay
        delay, settling = config.boot_delay, config.settling_time
        boot = min(real.boot, position) if delay is None else delay
        self.times = BootTimes(
            boot, max(boot, position), min(real.settling, position) if settling is None
            else settling)
        self.elapsed = 0.0  # [s] since power-up

    @property
    def initialising(self) -> bool:
        """Whether it is in the first half of the boot: nothing is calibrated."""
        return self.elapsed < self.times.boot / 2.0

    @property
    def booting(self) -> bool:
        """Whether it is booting."""
        return self.elapsed < self.times.boot

    @property
    def positioned(self) -> bool:
        """Whether there is a position estimate."""
        return self.elapsed >= self.times.position

    @property
    def settling(self) -> bool:
        """Whether there is an estimate that still jumps."""
        return self.positioned and self.elapsed < self.times.position + self.times.settling
