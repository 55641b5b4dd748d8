# SPDX-License-Identifier: Apache-2.0
"""Telemetry streams of a simulated vehicle: default rates, requested rates, single requests."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.mavlink.transport.codec import Message

Maker = Callable[[], list[Message]]  # no message where its data are not known yet
_MIN_INTERVAL = 0.005  # [s]


class Streams:
    """Sends each message at its interval.

    Args:
        makers: build the messages, by message id.
        rates: default rates after boot [Hz], by message id.
    """

    def __init__(self, makers: dict[int, Maker], rates: dict[int, float]) -> None:
        self._makers = makers
        self._rates = rates
        self._interval: dict[int, float] = {}  # [s]
        self._due: dict[int, float] = {}  # [s]

    def reboot(self, now: float) -> None:
        """Reset to the default rates."""
        self._interval = {number: 1.0 / rate for number, rate in self._rates.items()}
        self._due = dict.fromkeys(self._interval, now)

    def set_interval(self, number: int, microseconds: float, now: float) -> bool:
        """SET_MESSAGE_INTERVAL: -1 stops, 0 is the default rate; False where it is unknown."""
        if number not in self._makers:
            return False
        seconds = microseconds * 1e-6
        if microseconds == 0.0 and number in self._rates:
            seconds = 1.0 / self._rates[number]
        if seconds <= 0.0:
            self._interval.pop(number, None)
            self._due.pop(number, None)
            return True
        self._interval[number], self._due[number] = max(seconds, _MIN_INTERVAL), now
        return True

    def make(self, number: int) -> list[Message]:
        """Build the messages of an id now; none where the id is unknown."""
        maker = self._makers.get(number)
        return [] if maker is None else maker()

    def step(self, now: float) -> list[Message]:
        """The messages that are due by `now` [s]."""
        out: list[Message] = []
        for number, due in self._due.items():
            if due <= now:
                while due <= now:
                    out += self._makers[number]()
                    due += self._interval[number]
                self._due[number] = due
        return out
