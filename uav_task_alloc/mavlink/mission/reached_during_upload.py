# SPDX-License-Identifier: Apache-2.0
"""MISSION_ITEM_REACHED after the last item was sent: of the old mission, or of the new?"""
from __future__ import annotations

from uav_task_alloc.mavlink.mission.diff import MissionDiff
from uav_task_alloc.mavlink.mission.items import alike
from uav_task_alloc.mavlink.mission.progress import ProgressTable

_MOST = 32  # messages


class ReachedDuringUpload:
    """Keeps them until the answer is there, and credits each where the vehicle was seen."""

    def __init__(self, progress: ProgressTable) -> None:
        self._progress = progress
        self._heard: list[tuple[int, float]] = []  # index, when first [s]
        self._newest: tuple[int, float] = (-1, 0.0)  # index, when [s], repetitions as well

    def __bool__(self) -> bool:
        return bool(self._heard)

    def add(self, seq: int, now: float) -> None:
        """It may be of either."""
        repeated = bool(self._heard) and self._heard[-1][0] == seq  # by PX4
        if len(self._heard) < _MOST and not repeated:
            self._heard.append((seq, now))
        self._newest = seq, now
        self._progress.note_end(seq, now)

    def clear(self) -> None:
        """The vehicle was restarted."""
        self._heard.clear()

    def assign_epochs(self, found: MissionDiff) -> list[tuple[int, float]]:
        """Credit those of the old mission; returns those of the new one."""
        of_new, old, progress = [], self._progress.items, self._progress
        for seq, when in self._heard:
            before = old[seq] if 0 <= seq < len(old) else None
            after = found.items[seq] if 0 <= seq < len(found.items) else None
            if before is not None and (progress.was_at_by(before, when) or (
                    after is not None and alike(before, after))):
                progress.note_reached(seq, when)
            elif after is not None and progress.was_at_by(after, when):
                of_new.append((seq, when))
            elif before is not None and progress.near_one(before, after, when):
                progress.credit(before)
            elif after is not None and progress.near_one(after, before, when):
                of_new.append((seq, when))
        self._heard.clear()
        return of_new

    def continue_repetition(self) -> None:
        """Once those of the new mission are told: the last of all may be repeated still."""
        self._progress.note_repeated(*self._newest)

    def credit(self, found: MissionDiff) -> None:
        """The transfer has failed, and nobody knows which mission was flown: ask where it was."""
        for seq, _ in self.assign_epochs(found):
            self._progress.credit(found.items[seq])
