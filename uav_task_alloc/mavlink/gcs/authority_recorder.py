# SPDX-License-Identifier: Apache-2.0
"""Writes down what a restarted bridge has to know of a vehicle, where it has changed."""
from __future__ import annotations

import math
from collections.abc import Callable

from uav_task_alloc.mavlink.gcs.authority import AuthorityRecord, Suspension, TaskMark
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.model import Point

MARKS, REMEMBERED = 50, 600.0  # tasks, [s]


class AuthorityRecorder:
    """The record of one vehicle, and the tasks that were flown or passed over."""

    def __init__(
        self,
        state: AuthorityWatchState,
        evidence: MissionEvidence,
        record: AuthorityRecord | None,
        save: Callable[[AuthorityRecord], None],
    ) -> None:
        self._state, self._evidence = state, evidence
        self._save, self._saved = save, record
        self.marks: dict[str, TaskMark] = {m.task: m for m in record.marks} if record else {}

    def mark(self, task: str, place: Point | None, flown: bool, now: float) -> None:
        """A task was flown, or passed over: a restarted bridge could not see which."""
        if place is None:
            return
        self.marks.pop(task, None)
        self.marks = {old: mark for old, mark in list(self.marks.items())[-MARKS:]
                      if now - mark.at < REMEMBERED}
        self.marks[task] = TaskMark(task, *place, round(now, 3), flown)

    def keep(self) -> None:
        """Hand the record to whoever keeps it, where it has changed."""
        state, authority, sent = self._state, self._state.authority, self._state.sent
        if authority.undecided or authority.suspended_by(Suspension.RESTART):
            return
        record = AuthorityRecord(
            authority.state, authority.why, authority.since, authority.killed, authority.landed,
            authority.until_landing, state.flown, state.mode, state.armed,
            tuple(dict.fromkeys(mode for mode, _ in sent.modes)),
            sent.arm_until > -math.inf and not state.armed and authority.held,
            state.swap_at, sent.climb, tuple(self.marks.values()), *self._evidence.place())
        if record != self._saved:
            self._saved = record
            self._save(record)
