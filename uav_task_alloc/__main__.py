# SPDX-License-Identifier: Apache-2.0
"""The command line: `uav_task_alloc COMMAND` or `python -m uav_task_alloc`; needs no ROS."""
import sys

if __name__ == '__main__':
    from uav_task_alloc.cli.entry import main
    sys.exit(main())

from uav_task_alloc.cli.commands import COMMANDS, main

__all__ = ['COMMANDS', 'main']
