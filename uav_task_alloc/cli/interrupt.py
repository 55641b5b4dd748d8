# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C while a command loads or compiles: the process ends at once, with one line."""
from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import NoReturn

INTERRUPTED = 130  # exit status of a shell after Ctrl-C


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
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    descriptor = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    signal.signal(signal.SIGINT, _leave_to_the_thread)
    threading.Thread(target=_exit_on_sigint, args=(reader,), daemon=True).start()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])  # resource/command.in blocks it
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        signal.set_wakeup_fd(descriptor)
        os.close(writer)  # ends the thread


@contextmanager
def resumable() -> Iterator[None]:
    """Within `with`, Ctrl-C raises KeyboardInterrupt, for a command that saves its results."""
    prompt = signal.getsignal(signal.SIGINT) is _leave_to_the_thread
    if prompt:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        if prompt:
            signal.signal(signal.SIGINT, _leave_to_the_thread)


def end_process(status: int) -> NoReturn:
    """End the process at once, with what it has printed.

    Args:
        status: of the exit.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


def _leave_to_the_thread(number: int, frame: object) -> None:
    """The handler of SIGINT in the main thread, while the other thread ends the process."""


def _exit_on_sigint(reader: int) -> None:
    while received := os.read(reader, 1):
        if (received[0] == signal.SIGINT
                and signal.getsignal(signal.SIGINT) is _leave_to_the_thread):
            with suppress(OSError):
                os.write(2, b'interrupted\n')
            os._exit(INTERRUPTED)
    os.close(reader)
