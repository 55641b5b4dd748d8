# SPDX-License-Identifier: Apache-2.0
"""The caller of a log line is found as rclpy finds it, but without reading any source."""
import inspect
import signal
import subprocess
import sys

import pytest
from rclpy.impl import rcutils_logger
from rclpy.logging import LoggingSeverity

from uav_task_alloc.nodes.ros.log_callers import name_callers_by_frames

pytestmark = pytest.mark.ros


@pytest.fixture
def unchanged(monkeypatch):
    """rclpy as it is installed, during the test; and after it as before."""
    monkeypatch.setattr(rcutils_logger, 'inspect', inspect)


def caller():
    return rcutils_logger.CallerId()


def test_the_caller_of_a_line_is_the_same(unchanged):
    found = []
    for change in (lambda: None, name_callers_by_frames):
        change()
        found.append(caller())
    assert found[0] == found[1]
    assert found[0].function_name == 'caller'
    assert found[0].file_path == __file__


def test_no_source_is_read_for_a_line(unchanged, monkeypatch):
    def refuse(*_):
        raise AssertionError('the sources of modules are searched')
    name_callers_by_frames()
    for name in ('getmodule', 'findsource'):
        monkeypatch.setattr(inspect, name, refuse)
    logger = rcutils_logger.RcutilsLogger('test_log_callers')
    logger.set_level(LoggingSeverity.INFO)  # whatever level this process has
    assert logger.info('a line')


def test_a_node_logs_its_start_without_reading_sources(domain):
    code = """import inspect
inspect.findsource = None  # raises where it is called
from uav_task_alloc.nodes.mavlink_bridge import main
main()"""
    with subprocess.Popen([sys.executable, '-c', code], stderr=subprocess.PIPE,
                          text=True) as node:
        first = node.stderr.readline()
        node.send_signal(signal.SIGINT)
        _, rest = node.communicate()
    assert '[mavlink_bridge]' in first
    assert 'Traceback' not in rest
    assert node.returncode == 0


def test_another_rclpy_is_left_as_it_is(monkeypatch):
    monkeypatch.delattr(rcutils_logger, 'inspect')
    name_callers_by_frames()
    assert not hasattr(rcutils_logger, 'inspect')
