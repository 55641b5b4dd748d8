# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C while a command loads or compiles: the process ends at once, with one line."""
from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn

INTERRUPTED = 130  # exit status of a shell after Ctrl-C
_NO_SIGNAL = 0  # in the pipe


@contextmanager
def prompt_interrupt() -> Iterator[None]:
    """Within `with`, Ctrl-C ends the process with status 130, also amid compiled code.

    Python would handle SIGINT only when the code of a library returns, seconds later for LLVM's,
    and many libraries turn a KeyboardInterrupt of their import into another error. So a thread
    reads the signals from a pipe that the C handler writes to, and ends the process.

    A command that has something to save replaces the handler of SIGINT meanwhile, as
    `SolveProgress` and `resumable` do. Where SIGINT is ignored or the caller handles it,
    and in other threads than the main one, this does nothing.
    """
    before = signal.getsignal(signal.SIGINT)
    if (threading.current_thread() is not threading.main_thread()
            or before not in (signal.default_int_handler, signal.SIG_DFL)):
        yield
        return
    prompt = _Prompt()
    descriptor = signal.set_wakeup_fd(prompt.writer, warn_on_full_buffer=False)
    signal.signal(signal.SIGINT, prompt)
    prompt.thread.start()
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        signal.set_wakeup_fd(descriptor)
        os.close(prompt.writer)  # ends the thread


@contextmanager
def handled_by(handler: Callable[[int, FrameType | None], object]) -> Iterator[None]:
    """Within `with`, a handler of SIGINT; no signal that it got ends the process afterwards.

    Args:
        handler: as for `signal.signal`.
    """
    before = signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        try:
            if isinstance(before, _Prompt):
                before.catch_up()
        finally:
            signal.signal(signal.SIGINT, before)


@contextmanager
def resumable() -> Iterator[None]:
    """Within `with`, Ctrl-C raises KeyboardInterrupt, for a command that saves its results."""
    if isinstance(signal.getsignal(signal.SIGINT), _Prompt):
        with handled_by(signal.default_int_handler):
            yield
    else:
        yield


def end_process(status: int) -> NoReturn:
    """End the process at once, with what it has printed.

    Args:
        status: of the exit.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


class _Prompt:
    """The handler of SIGINT in the main thread, while another thread ends the process."""

    def __init__(self) -> None:
        self._reader, self.writer = os.pipe()
        os.set_blocking(self.writer, False)
        self.thread = threading.Thread(target=self._run, daemon=True)
        self._caught_up = threading.Event()

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Do nothing: the thread does."""

    def catch_up(self) -> None:
        """Wait until the thread has read all signals so far.

        It may get to run late, and must not take a signal for one that came with this handler.
        """
        if self.thread.is_alive():  # not in a forked process
            self._caught_up.clear()
            os.write(self.writer, bytes([_NO_SIGNAL]))
            self._caught_up.wait()

    def _run(self) -> None:
        while received := os.read(self._reader, 1):
            if received[0] == _NO_SIGNAL:
                self._caught_up.set()
            elif received[0] == signal.SIGINT and signal.getsignal(signal.SIGINT) is self:
                with suppress(OSError):
                    os.write(2, b'interrupted\n')
                os._exit(INTERRUPTED)
        os.close(self._reader)
