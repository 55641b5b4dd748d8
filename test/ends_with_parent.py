# SPDX-License-Identifier: Apache-2.0
"""Runs a command whose processes all end when the test that started it ends, or is killed.

`python ends_with_parent.py WORD ...`, as the leader of a session of its own: a shell that is
killed leaves the programs that it has started.
"""
import ctypes
import os
import signal
import subprocess
import sys
from contextlib import suppress

PR_SET_PDEATHSIG = 1  # of prctl(2)
_prctl = getattr(ctypes.CDLL(None), 'prctl', lambda *_: 0)  # Linux only
PATIENCE = 10.0  # [s] after SIGINT until SIGKILL


def end_with_parent(number=signal.SIGTERM):
    """Get a signal when the thread that started this process ends; also before exec."""
    _prctl(PR_SET_PDEATHSIG, int(number))


def main(words):
    """Run the command; returns its exit status."""
    parent = os.getppid()
    running = []

    def end(*_):
        os.killpg(0, signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            running[0].wait(PATIENCE)
        os.killpg(0, signal.SIGKILL)

    signal.signal(signal.SIGINT, lambda *_: None)  # it is for the command, which ends by it
    running.append(subprocess.Popen(words))
    signal.signal(signal.SIGTERM, end)
    end_with_parent()
    if os.getppid() != parent:  # it has ended before
        end()
    status = running[0].wait()
    return status if status >= 0 else 128 - status


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
