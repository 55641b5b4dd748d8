# SPDX-License-Identifier: Apache-2.0
"""Saves the authority record of a vehicle for a restarted bridge whenever it has changed."""
from __future__ import annotations

import math
from collections.abc import Callable

from uav_task_alloc.mavlink.gcs.authority import Suspension
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityRecord, TaskMark
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence
from uav_task_alloc.model import Point

_MARKS, _MARK_LIFETIME = 50, 600.0  # tasks, [s]
_LAST_TIME = -7  # index of the time of the newest position
_POSITION_PERIOD = 1.0  # [s] between two positions that are saved
LANDING_RADIUS = 5.0  # [m] from home at most, of a landing there


class AuthorityRecorder:
    """The record of one vehicle, and its tasks that were flown or skipped.

    Args:
        state: of the vehicle.
        evidence: of its mission.
        record: of the previous run; None: there is none.
        save: called with each changed record.

    Attributes:
        marks: tasks that were flown or skipped, by id.
    """

    def __init__(
        self,
        state: AuthorityWatchState,
        evidence: MissionEvidence,
        record: AuthorityRecord | None,
        save: Callable[[AuthorityRecord], None],
    ) -> None:
        self._state, self._evidence = state, evidence
        self._save, self._saved = save, record
        self._fields: tuple[object, ...] = ()  # of the record when it was compared last
        self._mode = record.mode if record else None  # the last mode with a known reason
        self._seen: tuple[float, ...] = ()
        self._seen_at = -math.inf  # vehicle time [s] of the newest of them
        self._passed: tuple[int, ...] = ()  # when it was recorded
        self.marks: dict[str, TaskMark] = {m.task: m for m in record.marks} if record else {}

    def mark_task(self, task: str, position: Point | None, flown: bool, now: float) -> None:
        """See `AuthorityWatch.mark_task`."""
        if position is None:
            return
        self.marks.pop(task, None)
        self.marks = {old: mark for old, mark in list(self.marks.items())[-_MARKS:]
                      if now - mark.at < _MARK_LIFETIME}
        self.marks[task] = TaskMark(task, *position, round(now, 3), flown)

    def _last_position(self, passed: tuple[int, ...]) -> tuple[float, ...]:
        """The last positions, renewed each _POSITION_PERIOD, and once items are passed."""
        since = self._evidence.position_time() - self._seen_at
        if passed != self._passed or not 0.0 <= since < _POSITION_PERIOD:
            self._passed = passed
            positions = self._evidence.last_positions()
            self._seen = positions or self._seen
            self._seen_at = positions[_LAST_TIME] if positions else -math.inf
        return self._seen

    def _landed_battery(self) -> float | None:
        """The battery at its own landing, also while it returns and is over its home."""
        state, telemetry = self._state, self._state.telemetry
        battery, home = state.landed_battery, telemetry.home
        if (math.isnan(battery) and home is not None and state.armed and state.authority.held
                and not state.authority.until_landing
                and ((state.descending and state.is_return(state.mode))
                     or (self._evidence.returning() and telemetry.in_mission))
                and math.dist(telemetry.position[:2], home[:2]) <= LANDING_RADIUS):
            battery = telemetry.battery
        return None if math.isnan(battery) else round(battery, 3)

    def save_if_changed(self) -> None:
        """Save the record where it differs from the one saved last."""
        state, authority, sent = self._state, self._state.authority, self._state.sent
        if authority.undecided or authority.suspended_by(Suspension.RESTART):
            return
        if state.unexplained is None:  # else a restarted bridge would accept the new mode
            self._mode = state.mode
        evidence = self._evidence
        position, passed = evidence.mission_position(), evidence.passed()
        fields = (
            authority.state, authority.why, authority.since, authority.killed, authority.landed,
            authority.until_landing, state.flown, self._mode, state.armed,
            tuple(dict.fromkeys(mode for mode, _ in sent.modes)) if sent.modes else (),
            sent.arm_until > -math.inf and not state.armed and authority.held,
            state.replacing_since, sent.climb, tuple(self.marks.values()),
            *position, passed, evidence.uploading(),
            self._last_position(passed),
            self._landed_battery(),
            evidence.pieces(), evidence.ahead(position[1]))
        if fields == self._fields:  # as after most messages
            return
        self._fields, record = fields, AuthorityRecord(*fields)
        if record != self._saved:
            self._saved = record
            self._save(record)
