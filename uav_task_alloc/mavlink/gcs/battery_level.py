# SPDX-License-Identifier: Apache-2.0
"""The battery of one vehicle with least remaining, as the autopilot reports it."""
from __future__ import annotations

import math

from uav_task_alloc.mavlink.transport.codec import Message

_TIMEOUT = 10.0  # [s] without a report: the battery does not count
_RISE = 0.03  # [0..1] smallest accepted rise of a reading


class BatteryLevel:
    """What remains, by BATTERY_STATUS, or by SYS_STATUS where that is not received.

    Arguments of methods:
        message: as received.
        now: steady time [s].

    Attributes:
        remaining: [0..1]; NaN: unknown.
    """

    def __init__(self) -> None:
        self.remaining = math.nan
        self._batteries: dict[int, tuple[float, float]] = {}  # remaining 0..1 and time [s] by id

    def restart(self) -> None:
        """Forget which batteries there are; the level counts until the next report."""
        self._batteries.clear()

    def take_battery(self, message: Message, now: float) -> None:
        """Take a BATTERY_STATUS."""
        if message.battery_remaining >= 0:
            self._batteries[message.id] = message.battery_remaining / 100.0, now
            self._use_least(now)

    def take_system(self, message: Message, now: float) -> None:
        """Take a SYS_STATUS."""
        if message.battery_remaining >= 0 and not any(
                now - at < _TIMEOUT for _, at in self._batteries.values()):
            self.remaining = message.battery_remaining / 100.0

    def _use_least(self, now: float) -> None:
        """Use the battery with least remaining; a rise below _RISE is noise."""
        least = min(value for value, at in self._batteries.values() if now - at < _TIMEOUT)
        before = self.remaining
        if math.isnan(before) or least < before or least > before + _RISE:
            self.remaining = least
