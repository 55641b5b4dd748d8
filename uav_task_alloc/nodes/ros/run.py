# SPDX-License-Identifier: Apache-2.0
"""Runs a node until SIGINT, SIGTERM or SIGHUP, and shuts it down in order with exit status 0."""
from __future__ import annotations

import faulthandler
import json
import os
import re
import signal
import sys
import traceback
from collections.abc import Callable, Sequence
from inspect import cleandoc
from typing import NoReturn

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import MultiThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from uav_task_alloc.errors import AllocError
from uav_task_alloc.nodes.ros.log_callers import name_callers_by_frames
from uav_task_alloc.nodes.ros.node_executor import NodeExecutor
from uav_task_alloc.nodes.ros.parameter_files import files_of, read_sections
from uav_task_alloc.nodes.ros.security import enclave_of, security_warning
from uav_task_alloc.parameter_field import CheckedParams
from uav_task_alloc.parameter_texts import help_text

CRASHED = 70  # exit status, EX_SOFTWARE of sysexits.h: the launch files restart the node
_ENDS, _GIVES_UP = 8.0, 30  # [s] after which a node that is to end logs where it hangs; is ended
# what ROS could not parse, by its own words
_EXPECTED = {'parameter override rule': '-p NAME:=VALUE, a list with values of one type',
             'remap rule': '-r FROM:=TO', 'params file': 'a parameter file',
             'log level': '--log-level debug, info, warn, error or fatal',
             'enclave': '-e NAME'}
_REFUSALS = (AllocError, OSError, ParameterException, NameValidationException,
             rclpy_implementation.RCLError)


def with_flags(argv: list[str], *names: str) -> list[str]:
    """Rewrite `--record FILE` as `--ros-args -p record:=FILE`.

    Args:
        argv: the command line.
        names: parameters of type string that may be given as flags.

    Returns:
        The command line for `rclpy.init`; unchanged where there is no such flag. The process ends
        with status 2 where one has no value.
    """
    if argv and argv[-1] in (flags := [f'--{name}' for name in names]):
        _refuse(f'{argv[-1]}: expected a value after it; flags are {", ".join(flags)}')
    remaining, parameters = list(argv), []
    for name in names:
        while f'--{name}' in remaining[:-1]:
            k = remaining.index(f'--{name}')
            parameters += ['-p', f'{name}:={json.dumps(remaining[k + 1])}']
            del remaining[k:k + 2]
    return [*remaining, '--ros-args', *parameters, '--'] if parameters else remaining


def run(make_node: Callable[[], Node], args: list[str] | None = None, threads: int = 1,
        params: type[CheckedParams] | None = None) -> None:
    """Spin `make_node()` until SIGINT, SIGTERM or SIGHUP, or until its `finished` is true.

    A node with a method `delays_exit` is spun on after a signal while that returns True.
    Exit status: 0 in order; 2 and one line for a command line that is invalid; 1 and one line
    where the node refuses a parameter or cannot be started; CRASHED where a callback raises;
    that of SIGALRM where it hangs at its end.

    Args:
        make_node: the node's class; its docstring is the text of `--help`.
        args: the command line; None: sys.argv.
        threads: of the executor.
        params: the class of its parameters, for `--help`.
    """
    _check_arguments(args or sys.argv, make_node.__doc__, params)
    # rclpy's own handlers invalidate the context from another thread, and a running callback
    # then raises RCLError. Here the context is valid until the node is destroyed.
    signals: list[int] = []
    for number in _end_signals():
        signal.signal(number, lambda *_: signals.append(1))
    name_callers_by_frames()
    # through shared memory a node that was killed and restarted receives nothing for 3 s
    os.environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
    try:
        unsecured = security_warning(os.environ, enclave_of(args or sys.argv))
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
        if unsecured:
            node.get_logger().warning(unsecured)
        _spin(node, threads, signals)
    except _REFUSALS as error:
        sys.exit(_one_line(error))
    finally:
        _limit_end()
        for number in _end_signals():  # a second Ctrl-C must not cut this short
            signal.signal(number, signal.SIG_IGN)
        rclpy.try_shutdown()
        faulthandler.cancel_dump_traceback_later()
        signal.alarm(0)


def _end_signals() -> list[signal.Signals]:
    """Those that end a node; SIGHUP, of a terminal that is closed, not under `nohup`."""
    return [number for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN]


def _limit_end() -> None:
    """Have SIGALRM end the process if it hangs: Fast DDS may wait for ever, with Python's lock."""
    faulthandler.dump_traceback_later(_ENDS, file=2)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(_GIVES_UP)


def _spin(node: Node, threads: int, signals: list[int]) -> None:
    """Spin until `signals` is not empty; raise SystemExit CRASHED where a callback raises."""
    executor = NodeExecutor() if threads == 1 else MultiThreadedExecutor(threads)
    executor.add_node(node)
    delays_exit = getattr(node, 'delays_exit', lambda: False)
    try:
        while not getattr(node, 'finished', False) and not (signals and not delays_exit()):
            executor.spin_once(timeout_sec=0.2)
    except Exception:
        traceback.print_exc()
        sys.exit(CRASHED)
    _limit_end()
    executor.shutdown()
    node.destroy_node()


def _check_arguments(argv: Sequence[str], text: str | None,
                     params: type[CheckedParams] | None) -> None:
    """Answer --help, and refuse a command line that ROS cannot read or would ignore a part of."""
    if '-h' in argv or '--help' in argv:
        print(cleandoc(text or '').partition('Parameters:\n')[0].rstrip() + '\n',
              help_text(params) if params else '', sep='\n')
        sys.exit(0)
    try:
        for path in files_of(argv):
            read_sections(path)
        remaining = remove_ros_args(list(argv))[1:]
    except AllocError as error:
        _refuse(str(error))
    except rclpy_implementation.UnknownROSArgsError as error:
        _refuse(f'{error}: expected arguments of ROS after --ros-args')
    except rclpy_implementation.RCLInvalidROSArgsError as error:
        _refuse(_unparsed(error))
    if remaining:
        _refuse(f'{remaining[0]!r}: expected --ros-args and its arguments')


def _refuse(text: str) -> NoReturn:
    print(text, file=sys.stderr)
    sys.exit(2)


def _unparsed(error: Exception) -> str:
    """What of a command line ROS could not parse, and what it must be."""
    text = _one_line(error)
    found = re.search(r"Couldn't parse ([a-z ]+): '(.*)'\. Error: (.*)", text)
    if found is None:
        return text
    kind, given, reason = found.groups()
    expected = _EXPECTED.get(kind, f'a {kind}')
    return f'{given}: expected {expected} ({reason})'


def _one_line(error: Exception) -> str:
    """The text of an error without the places in the sources of ROS."""
    return ' '.join(re.sub(r', at \S+:\d+', '', str(error)).split())
