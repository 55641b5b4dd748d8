# SPDX-License-Identifier: Apache-2.0
"""MISSION_ITEM_REACHED after the last item was sent: of the old mission, or of the new?"""
from __future__ import annotations

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.mission.diff import MissionDiff
from uav_task_alloc.mavlink.mission.items import alike, with_position
from uav_task_alloc.mavlink.mission.progress import ProgressTable

_MAX_MESSAGES = 32


class ReachedDuringUpload:
    """Keeps each REACHED until the upload is decided; then credits it by the positions.

    Args:
        progress: table of the missions before and after the upload.
        origin: of the ENU frame.

    Arguments of methods:
        seq: of the item reached.
        now: steady time [s].
        uploaded: what the failed transfer was to change.
    """

    def __init__(self, progress: ProgressTable, origin: Origin) -> None:
        self._progress, self._origin = progress, origin
        # seq, received at [s]: the first of its series, and the last
        self._reached: list[tuple[int, float, float]] = []
        self._newest: tuple[int, float] = (-1, 0.0)  # seq, received at [s], with repetitions

    def __bool__(self) -> bool:
        return bool(self._reached)

    def add(self, seq: int, now: float) -> None:
        """Keep a REACHED that may be of the old or of the new mission."""
        repeated = bool(self._reached) and self._reached[-1][0] == seq  # by PX4
        if repeated:
            self._reached[-1] = (*self._reached[-1][:2], now)
        elif len(self._reached) < _MAX_MESSAGES:
            self._reached.append((seq, self._progress.reached_first_at(seq, now), now))
        self._newest = seq, now
        self._progress.note_end(seq, now)

    def clear(self) -> None:
        """Drop them: the vehicle was restarted."""
        self._reached.clear()

    def assign_epochs(self, uploaded: MissionDiff) -> list[tuple[int, float]]:
        """Credit those of the old mission.

        Args:
            uploaded: the new mission.

        Returns:
            (seq, received at [s]) of those of the new mission.
        """
        of_new, old, progress = [], self._progress.items, self._progress
        for seq, when, last in self._reached:
            before = with_position(old[seq], self._origin) if 0 <= seq < len(old) else None
            after = uploaded.items[seq] if 0 <= seq < len(uploaded.items) else None
            if before is not None and (progress.was_at_by(before, when) or (
                    after is not None and alike(before, after))):
                progress.note_reached(seq, when)
            elif after is not None and progress.was_at_by(after, when):
                of_new.append((seq, when))
            elif before is not None and progress.near_one(before, after, when):
                if before.task:
                    progress.credit(before)
                else:  # of a mission that was read: `resume` finds the task by its position
                    progress.note_reached(seq, when)
            elif after is not None and progress.near_one(after, before, when):
                of_new.append((seq, when))
            elif after is not None and seq == uploaded.start and (
                    progress.was_exactly_at(after, last)):
                of_new.append((seq, last))  # a new one among repetitions of an older one
            elif before is not None and seq == progress.current and (
                    progress.was_exactly_at(before, last)):
                progress.credit(before)
        self._reached.clear()
        return of_new

    def continue_repetition(self) -> None:
        """Note the last one, which may still be repeated, after those of the new mission."""
        self._progress.note_repeated(*self._newest)

    def credit(self, uploaded: MissionDiff) -> None:
        """Credit all by the positions after a failed transfer: either mission may be flown."""
        for seq, _ in self.assign_epochs(uploaded):
            self._progress.credit(uploaded.items[seq])
