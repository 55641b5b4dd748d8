# SPDX-License-Identifier: Apache-2.0
"""The lengths of the flights home of each UAV, as planned when its last task had ended."""
from __future__ import annotations

import math

from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.record.record_file import Line

_DOWN = ('', 'LANDING', 'STANDBY')  # modes of a UAV that is home, or of which none is known


class WaysHome:
    """Lengths [m] of flights home and to waiting places, without those that were given up."""

    def __init__(self) -> None:
        self.lengths: dict[str, list[float]] = {}  # [m] by UAV

    def note_list(self, line: Line, last: Line | None, mode: str) -> None:
        """Add the way home where a list has no tasks any more.

        Args:
            line: a list.
            last: the list of the UAV before; None: there was none.
            mode: of the UAV; '': not known.
        """
        ways = self.lengths.setdefault(line['uav'], [])
        had_tasks, is_down = bool(last and last['tasks']), mode in _DOWN
        if line['tasks']:
            if ways and not had_tasks and not is_down:
                ways.pop()  # given up
        elif last and had_tasks:
            ways.append(line['distance'] or (0.0 if mode == 'STANDBY' else _after_tasks(last)))
        elif line['distance']:
            ways[len(ways) if is_down else -1:] = [line['distance']]

    def total(self) -> float:
        """Length of all [m]."""
        return math.fsum(map(math.fsum, self.lengths.values()))


def _after_tasks(line: Line) -> float:
    """The length [m] of a list from its last task to its end."""
    return max(0.0, (line['distance'] or 0.0) - math.fsum(
        row['leg_distance'] + polyline_length(row.get('way', ())) for row in line['tasks']))
