# SPDX-License-Identifier: Apache-2.0
"""Runs a node until SIGINT or SIGTERM, and shuts it down in order with exit status 0."""
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

CRASHED = 70  # exit status, EX_SOFTWARE of sysexits.h: the launch files restart the node


def with_flags(argv: list[str], *names: str) -> list[str]:
    """Rewrite `--record FILE` as `--ros-args -p record:=FILE`.

    Args:
        argv: the command line.
        names: parameters of type string that may be given as flags.

    Returns:
        The command line for `rclpy.init`; unchanged where there is no such flag.
    """
    remaining, parameters = list(argv), []
    for name in names:
        while f'--{name}' in remaining[:-1]:
            k = remaining.index(f'--{name}')
            parameters += ['-p', f'{name}:={json.dumps(remaining[k + 1])}']
            del remaining[k:k + 2]
    return [*remaining, '--ros-args', *parameters, '--'] if parameters else remaining


def run(make_node: Callable[[], Node], args: list[str] | None = None, threads: int = 1) -> None:
    """Spin `make_node()` until SIGINT or SIGTERM, or until its attribute `finished` is true.

    A node with a method `delays_exit` is spun on after a signal while that returns True.
    Exit status: 0 in order; 1 and one line where `make_node` refuses a parameter; CRASHED where
    a callback raises.

    Args:
        make_node: the node's class; its docstring is the text of `--help`.
        args: the command line; None: sys.argv.
        threads: of the executor.
    """
    _check_arguments(remove_ros_args(args or sys.argv)[1:], make_node.__doc__)
    # rclpy's own handlers invalidate the context from another thread, and a running callback
    # then raises RCLError. Here the context is valid until the node is destroyed.
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: signals.append(1))
    # through shared memory a node that was killed and restarted receives nothing for 3 s
    os.environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    try:
        _spin(make_node(), threads, signals)
    except AllocError as error:
        sys.exit(str(error))
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):  # a second Ctrl-C must not cut this short
            signal.signal(number, signal.SIG_IGN)
        rclpy.try_shutdown()


def _spin(node: Node, threads: int, signals: list[int]) -> None:
    """Spin until `signals` is not empty; raise SystemExit CRASHED where a callback raises."""
    executor = SingleThreadedExecutor() if threads == 1 else MultiThreadedExecutor(threads)
    executor.add_node(node)
    delays_exit = getattr(node, 'delays_exit', lambda: False)
    try:
        while not getattr(node, 'finished', False) and not (signals and not delays_exit()):
            executor.spin_once(timeout_sec=0.2)
    except Exception:
        traceback.print_exc()
        sys.exit(CRASHED)
    executor.shutdown()
    node.destroy_node()


def _check_arguments(remaining: list[str], text: str | None) -> None:
    """Answer --help, and refuse arguments that are not ROS's."""
    if '-h' in remaining or '--help' in remaining:
        print(f'{text}\n\nParameters: --ros-args -p NAME:=VALUE, see docs/parameters.md, or '
              '`ros2 param describe` while it runs.')
        sys.exit(0)
    if remaining:
        print(f'{remaining[0]!r}: expected --ros-args and its arguments', file=sys.stderr)
        sys.exit(2)
