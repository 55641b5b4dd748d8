# SPDX-License-Identifier: Apache-2.0
"""MISSION_ITEM_REACHED completes the item it names, and no other.

While one of the previous epoch may still arrive, it counts only where the vehicle was at that
item (`reached_epoch`).
"""
from __future__ import annotations

import math

from uav_task_alloc.mavlink.mission.completed_tasks import CompletedTasks
from uav_task_alloc.mavlink.mission.current_item import CurrentItem
from uav_task_alloc.mavlink.mission.epoch import Epoch
from uav_task_alloc.mavlink.mission.position_history import (
    MAX_MESSAGE_DELAY,
    REACH,
    PositionHistory,
)
from uav_task_alloc.mavlink.mission.reached_epoch import CurrentEpoch, ReachedEpoch
from uav_task_alloc.mavlink.mission.reached_series import ReachedReport

_REACH_PLANE = 300.0  # [m] as REACH: it may pass a corner that wide of it


class ReachedItems:
    """Takes each REACHED once its epoch is known.

    Args:
        epoch: the mission on board.
        tasks: of the vehicle.
        positions: of the vehicle.
        epochs: to which a REACHED can belong.
        moves: the current item of `epoch`.
        repeats: whether the autopilot repeats REACHED (PX4).
        plane: whether the vehicle turns as wide as a plane.
    """

    def __init__(self, epoch: Epoch, tasks: CompletedTasks, positions: PositionHistory,
                 epochs: ReachedEpoch, moves: CurrentItem, repeats: bool, plane: bool) -> None:
        self._epoch, self._tasks, self._positions = epoch, tasks, positions
        self._epochs, self._moves, self._repeats = epochs, moves, repeats
        self._reach = _REACH_PLANE if plane else REACH
        self.seqs: set[int] = set()  # reached in this epoch
        self.last: int | None = None  # the last one of this epoch
        self.end_at = -math.inf  # [s] REACHED of the last item was received
        self.contradicted = False  # one named an item far away: another mission may be on board

    def begin(self) -> None:
        """Begin an epoch."""
        self.seqs.clear()
        self.last = None

    def end(self) -> None:
        """End the epoch: what a REACHED names is complete where the positions have shown it."""
        epoch, series = self._epoch, self._epochs.series
        for seq, (_, reached) in self._epochs.unproven.items():
            if 0 <= seq < len(epoch.items) and series.first_sent(reached) >= epoch.taken and (
                    not series.repeats_credited(reached)) and (
                    self._positions.was_at(epoch.items[seq], epoch.since, close=0.0)):
                self._tasks.credit(epoch.items[seq])
        self.last = None

    def note(self, seq: int, now: float, proven: bool, frame: int | None) -> None:
        """Take one; see `ProgressTable.note_reached`."""
        epoch, epochs, positions = self._epoch, self._epochs, self._positions
        possible = 0 <= seq < len(epoch.items) and positions.can_have_reached(
            epoch.items[seq], now)
        contradicts = False
        if not proven and frame is not None and not self._repeats and frame > epoch.taken_frame:
            proven = self._is_near(seq, now)
            contradicts = not proven and bool(epoch.items)
        reached = epochs.series.add(seq, now, frame)
        if contradicts:
            self.contradicted = True
        elif (proven or now >= epochs.before.until) and epoch.items:
            if 0 <= seq < len(epoch.items) and (proven or possible):
                self._accept(reached, now)
        elif not self._prove(reached, now):
            # a position that shows it may still arrive
            epochs.unproven[seq] = now + MAX_MESSAGE_DELAY, reached

    def _is_near(self, seq: int, now: float) -> bool:
        """Whether it may be at an item, or was when a late message of now may have been sent."""
        epoch, positions = self._epoch, self._positions
        if not 0 <= seq < len(epoch.items):
            return False
        item = epoch.items[seq]
        return positions.can_have_reached(item, now, self._reach) or positions.was_at(
            item, positions.recent(epoch.since, now))

    def note_end(self, seq: int, now: float) -> None:
        """Take one of this epoch or the next: the mission may have ended."""
        epoch = self._epoch
        if seq == epoch.last_reached:
            self.end_at = now
        if 0 <= seq < len(epoch.items):
            self._moves.passed.note_reached(epoch.items[seq])

    def step(self, now: float) -> None:
        """Judge each REACHED of unknown epoch."""
        unproven, series = self._epochs.unproven, self._epochs.series
        for seq, (until, reached) in list(unproven.items()):
            if self._prove(reached, now) or (
                    series.is_placed(reached) and series.repeats_credited(reached)):
                unproven.pop(seq, None)
            elif now >= until:
                del unproven[seq]
                if self._passed_unseen(reached):
                    self._accept(reached, now)

    def _prove(self, reached: ReachedReport, now: float) -> bool:
        """Credit a REACHED to the epoch at whose item the vehicle was.

        Returns:
            False where the epoch is not known yet.
        """
        epoch, seq = self._epoch, reached.seq
        current = CurrentEpoch(epoch.items, self._moves.reports.reported, epoch.since,
                               epoch.begin, epoch.taken, self._moves.mode.left_at)
        # PX4 may still repeat one of the mission before: a jump over several items is no proof
        repeated = self._epochs.series.repeats_credited(reached)
        if 0 <= seq < len(epoch.items) and not (
                repeated and self._moves.was_jumped_over(seq)) and (
                self._epochs.is_of_current(reached, current, now)):
            self._accept(reached, now)
            return True
        item = None if repeated else (
            self._epochs.previous_item(reached, epoch.items))
        if item is None:
            return False
        if self._epochs.ends_previous(item):
            self.end_at = now
        self._tasks.credit(item)
        self._epochs.series.note_credited(reached)
        return True

    def _passed_unseen(self, reached: ReachedReport) -> bool:
        """Whether it flies a later item, and the positions have a gap since this one."""
        epoch, seq = self._epoch, reached.seq
        if self._epochs.series.repeats_credited(reached):
            return False
        return (0 <= seq < len(epoch.items) and epoch.current is not None and seq < epoch.current
                and self._positions.not_seen_at(epoch.items[seq], epoch.since))

    def _accept(self, reached: ReachedReport, now: float) -> None:
        epoch, seq = self._epoch, reached.seq
        if seq == epoch.last_reached and self.last != seq:
            self.end_at = now
        self.last = seq
        self._epochs.series.note_credited(reached)
        self.seqs.add(seq)
        if epoch.current is None or seq >= epoch.current:
            if epoch.current is not None and epoch.current < seq:
                self._moves.claim(epoch.current, seq, now)
            self._advance_after(seq, now)
        self._tasks.credit(epoch.items[seq])

    def _advance_after(self, seq: int, now: float) -> None:
        """Make the item after `seq` current, flown since `seq` was reached."""
        epoch, positions = self._epoch, self._positions
        item, since = epoch.items[seq], positions.recent(epoch.since, now)
        at = None if item.position is None else positions.path.visited_at(
            item.position, item.radius, since)
        epoch.current, self._moves.set_by_other = seq + 1, None
        epoch.since = since if at is None else at
