# SPDX-License-Identifier: Apache-2.0
"""The executor of a node: events are handled within a second, and seldom waited for."""
import time
from contextlib import contextmanager

import pytest
import rclpy
from rclpy.event_handler import EventHandler, SubscriptionEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Empty

from uav_task_alloc.nodes.ros.node_executor import NodeExecutor

pytestmark = pytest.mark.ros


@contextmanager
def spinning():
    """A node with a timer of 50 Hz, and its executor."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node('spinning', context=context)
    executor = NodeExecutor(context=context)
    executor.add_node(node)
    node.create_timer(0.02, lambda: None)
    try:
        yield node, executor
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()


def mismatch(node, events):
    """A subscription that receives nothing of a publisher, by their QoS."""
    node.create_subscription(
        Empty, 'mismatch', print, QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE),
        event_callbacks=SubscriptionEventCallbacks(incompatible_qos=events.append))
    node.create_publisher(Empty, 'mismatch', QoSProfile(
        depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))


@pytest.mark.parametrize('timeout', [0.2, None])
def test_an_event_between_two_looks_is_handled(domain, timeout):
    events = []
    with spinning() as (node, executor):
        executor.spin_once(timeout)  # has looked just now
        mismatch(node, events)
        end = time.monotonic() + 30.0
        while not events and time.monotonic() < end:
            executor.spin_once(timeout)
    assert events[0].total_count == 1


def test_events_are_seldom_waited_for(domain, monkeypatch):
    added = []
    monkeypatch.setattr(EventHandler, 'add_to_wait_set', lambda self, _: added.append(self))
    with spinning() as (node, executor):
        node.create_subscription(Empty, 'one', print, 1)
        began = time.monotonic()
        for _ in range(200):  # 4 s
            executor.spin_once(0.2)
        looks = len(added) / len({id(each) for each in added})
        assert looks <= 2.0 * (2.0 + time.monotonic() - began)  # one may wait twice
