# SPDX-License-Identifier: Apache-2.0
"""The state of a run on stdout, rewritten in a terminal; a terminal that takes no text is left."""
from __future__ import annotations

import select
import shutil
import sys

from uav_task_alloc.nodes.conversions.message_limits import printable
from uav_task_alloc.record.progress import fleet_lines, headline
from uav_task_alloc.record.run_state import RunState

_PLAIN_PERIODS = 4  # updates between two lines where the output is no terminal
_UP_AND_CLEAR = '\x1b[{}F\x1b[J'


class TerminalStatus:
    """The state of a run on stdout; a terminal is rewritten, a file gets a line at times."""

    def __init__(self) -> None:
        self._lines = 0  # printed last
        self._updates = 0

    def update(self, state: RunState, wall: float, clock: float, last: bool) -> None:
        """Print the state, unless stdout takes no text now.

        Args:
            state: of the run.
            wall: present time [unix s].
            clock: that of the scenario [s].
            last: print it in any case.
        """
        self._updates += 1
        if not last and not _takes_text():
            return
        lines = [headline(state, clock)]
        if sys.stdout.isatty():
            lines += fleet_lines(state, wall)
            width = shutil.get_terminal_size().columns - 1  # a wrapped line cannot be rewritten
            lines = [line[:width] for line in lines]
            sys.stdout.write(_UP_AND_CLEAR.format(self._lines) if self._lines else '')
            self._lines = len(lines)
        elif self._updates % _PLAIN_PERIODS and not last:
            return
        print('\n'.join(map(printable, lines)), flush=True)


def _takes_text() -> bool:
    """Whether stdout takes text at once: a stopped terminal (Ctrl-S) would stop the node."""
    try:
        return bool(select.select([], [sys.stdout], [], 0.0)[1])
    except (OSError, ValueError):  # it is no file, or closed
        return True
