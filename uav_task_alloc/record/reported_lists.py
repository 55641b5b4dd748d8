# SPDX-License-Identifier: Apache-2.0
"""What task lists say: the newest list of each UAV, places and ways of tasks, legs as planned."""
from __future__ import annotations

from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Point
from uav_task_alloc.record.record_file import Line
from uav_task_alloc.record.ways_home import WaysHome


class ReportedLists:
    """The newest task list of each UAV, and what earlier ones said of tasks.

    Arguments of methods:
        line: of kind `list`.
    """

    def __init__(self) -> None:
        self.newest: dict[str, Line] = {}  # by UAV
        self.places: dict[str, Point] = {}  # [m] of tasks, by id
        self.ways: dict[str, list[Point]] = {}  # [m] of pieces, by id
        self.waited: set[str] = set()  # tasks at which a UAV waits for the next
        # [m] by UAV and task, each from the list in which the task became the first
        self.legs: dict[tuple[str, str], float] = {}
        self.ways_home = WaysHome()  # as planned

    def apply(self, line: Line, mode: str) -> None:
        """Take a list.

        Args:
            line: see the class.
            mode: of its UAV; '': not known.
        """
        uav, rows = line['uav'], line['tasks']
        if self.begins_leg(line):
            self.legs[uav, rows[0]['id']] = rows[0]['leg_distance'] + polyline_length(
                rows[0].get('way', ()))
        self.ways.update((row['id'], row['way']) for row in rows if 'way' in row)
        self.places.update((row['id'], tuple(row['position'])) for row in rows
                           if None not in row.get('position', (None,)))
        for before, row in zip((None, *rows), rows, strict=False):
            if row.get('wait', 0.0) > 0.0:
                self.waited |= {row['id']} | ({before['id']} if before else set())
        self.ways_home.note_list(line, self.newest.get(uav), mode)
        self.newest[uav] = line

    def begins_leg(self, line: Line) -> bool:
        """Whether a list has another first task than the newest list of its UAV."""
        before = self.newest.get(line['uav'])
        old = before['tasks'][0]['id'] if before and before['tasks'] else None
        return bool(line['tasks']) and line['tasks'][0]['id'] != old
