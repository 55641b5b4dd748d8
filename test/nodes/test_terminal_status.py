# SPDX-License-Identifier: Apache-2.0
"""What live_view prints must not stop what it receives."""
import contextlib
import os
import signal
import subprocess
from threading import Thread

import pytest
from ament_index_python.packages import get_package_prefix

from uav_task_alloc.nodes.ros import terminal_status
from uav_task_alloc.record import run_state

pytestmark = pytest.mark.ros


def test_a_pipe_that_nobody_reads_does_not_stop_the_node(monkeypatch):
    end, begin = os.pipe()
    os.set_blocking(begin, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(begin, bytes(4096))
    os.set_blocking(begin, True)
    status, run = terminal_status.TerminalStatus(), run_state.RunState()
    with os.fdopen(begin, 'w') as out:
        monkeypatch.setattr(terminal_status.sys, 'stdout', out)

        def update():
            for _ in range(2 * terminal_status._PLAIN_PERIODS):
                status.update(run, 0.0, 0.0, False)
        printing = Thread(target=update, daemon=True)
        printing.start()
        printing.join(10.0)
        hangs = printing.is_alive()
        os.read(end, 1 << 20)
        printing.join(10.0)
        status.update(run, 0.0, 0.0, True)
    assert not hangs
    assert b'0 of 0 tasks' in os.read(end, 1 << 20)
    os.close(end)


def test_an_output_on_a_full_disk_does_not_end_the_node(domain):
    program = os.path.join(get_package_prefix('uav_task_alloc'), 'lib/uav_task_alloc/live_view')
    with open('/dev/full', 'w') as out:
        view = subprocess.Popen([program, '--ros-args', '-p', 'port:=0'], stdout=out,
                                stderr=subprocess.PIPE, text=True)
    try:
        assert 'terminal: OSError: [Errno 28] No space left on device: ignored' in (
            view.stderr.readline())
        view.send_signal(signal.SIGINT)
        assert view.wait(60) == 0
    finally:
        view.kill()
        view.wait()
        view.stderr.close()
