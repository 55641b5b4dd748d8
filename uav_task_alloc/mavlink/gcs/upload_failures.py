# SPDX-License-Identifier: Apache-2.0
"""What follows from an upload that the vehicle did not take: fewer tasks, or a task refused."""
from __future__ import annotations

from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.mission.diff import MissionDiff
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.mission.outcomes import Failed
from uav_task_alloc.mavlink.mission.wanted_mission import WantedMission
from uav_task_alloc.mavlink.transport.notes import OperatorNote

RESTART = 6.0  # [s] after a mission was called infeasible in which a restart may show


class UploadFailures:
    """Refuses tasks of the list, at once or once the vehicle was seen not to have restarted."""

    def __init__(self, wanted: WantedMission, own: int, notes: deque[OperatorNote]) -> None:
        self._list, self._own, self._notes = wanted, own, notes
        self._infeasible: tuple[float, list[str], str, TaskList] | None = None  # to be told at [s]

    def step(self, now: float) -> None:
        """Refuse what was infeasible a while ago."""
        if self._infeasible is not None and now >= self._infeasible[0]:
            _, stops, reason, asked = self._infeasible
            self._infeasible = None
            for task in stops:
                self._list.refuse(task, reason, asked)

    def clear(self) -> None:
        """The vehicle was restarted."""
        self._infeasible = None

    def take(self, event: Failed, found: MissionDiff, tasks: TaskList, now: float) -> bool:
        """An upload has failed.

        Args:
            event: how.
            found: what was uploaded.
            tasks: the list that it was for.
            now: [s].

        Returns:
            Whether the same is still to be tried, so that somebody decides when.
        """
        self._notes.append(OperatorNote('error', f'mission upload failed: {event.reason}'))
        stops = [item.task for item in found.items if item.completes]
        if event.result == dialect.MAV_MISSION_NO_SPACE:
            self._notes.append(OperatorNote('warning', self._list.horizon.shrink(len(stops))))
            return self._list.horizon.stops is None
        if event.result is not None:
            seq = min(max((event.seq or 0) - self._own, 0), len(found.items) - 1)
            task = next((i.task for i in found.items[seq:] if i.task), stops[0] if stops else '')
            self._list.refuse(task, event.reason, tasks)
            return not task
        if 'infeasible' in event.reason:  # or it was just restarted, as its clock will tell
            self._infeasible = now + RESTART, stops, event.reason, tasks
        return True
