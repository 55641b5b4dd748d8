# SPDX-License-Identifier: Apache-2.0
"""When a simulated vehicle sends which telemetry message: unasked, at a rate, on request."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.mavlink.transport.codec import Message

Maker = Callable[[], list[Message]]  # none where there is nothing to tell yet
_FASTEST = 0.005  # [s] no stream is faster


class Streams:
    """Sends each message at its interval; `rates` [Hz] by message id are those of the start."""

    def __init__(self, makers: dict[int, Maker], rates: dict[int, float]) -> None:
        self._makers = makers
        self._rates = rates
        self._interval: dict[int, float] = {}  # [s]
        self._due: dict[int, float] = {}  # [s]

    def reboot(self, now: float) -> None:
        """Back to the rates of the start."""
        self._interval = {number: 1.0 / rate for number, rate in self._rates.items()}
        self._due = dict.fromkeys(self._interval, now)

    def set_interval(self, number: int, microseconds: float, now: float) -> bool:
        """SET_MESSAGE_INTERVAL: -1 stops, 0 is the rate of the start; False where unknown."""
        if number not in self._makers:
            return False
        seconds = microseconds * 1e-6
        if microseconds == 0.0 and number in self._rates:
            seconds = 1.0 / self._rates[number]
        if seconds <= 0.0:
            self._interval.pop(number, None)
            self._due.pop(number, None)
            return True
        self._interval[number], self._due[number] = max(seconds, _FASTEST), now
        return True

    def make(self, number: int) -> list[Message]:
        """The messages as they would be now; none where it is unknown."""
        maker = self._makers.get(number)
        return [] if maker is None else maker()

    def step(self, now: float) -> list[Message]:
        """What is due by now [s]."""
        out: list[Message] = []
        for number, due in self._due.items():
            while due <= now:
                out += self._makers[number]()
                due += self._interval[number]
            self._due[number] = due
        return out
