# SPDX-License-Identifier: Apache-2.0
"""The first code of a node's program: a signal ends it in order while its modules are imported."""
import os
import signal
import sys
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_INSTALL = {'rclpy': 'source the setup file of ROS 2 Jazzy',
            'uav_task_alloc_msgs': 'build and source the workspace with `uav_task_alloc_msgs`'}


def start(name: str) -> None:
    """Run the node NAME of `uav_task_alloc.nodes` as a program; the process ends with it.

    Until the node handles signals itself, nothing is running that must be shut down.

    Args:
        name: of the node.
    """
    def end(*_: int | FrameType | None) -> None:
        for number in _SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        os.write(2, f'{name}: stopped during its start\n'.encode())
        os._exit(0)  # an exception could be raised in the middle of any import
    for number in _SIGNALS:
        signal.signal(number, end)
    # of the program, see resource/program.in: one that came before this line is handled now
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)
    try:
        from uav_task_alloc.quick_import import import_quickly
        main = import_quickly(f'uav_task_alloc.nodes.{name}').main
    except ImportError as error:
        missing = (error.name or '').split('.')[0]
        if missing == 'uav_task_alloc':
            raise
        how = _INSTALL.get(missing, 'see the installation in README.md')
        sys.exit(f'{name}: {str(error).splitlines()[0]}: '
                 f'expected {missing or "it"} to be installed: {how}')
    sys.exit(main())
