# SPDX-License-Identifier: Apache-2.0
"""Subscribes to a topic and drains all queued messages per executor wake-up.

rclpy takes one message per wake-up, and a wake-up costs more than a small message.
"""
from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

_Message = TypeVar('_Message')
_BATCH_TIME = 0.005  # [s] of one topic before the callbacks of the others run


def subscribe_batched(node: Node, msg_type: type[_Message], topic: str,
                      callback: Callable[[_Message], object],
                      qos: QoSProfile) -> Subscription[_Message]:
    """Call `callback` with every message of a topic, in order, up to 5 ms per wake-up.

    Args:
        node: which subscribes.
        msg_type: the message class.
        topic: its name, relative to the node's namespace.
        callback: called once for each message.
        qos: its depth is the longest batch.

    Returns:
        The subscription, for `node.destroy_subscription`.
    """
    def on_message(message: _Message) -> None:
        end = time.monotonic() + _BATCH_TIME
        callback(message)
        while time.monotonic() < end:
            with subscription.handle:
                queued = subscription.handle.take_message(subscription.msg_type, False)
            if queued is None:
                return
            callback(queued[0])

    subscription = node.create_subscription(msg_type, topic, on_message, qos)
    return subscription
