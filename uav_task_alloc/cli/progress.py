# SPDX-License-Identifier: Apache-2.0
"""A long solve on a terminal: how good the best is, how long it still takes, Ctrl-C ends it."""
from __future__ import annotations

import signal
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import TextIO

_PATIENCE = 1.0  # [s] of solving before anything is shown
_PERIOD = 0.2  # [s] between two lines
WIPE = '\r\x1b[K'  # back to the start of the line, and empty it


class SolveProgress:
    """Give `plan` its `heard` and `stop`, within `with`: there the first Ctrl-C is a wish to stop.

    The second one raises KeyboardInterrupt. Nothing is shown where the stream is no terminal.
    """

    def __init__(self, budget: float, stream: TextIO, clock: Callable[[], float]) -> None:
        self.interrupted = False
        self._budget, self._stream, self._clock = budget, stream, clock
        self._shows = stream.isatty()
        self._began = self._shown_at = -1.0  # [s] on that clock; the kernels are loaded before it
        self._best: tuple[float, float] | None = None  # fit, when it was found [s]
        self._before: object = None

    def __enter__(self) -> SolveProgress:
        self._before = signal.signal(signal.SIGINT, self._wish)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        signal.signal(signal.SIGINT, self._before)  # type: ignore[arg-type]
        if self._shown_at >= 0.0:
            self._write(WIPE)

    def heard(self, iterations: int, fit: float) -> None:
        """So many iterations were made, and the best plan so far has this fit."""
        if self._best is None or fit < self._best[0]:
            self._best = fit, self._clock()

    def stop(self) -> bool:
        """Whether to answer now; asked all the time, which is what moves the line."""
        now = self._clock()
        if self._began < 0.0:
            self._began = now
        passed = now - self._began
        if self._shows and passed > _PATIENCE and now - self._shown_at >= _PERIOD:
            self._shown_at = now
            self._write(WIPE + self._line(now))
        return self.interrupted

    def _line(self, now: float) -> str:
        passed = now - self._began
        text = f'solving: {passed:.0f} s, {max(0.0, self._budget - passed):.0f} s left'
        if self._best is not None:
            text += f'; fit {self._best[0]:.4g}, better {now - self._best[1]:.0f} s ago'
        return text + '; Ctrl-C takes it'

    def _wish(self, number: int, frame: FrameType | None) -> None:
        if self.interrupted:
            raise KeyboardInterrupt
        self.interrupted = True
        if self._shows:
            self._write(f'{WIPE}stopping; Ctrl-C again gives up\n')

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()
