# SPDX-License-Identifier: Apache-2.0
"""The clock of a vehicle, its time since boot: it shows a restart where it goes back."""
from __future__ import annotations

import math
from collections.abc import Callable

from uav_task_alloc.mavlink.gcs.clock_rate import ClockRate

_RESTART_STEP = 2000  # [ms] decrease of time_boot_ms that shows a restart, not a late message
CLOCK_TIME = 3.0  # [s] in which a message with the clock comes, as a rule
_MAX_DELAY = 6.0  # [s] of a late message
_CATCH_UP = 1.0  # [s] in which a link delivers what it has buffered in a silence
CLOCK_RANGE = 2**32  # [ms] after which `time_boot_ms` begins again at 0: 49.7 days
_OFF = 10_000.0  # [ms] that it may be off the forecast where it begins again


class BootClock:
    """Follows `time_boot_ms` of one vehicle; links may deliver out of order.

    Args:
        now: steady time [s], as in all methods.

    Attributes:
        boot_ms: the latest `time_boot_ms` [ms], counted on where that begins again at 0.
        rate: of the clock.
    """

    def __init__(self, now: float) -> None:
        self.boot_ms, self.rate = 0, ClockRate()
        self._older = 0  # messages in a row with an older clock
        self._at = self._older_at = now  # [s] of the latest; of the first of those in a row
        self._restarted_at, self._rate_before = -math.inf, 1.0  # [s]; of the clock until then

    def reset(self) -> None:
        """Begin again at 0, as with another vehicle."""
        self.boot_ms, self._older = 0, 0
        self.rate.reset()

    def restart(self, boot_ms: int, now: float) -> None:
        """Begin again after a restart of the vehicle, of which late messages may still come."""
        rate = self.rate.value
        self._restarted_at = now
        self._rate_before = self._rate_before if math.isnan(rate) else max(1.0, rate)
        self.reset()
        self.boot_ms, self._at = boot_ms, now

    def unwrapped(self, boot_ms: int, now: float) -> int:
        """Return the `time_boot_ms` of a message, counted on where it has begun again at 0.

        Args:
            boot_ms: as received; one that was counted on already stays.
            now: steady time of its reception [s].
        """
        rate, latest = self.rate.value, self.boot_ms
        forecast = latest + 1000.0 * (1.0 if math.isnan(rate) else rate) * (now - self._at)
        boot_ms = boot_ms % CLOCK_RANGE + latest // CLOCK_RANGE * CLOCK_RANGE
        if latest and abs(boot_ms + CLOCK_RANGE - forecast) <= _OFF + 1e-3 * (forecast - latest):
            return boot_ms + CLOCK_RANGE
        if latest >= CLOCK_RANGE and boot_ms - forecast > CLOCK_RANGE // 2:
            return boot_ms - CLOCK_RANGE  # late
        return boot_ms

    def receive(self, boot_ms: int, now: float) -> float | None:
        """Take the clock of a message.

        Two messages in a row with an older clock show a restart, as one may be late. If late
        messages may be as old as that, no message on time may follow for a while. A clock that
        has only advanced less than the silence shows a restart if it does not catch up: a link
        may deliver in order what it has buffered.

        Args:
            boot_ms: `unwrapped` time of the message.
            now: steady time of its reception [s].

        Returns:
            When the vehicle booted [s], where this message shows that it was restarted.
        """
        if self.is_of_before(boot_ms, now):
            return None
        silence = now - self._at  # a running clock advances by that
        least = self.boot_ms - _RESTART_STEP + 500.0 * silence
        if boot_ms >= least:
            self.boot_ms, self._older = max(boot_ms, self.boot_ms), 0
            self._at = now
            if boot_ms == self.boot_ms:
                self.rate.add(1e-3 * boot_ms, now)
            return None
        if self._older == 0:
            self._older_at = now
        self._older += 1
        went_back = boot_ms < self.boot_ms - _RESTART_STEP
        if self._older >= 2 and (went_back or now - self._older_at >= _CATCH_UP) and (
                boot_ms < least - 1000.0 * _MAX_DELAY or silence > _MAX_DELAY):
            rate = self.rate.value
            self.restart(boot_ms, now)
            return now - 1e-3 * boot_ms / (1.0 if math.isnan(rate) else rate)
        return None

    def forecast(self) -> Callable[[float], float] | None:
        """Return what gives `time_boot_ms` at a later steady time [s]; None: not known yet."""
        boot_ms, at, rate = self.boot_ms, self._at, self.rate.value
        if not boot_ms or math.isnan(rate):
            return None
        return lambda later: boot_ms + 1000.0 * rate * (later - at)

    def is_of_before(self, boot_ms: int, now: float) -> bool:
        """Whether a message is of before the latest restart: no clock advances that fast.

        It would make the messages after it look like those after another restart.

        Args:
            boot_ms: `unwrapped` time of the message.
            now: steady time of its reception [s].
        """
        return now - self._restarted_at < _MAX_DELAY and (
            boot_ms > self.boot_ms + _RESTART_STEP
            + 1000.0 * self._rate_before * (now - self._at))
