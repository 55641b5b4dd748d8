# SPDX-License-Identifier: Apache-2.0
"""The current item that the bridge has to set: a mission is not begun again at what was flown."""
from __future__ import annotations

from uav_task_alloc.mavlink.mission.diff import DiffKind, MissionDiff
from uav_task_alloc.mavlink.mission.progress import ProgressTable


class ItemToSet:
    """Chooses it once a vehicle has taken a mission, and while it flies on before it is set.

    Args:
        progress: of the vehicle; what it has reached is credited.
        atomic: whether it takes a mission as a whole, with its first item (PX4).

    Attributes:
        seq: index of the item to set, unless the upload has set it; None: it flies the right one.

    Arguments of methods:
        seq: an index without home.
        now: steady time [s].
    """

    def __init__(self, progress: ProgressTable, atomic: bool) -> None:
        self._progress, self._atomic = progress, atomic
        self.seq: int | None = None
        self._flown: int | None = None  # though `seq` is not set yet

    def choose(self, diff: MissionDiff, resumed: int, sent_before: bool, now: float) -> None:
        """Choose it for a mission that the vehicle has just taken.

        Args:
            diff: the mission.
            resumed: `resumed_at` of it.
            sent_before: the vehicle may have taken, and flown, it after an earlier try.
            now: see above.
        """
        progress, current, self._flown = self._progress, self._progress.current, None
        if diff.kind is not DiffKind.APPEND and not self._atomic:
            self.seq = current if current is not None and (
                current < len(diff.items)) else diff.start
        elif resumed > diff.start == current:  # PX4 has flown on during the upload
            progress.note_set_current(resumed, now)
            self.seq = resumed
        elif self._atomic and sent_before and current is not None and all(
                item.task in progress.completed
                for item in diff.items[diff.start:current]) and current > diff.start:
            self.seq = current  # it would fly again what it flew after an earlier try

    def while_uploading(self) -> int | None:
        """The item to set while an upload goes on: past what PX4 has flown; None: it flies on."""
        return self._next_unflown() if self.seq is None else self.seq

    def _next_unflown(self) -> int | None:
        """Where a vehicle goes on that flies to a task which is completed; None: it does not."""
        progress, item = self._progress, self._progress.active
        if item is None or item.task not in progress.completed:
            return None
        return next((n for n, other in enumerate(progress.items[:progress.last_flown + 1])
                     if n > (progress.current or 0) and other.task not in progress.completed),
                    None)

    def note_set(self, seq: int, now: float) -> None:
        """Note that the current item was set while an upload goes on."""
        self.seq = None
        self._progress.note_set_current(seq, now)

    def note_flown(self, seq: int, now: float) -> None:
        """Take a MISSION_CURRENT of a vehicle that flies before its current item is set."""
        before, self._flown = self._flown, seq
        if before is None or self._atomic:
            return
        progress, items = self._progress, self._progress.items
        if not before < seq <= len(items):
            return
        if progress.evidence.was_at(items[before], now):
            progress.credit(items[before])
        self.seq = next((n for n, item in enumerate(items)
                         if item.task and item.task not in progress.completed), self.seq)
