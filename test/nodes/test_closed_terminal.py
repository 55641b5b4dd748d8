# SPDX-License-Identifier: Apache-2.0
"""A node whose terminal is closed ends in order; under nohup it goes on."""
import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.ros


def test_a_closed_terminal_ends_a_node_in_order_and_not_under_nohup(probe, tmp_path):
    command = [sys.executable, '-c', 'import signal, sys\n'
               'signal.signal(signal.SIGHUP, getattr(signal, sys.argv.pop()))\n'
               'from uav_task_alloc.nodes.mavlink_bridge import main\n'
               'sys.argv[1:] = ["--ros-args", "-p", "connections:=[\'udpin:127.0.0.1:0\']"]\n'
               'main()']
    for handler, ends in ('SIG_DFL', signal.SIGHUP), ('SIG_IGN', signal.SIGTERM):
        log = tmp_path / f'{ends.name}.log'
        with open(log, 'w') as out:
            process = subprocess.Popen([*command, handler], stdout=out, stderr=subprocess.STDOUT)
        try:
            probe.until(lambda log=log: 'listens on' in log.read_text())
            process.send_signal(signal.SIGHUP)
            process.send_signal(ends)
            assert process.wait(60) == 0, log.read_text()
        finally:
            process.kill()
            process.wait()
