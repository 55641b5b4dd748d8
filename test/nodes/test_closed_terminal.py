# SPDX-License-Identifier: Apache-2.0
"""A node whose terminal is closed ends in order, not under nohup; one that hangs is ended."""
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


HANGS = """
from rclpy.node import Node
from uav_task_alloc.nodes.ros import run
class Hangs(Node):
    "Waits for ever at its end."
    def __init__(self):
        super().__init__('hangs')
        print('runs', flush=True)
    def destroy_node(self):
        while True:
            pass
run._ENDS, run._GIVES_UP = 0.1, 1
run.run(Hangs, ['hangs'])
"""


def test_a_node_that_hangs_at_its_end_says_where_and_is_ended(domain):
    process = subprocess.Popen([sys.executable, '-c', HANGS], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == 'runs\n'
        process.send_signal(signal.SIGINT)
        errors = process.communicate(timeout=60)[1]
        assert process.returncode == -signal.SIGALRM
        assert 'in destroy_node' in errors
    finally:
        process.kill()
        process.wait()
