# SPDX-License-Identifier: Apache-2.0
"""Real nodes as processes, a DDS domain for each session, and a probe node to test them with."""
import os
import signal
import subprocess
import time

import domain_coordinator
import pytest
import rclpy
from ament_index_python.packages import get_package_prefix
from ends_with_parent import end_with_parent
from node_server import Forked, NodeServer

from uav_task_alloc.nodes.ros.node_executor import NodeExecutor

PACKAGE = 'uav_task_alloc'
PATIENCE, LONGEST = 4.0, 240.0  # times each limit, up to [s]: a machine may be slow and loaded


def patient(limit):
    """How long to wait [s] for what takes less than `limit` [s] on a machine of its own."""
    return max(limit, min(PATIENCE * limit, LONGEST))


@pytest.fixture(scope='session', autouse=True)
def domain():
    """A domain that no other session on this machine uses, also under pytest-xdist."""
    with domain_coordinator.domain_id() as number:
        os.environ['ROS_DOMAIN_ID'] = str(number)
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        # otherwise a late process may be discovered only after 3 s
        os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'] = os.path.join(
            os.path.dirname(__file__), 'quick_discovery.xml')
        yield number


@pytest.fixture(scope='session')
def server(domain):
    """Starts nodes for little CPU."""
    server = NodeServer()
    yield server
    server.close()


class Process:
    """A node, started with ROS arguments; its output goes to a file.

    Without a server it is the installed executable.
    """

    def __init__(self, log, server, executable, *ros_args, env=None):
        assert not (server and env)  # a fork has read its own
        path = os.path.join(get_package_prefix(PACKAGE), 'lib', PACKAGE, executable)
        self.log = log
        command = [path, '--ros-args', *ros_args]
        with open(log, 'w') as out:
            self.popen = (Forked(server, command, log) if server else subprocess.Popen(
                command, stdout=out, stderr=subprocess.STDOUT, preexec_fn=end_with_parent,
                env={**os.environ, **(env or {})}))

    def output(self):
        return self.log.read_text()

    def stop(self, sig=signal.SIGINT, timeout=15):
        if self.popen.poll() is None:
            self.popen.send_signal(sig)
        self.popen.wait(patient(timeout))
        return self.popen.returncode, self.output()


@pytest.fixture
def start(server, tmp_path):
    """start('allocator', '-p', 'seed:=1') -> Process; processes still running are ended."""
    yield from starts(server, tmp_path)


@pytest.fixture
def execute(domain, tmp_path):
    """As `start`, of the installed executables; these may have variables `env`."""
    yield from starts(None, tmp_path)


def starts(server, folder):
    """A function that starts processes, which are ended after it."""
    started = []

    def start(executable, *ros_args, env=None):
        log = folder / f'{len(started)}_{executable}.log'
        started.append(Process(log, server, executable, *ros_args, env=env))
        return started[-1]

    yield start
    for process in started:  # a killed process leaves shared memory that delays the next
        if process.popen.poll() is None:
            process.popen.terminate()
    for process in started:
        try:
            process.popen.wait(5.0)
        except subprocess.TimeoutExpired:
            process.popen.kill()
            process.popen.wait()


class Probe:
    """A node of the test, in a context of its own."""

    def __init__(self, name='probe', **kwargs):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node(name, context=self.context, **kwargs)
        self.executor = NodeExecutor(context=self.context)
        self.executor.add_node(self.node)

    def until(self, condition, timeout=60.0, facts=lambda: ''):
        """Spin until condition(); fail after `timeout` [s] of patience; show facts()."""
        end = time.monotonic() + patient(timeout)
        while not condition():
            if time.monotonic() > end:
                raise AssertionError(f'timed out {facts()}')
            self.executor.spin_once(timeout_sec=0.05)

    def collect(self, kind, topic, qos):
        """A list that fills with the messages of a topic."""
        messages = []
        self.node.create_subscription(kind, topic, messages.append, qos)
        return messages

    def publisher(self, kind, topic, qos):
        """A publisher that has a subscriber."""
        publisher = self.node.create_publisher(kind, topic, qos)
        self.until(lambda: publisher.get_subscription_count() > 0)
        return publisher

    def call(self, kind, name, request, timeout=20.0):
        client = self.node.create_client(kind, name)
        self.until(client.service_is_ready, timeout)
        # a server just discovered may not know this client yet: its response is lost
        futures = [client.call_async(request)]
        again = time.monotonic() + 5.0

        def answered():
            nonlocal again
            if time.monotonic() > again:
                again += 5.0
                futures.append(client.call_async(request))
            return any(future.done() for future in futures)

        self.until(answered, max(timeout, 30.0))
        future = next(future for future in futures if future.done())
        self.node.destroy_client(client)
        return future.result()

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def probe(domain):
    probe = Probe()
    yield probe
    probe.close()
