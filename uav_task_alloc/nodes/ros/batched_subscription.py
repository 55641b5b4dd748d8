# SPDX-License-Identifier: Apache-2.0
"""Hears a topic in gulps: a round of the executor costs more than a message, and takes one."""
from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

GULP = 0.005  # [s] of one topic before the others have their turn


def subscribe_batched(node: Node, kind: type, topic: str, take: Callable[[Any], object],
         qos: QoSProfile) -> Subscription:
    """Call `take` with every message of a topic, those that wait already at once."""
    def gulp(message: Any) -> None:
        until = time.monotonic() + GULP
        take(message)
        while time.monotonic() < until:
            with subscription.handle:
                waiting = subscription.handle.take_message(subscription.msg_type, False)
            if waiting is None:
                return
            take(waiting[0])

    subscription: Subscription = node.create_subscription(kind, topic, gulp, qos)
    return subscription
