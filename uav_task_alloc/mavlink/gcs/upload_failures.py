# SPDX-License-Identifier: Apache-2.0
"""Handles failed uploads: a shorter horizon, a refused task, or another attempt."""
from __future__ import annotations

from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.mission.diff import MissionDiff
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.mission.outcomes import Failed
from uav_task_alloc.mavlink.mission.wanted_mission import WantedMission
from uav_task_alloc.mavlink.transport.notes import OperatorNote

_RESTART_DELAY = 6.0  # [s] in which a restart of the vehicle may explain an infeasible mission


class UploadFailures:
    """Refuses tasks of the list, at once, or once a restart of the vehicle is ruled out."""

    def __init__(self, wanted: WantedMission, own: int, notes: deque[OperatorNote]) -> None:
        self._list, self._own, self._notes = wanted, own, notes
        self._infeasible: tuple[float, list[str], str, TaskList] | None = None  # from time [s] on

    def step(self, now: float) -> None:
        """Refuse the tasks of an infeasible mission when the delay is over."""
        if self._infeasible is not None and now >= self._infeasible[0]:
            _, stops, reason, tasks = self._infeasible
            self._infeasible = None
            for task in stops:
                self._list.refuse(task, reason, tasks)

    def clear(self) -> None:
        """Cancel a pending refusal: the vehicle was restarted."""
        self._infeasible = None

    def take(self, event: Failed, diff: MissionDiff, tasks: TaskList, now: float) -> bool:
        """Process the failure of an upload.

        Args:
            event: the failure.
            diff: the uploaded mission.
            tasks: its list.
            now: steady time [s].

        Returns:
            Whether the same upload is to be tried again.
        """
        self._notes.append(OperatorNote('error', f'mission upload failed: {event.reason}'))
        stops = [item.task for item in diff.items if item.completes]
        if event.result == d.MAV_MISSION_NO_SPACE:
            self._notes.append(OperatorNote('warning', self._list.horizon.shrink(len(stops))))
            return self._list.horizon.stops is None
        if event.result is not None:
            seq = min(max((event.seq or 0) - self._own, 0), len(diff.items) - 1)
            task = next((i.task for i in diff.items[seq:] if i.task), stops[0] if stops else '')
            self._list.refuse(task, event.reason, tasks)
            return not task
        if 'infeasible' in event.reason:  # or it was restarted, which its clock shows later
            self._infeasible = now + _RESTART_DELAY, stops, event.reason, tasks
        return True
