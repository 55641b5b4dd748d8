# SPDX-License-Identifier: Apache-2.0
"""Runs a node until SIGINT or SIGTERM, and stops it in good order with status 0."""
from __future__ import annotations

import json
import os
import signal
import sys
import traceback
from collections.abc import Callable

import rclpy
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from uav_task_alloc.errors import AllocError

CRASHED = 70  # exit status, EX_SOFTWARE of sysexits.h: started again by the launch files


def with_flags(argv: list[str], *names: str) -> list[str]:
    """`--record FILE` as `--ros-args -p record:=FILE`; for parameters that are text."""
    head, given = list(argv), []
    for name in names:
        while f'--{name}' in head[:-1]:
            k = head.index(f'--{name}')
            given += ['-p', f'{name}:={json.dumps(head[k + 1])}']
            del head[k:k + 2]
    return [*head, '--ros-args', *given, '--'] if given else head


def run(make_node: Callable[[], Node], args: list[str] | None = None, threads: int = 1) -> None:
    """Spin `make_node()` until SIGINT or SIGTERM, or until it has `finished`.

    A node with a method `waits_to_end` goes on while that returns True.

    Exit status: 0 in good order; 1 and one clear line where `make_node` refuses a parameter;
    CRASHED where a callback raises.
    """
    _check_arguments(remove_ros_args(args or sys.argv)[1:], make_node.__doc__)
    # rclpy's own handlers invalidate the context from another thread: a callback under way then
    # raises RCLError. Here the context lives until the node is gone.
    stop: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.append(1))
    # through shared memory a node that was killed and started again hears nothing for 3 s
    os.environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    try:
        _spin(make_node(), threads, stop)
    except AllocError as error:
        sys.exit(str(error))
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):  # a second Ctrl-C cannot hurry the end
            signal.signal(number, signal.SIG_IGN)
        rclpy.try_shutdown()


def _spin(node: Node, threads: int, stop: list[int]) -> None:
    """Until `stop` holds something; SystemExit CRASHED where a callback raises."""
    executor = SingleThreadedExecutor() if threads == 1 else MultiThreadedExecutor(threads)
    executor.add_node(node)
    waits = getattr(node, 'waits_to_end', lambda: False)
    try:
        while not getattr(node, 'finished', False) and not (stop and not waits()):
            executor.spin_once(timeout_sec=0.2)
    except Exception:
        traceback.print_exc()
        sys.exit(CRASHED)
    executor.shutdown()
    node.destroy_node()


def _check_arguments(rest: list[str], text: str | None) -> None:
    """What is left when ROS has taken its own."""
    if '-h' in rest or '--help' in rest:
        print(f'{text}\n\nParameters: --ros-args -p NAME:=VALUE, see docs/parameters.md, or '
              '`ros2 param describe` while it runs.')
        sys.exit(0)
    if rest:
        print(f'{rest[0]!r}: expected --ros-args and what belongs to it', file=sys.stderr)
        sys.exit(2)
