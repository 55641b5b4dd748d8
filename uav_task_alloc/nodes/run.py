# SPDX-License-Identifier: Apache-2.0
"""Runs a node until SIGINT or SIGTERM, and stops it in good order with status 0."""
from __future__ import annotations

import signal
import sys
from collections.abc import Callable

import rclpy
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from uav_task_alloc.errors import AllocError


def run(make_node: Callable[[], Node], args: list[str] | None = None, threads: int = 1) -> None:
    """Spin `make_node()`; a bad parameter ends it with status 1 and one clear line."""
    # rclpy's own handlers invalidate the context from another thread: a callback under way then
    # raises RCLError. Here the context lives until the node is gone.
    stop: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.append(1))
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = make_node()
        executor = SingleThreadedExecutor() if threads == 1 else MultiThreadedExecutor(threads)
        executor.add_node(node)
        while not stop and not getattr(node, 'finished', False):
            executor.spin_once(timeout_sec=0.2)
        executor.shutdown()
        node.destroy_node()
    except AllocError as error:
        sys.exit(str(error))
    finally:
        rclpy.try_shutdown()
