# SPDX-License-Identifier: Apache-2.0
"""Progress of long runs on stderr: the line of a solve that Ctrl-C ends, and plain log lines."""
from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from types import FrameType, TracebackType
from typing import TextIO

from uav_task_alloc.cli.interrupt import handled_by

_SHOWN_AFTER = 1.0  # [s] of solving before the line appears
_PERIOD = 0.2  # [s] between two updates of the line
WIPE = '\r\x1b[K'  # carriage return, erase to the end of the line


def log_line(text: str) -> None:
    """Print one line to stderr and flush it."""
    print(text, file=sys.stderr, flush=True)


class SolveProgress:
    """The callbacks `stop` and `on_iteration` of `plan`, used as a context manager.

    Within `with`, the first Ctrl-C makes `stop` return True, the second raises KeyboardInterrupt.

    Args:
        budget: [s] of solving, for the time left.
        stream: where the line is shown; nothing is shown where it is no terminal.
        clock: [s], monotonic.
    """

    def __init__(self, budget: float, stream: TextIO, clock: Callable[[], float]) -> None:
        self.interrupted = False
        self._budget, self._stream, self._clock = budget, stream, clock
        self._is_terminal = stream.isatty()
        self._started = -1.0  # [s] when `stop` was first called: after the kernels were loaded
        self._shown_at = -1.0  # [s]
        self._best: tuple[float, float] | None = None  # fit, and when it was found [s]
        self._handled = handled_by(self._on_sigint)

    def __enter__(self) -> SolveProgress:
        self._handled.__enter__()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self._handled.__exit__(kind, error, trace)
        if self._shown_at >= 0.0:
            self._write(WIPE)

    def on_iteration(self, iterations: int, fit: float) -> None:
        """Record the fit of the best plan after so many iterations."""
        if self._best is None or fit != self._best[0]:  # of a better plan it may be worse
            self._best = fit, self._clock()

    def stop(self) -> bool:
        """Whether Ctrl-C was pressed. The solver polls this, which also updates the line."""
        now = self._clock()
        if self._started < 0.0:
            self._started = now
        elapsed = now - self._started
        if self._is_terminal and elapsed > _SHOWN_AFTER and now - self._shown_at >= _PERIOD:
            self._shown_at = now
            self._write(WIPE + self._line(now))
        return self.interrupted

    def _line(self, now: float) -> str:
        elapsed = now - self._started
        text = f'solving: {elapsed:.0f} s, {max(0.0, self._budget - elapsed):.0f} s left'
        if self._best is not None:
            text += f'; fit {self._best[0]:.4g}, improved {now - self._best[1]:.0f} s ago'
        return text + '; Ctrl-C stops and keeps it'

    def _on_sigint(self, number: int, frame: FrameType | None) -> None:
        if self.interrupted:
            raise KeyboardInterrupt
        self.interrupted = True
        if self._is_terminal:  # past the stream, as the signal may have interrupted a write to it
            with suppress(OSError):
                os.write(self._stream.fileno(),
                         f'{WIPE}stopping; Ctrl-C again discards the plan\n'.encode())

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()
