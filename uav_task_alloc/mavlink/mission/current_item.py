# SPDX-License-Identifier: Apache-2.0
"""MISSION_CURRENT: which item is flown, and what its change claims about the items before it.

A current item that has moved on is a claim that is judged by the vehicle's positions; an item
that another station has set, or that we have set, is none.
"""
from __future__ import annotations

import math
from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.actions import SETTLE
from uav_task_alloc.mavlink.mission.completed_tasks import CompletedTasks
from uav_task_alloc.mavlink.mission.current_item_reports import CurrentItemReports
from uav_task_alloc.mavlink.mission.epoch import Epoch
from uav_task_alloc.mavlink.mission.item import Item, leg_count
from uav_task_alloc.mavlink.mission.mission_mode import MissionMode
from uav_task_alloc.mavlink.mission.passed_items import NO_TASKS, Claim, PassedItems, flown_nearby
from uav_task_alloc.mavlink.mission.position_history import MAX_MESSAGE_DELAY, PositionHistory
from uav_task_alloc.mavlink.mission.reached_epoch import ReachedEpoch
from uav_task_alloc.mavlink.transport.frame_log import FrameLog

_SILENT = 3.0  # [s] without a frame after which a vehicle may be lost


class CurrentItem:
    """Moves the current item of an epoch, and keeps the claims about the items passed.

    Each `seq` is an index without home; `now` is steady time [s].

    Args:
        epoch: the mission on board.
        tasks: of the vehicle.
        positions: of the vehicle.
        epochs: the REACHED of this epoch and of the previous one.
        frames: numbers of the frames received.
    """

    def __init__(self, epoch: Epoch, tasks: CompletedTasks, positions: PositionHistory,
                 epochs: ReachedEpoch, frames: FrameLog) -> None:
        self._epoch, self._tasks, self._positions = epoch, tasks, positions
        self._epochs, self._frames = epochs, frames
        self.mode = MissionMode(positions, frames)
        self.passed = PassedItems(frames, positions)
        self.reports = CurrentItemReports()
        self.skipped: deque[str] = deque()  # tasks skipped by another station
        self.passed_over: deque[Item] = deque()  # passed, and not known to be flown
        self.set_by_other: int | None = None  # the current item, where another station set it
        # vehicle time [s] at which the current item was reported in another mode last
        self._unflown_until = -math.inf
        # item and when [s] a report of another mode set it back, as that of a restart does
        self.set_back_from: tuple[int, float] | None = None
        self._after_skipped: int | None = None  # the item after those that were skipped
        # number of the newest frame at the first report since the mission is flown to its end
        self._finished_frame: int | None = None

    def begin(self, start: int | None, now: float) -> None:
        """Begin an epoch at an item that the vehicle will report; None: it is not known."""
        self.reports.begin(start, now)
        self.set_by_other = self.set_back_from = None

    def invalidate(self, now: float, until: float) -> None:
        """End the epoch, and complete what the positions have shown so far.

        Args:
            now: steady time [s].
            until: vehicle time [s] after which another mission may have been flown.
        """
        for item in self.passed.seen():
            self._tasks.complete(item.task, item.place)
        active, since = self._active_at_end(now), max(self._epoch.since, self.mode.entered_at)
        # after the last frame that shows mission mode a pilot may have taken it
        if active is not None and self._positions.was_at(
                active, since, min(self.mode.shown_until, until), close=0.0):
            self._tasks.credit(active)
        self.reports.clear()
        self.passed.clear()
        self.set_by_other = None
        self.mode.forget()
        self._unflown_until = -math.inf

    def _active_at_end(self, now: float) -> Item | None:
        """The item that was flown until the last position before a restart; None: not known.

        The mode and the current item of a restarted vehicle may come before its clock shows it.
        """
        epoch, back = self._epoch, self.set_back_from
        if not self.mode.in_mission and self._positions.path.newest > self.mode.left_seen:
            return None
        if back is not None and now - back[1] < MAX_MESSAGE_DELAY and back[0] < len(epoch.items):
            return epoch.items[back[0]]
        return epoch.active if self.reports.reported == epoch.current else None

    def note_set(self, seq: int, now: float) -> None:
        """Note that we have set the current item: the items skipped by that were not flown."""
        self.reports.note_set(seq, now, self._frames.newest)
        self.set_by_other = None
        self._epoch.current, self._epoch.since = seq, self._positions.path.newest

    def current_since(self, item: Item) -> float:
        """Vehicle time [s] from which an item is flown that is current, or was just passed."""
        latest = max(self._epoch.since, self.mode.entered_at)
        if not self.passed.claims:
            return latest
        return next((claim.since for claim in self.passed.claims if any(
            item is one for one in claim.items)), latest)

    def was_jumped_over(self, seq: int) -> bool:
        """Whether another station may have set the current item past an item."""
        item = self._epoch.items[seq]
        return (self.set_by_other is not None and seq < self.set_by_other) or any(
            len(claim.items) > 1 and any(item is one for one in claim.items)
            for claim in self.passed.claims)

    def note_mission_left(self, now: float) -> None:
        """Note that the vehicle has left the list: a task resumed later starts again."""
        self.mode.note_other_mode(now)
        self._epoch.started = self.set_by_other = None

    def note_report(self, seq: int, now: float, flying: bool, frame: int | None = None,
                    restarted: bool = False, flew: bool = False) -> None:
        """Take a MISSION_CURRENT; items before it are claimed to be flown.

        Args:
            seq: index without home.
            now: steady time [s].
            flying: whether the vehicle is in mission mode in the air.
            frame: number of its frame; None: not known.
            restarted: whether the mission was complete, and has begun again without a command.
            flew: whether it was sent in mission mode, which the vehicle has left since.
        """
        if flew and frame is not None:
            self.mode.note_flew(frame)
        reports, epoch = self.reports, self._epoch
        reports.previous_frame = reports.last_frame
        # the last item stays current once it is reached
        if not flying and seq == epoch.current and seq < epoch.last_flown and frame is not None:
            self._unflown_until = self._positions.sent_between(frame)[0]
        if not reports.is_old(seq, now, frame):
            self._move(seq, now, flying, frame)
        reports.note(seq, frame)
        known = None if not flying or epoch.current is None else (
            min(epoch.current, len(epoch.items) - 1))
        restarted = self._flies_after_end(frame) or restarted
        if reports.was_set_back(seq, now, known) or (
                restarted and known is not None and seq < known and not reports.awaits_set):
            self._fly_from(seq, now)

    def _flies_after_end(self, frame: int | None) -> bool:
        """Whether a report was sent after the mission had been flown to its end.

        The first such report may have been sent before that.
        """
        if not self._epoch.finished:
            self._finished_frame = None
            return False
        if self._finished_frame is None:
            self._finished_frame = self._frames.newest
        return frame is not None and frame > self._finished_frame

    def _fly_from(self, seq: int, now: float, earliest: float = -math.inf) -> None:
        """Set the current item, which may be flown since before the message arrived.

        Args:
            seq: index without home.
            now: steady time [s] at which that was received.
            earliest: vehicle time [s] until which another item was.
        """
        epoch = self._epoch
        epoch.current, epoch.since = seq, self._positions.recent(max(epoch.since, earliest), now)

    def _move(self, seq: int, now: float, flying: bool, frame: int | None) -> None:
        epoch = self._epoch
        if not flying:
            if seq < len(epoch.items) and not (epoch.finished and seq == len(epoch.items) - 1):
                if epoch.current is not None and epoch.current < seq:
                    self.claim(epoch.current, seq, now, frame, in_flight=False)
                if epoch.current is not None and epoch.current > seq:
                    self.set_back_from = epoch.current, now
                epoch.current = seq  # set by another station; nothing is flown
        elif epoch.current is not None and epoch.current < seq <= len(epoch.items):
            self._after_skipped, until = None, self._reported_until(epoch.current)
            self.claim(epoch.current, seq, now, frame)
            self._fly_from(seq, now, until)
            self.set_by_other = seq if self._after_skipped == seq else self.set_by_other

    def note_mission_complete(self, seq: int, now: float, frame: int | None = None) -> None:
        """Take the vehicle's report that its mission is complete up to item `seq`."""
        epoch = self._epoch
        end = min(seq + 1, len(epoch.items))
        if (epoch.current is not None and not self.reports.awaits_set
                and epoch.current < end):
            self.claim(epoch.current, end, now)  # complete since an unknown frame
            self._fly_from(end, now)

    def judge(self, now: float) -> None:
        """Complete those passed items that the positions show to be flown."""
        for claim in self.passed.claims:
            judged = self.passed.judge(claim, tuple(
                i for i in claim.items if i.task not in self._tasks), now,
                self.mode.left_unseen_since(claim))
            for item in judged.flown:
                self._tasks.complete(item.task, item.place)
            self._pass_over(judged.passed_over, claim)

        if now - self._frames.received_at > _SILENT:
            self._complete_way()

    def _complete_way(self) -> None:
        """Complete the task of a vehicle that may be lost, where its way is flown to the end.

        Only the end of actions and the stop of a second there are missing.
        """
        items, begin = self._epoch.items, self._epoch.current
        end = None if begin is None else next(
            (n for n in range(begin, len(items)) if items[n].completes), None)
        if begin is None or end is None or not items[end].along:
            return
        last, before = items[end], next(
            (n for n in reversed(range(begin)) if items[n].position is not None), None)
        if before is not None and last.task not in self._tasks and (
                last.params[0] <= SETTLE and items[before].along
                and all(item.task == last.task and item.position in (None, last.position)
                        for item in items[before:end])
                and self._tasks.is_covered(last.task)):
            self._tasks.complete(last.task, last.place)

    def _pass_over(self, items: tuple[Item, ...], claim: Claim) -> None:
        self.passed_over.extend(items)
        if not claim.in_flight:
            return
        self.skipped.extend(item.task for item in items)
        if items and claim.epoch == self._epoch.number:
            self.set_by_other = self._epoch.current

    def passed_in_flight(self) -> tuple[frozenset[str], int]:
        """Return the pending tasks passed in mission mode, and whether it has left that unseen.

        Returns:
            Their ids, and since then 0: it has not, 1: it has, 2: perhaps, as nothing has shown
            the mode since.
        """
        if not self.passed.claims:  # as at most calls
            return NO_TASKS, 0
        claims = [claim for claim in self.passed.claims
                  if claim.in_flight or self.mode.left_unseen_since(claim)]
        if not claims:
            return NO_TASKS, 0
        left = 1 if any(map(self.mode.left_unseen_since, claims)) else 2 * self.mode.may_have_left
        return frozenset(item.task for claim in claims for item in claim.items), left

    def claim(self, begin: int, end: int, now: float, frame: int | None = None,
              in_flight: bool = True) -> None:
        """Claim that the items in [begin, end) were flown.

        Args:
            begin: index of the first item.
            end: index after the last item.
            now: steady time [s].
            frame: number of the frame that shows it; None: not known.
            in_flight: whether the vehicle was in mission mode in the air.
        """
        epoch, positions = self._epoch, self._positions
        items = tuple(item for item in epoch.items[begin:end]
                      if item.completes and item.task not in self._tasks)
        skips = leg_count(epoch.items[begin:end]) > 1
        if in_flight and skips and self.reports.reported == begin and (
                positions.at_once(self.reports.last_frame, frame)):
            items = self._skip_others(items, flown_nearby(items, epoch.items[begin]), end)
        if not items:
            return
        route = tuple(item for item in epoch.items[begin:] if item.position is not None)
        until = positions.vehicle_time(now)
        if not self.mode.in_mission:  # positions after it left mission mode prove nothing
            until = min(until, max(epoch.since, self.mode.flown_until(frame, until)))
        since = max(epoch.since, self._unflown_until) if in_flight else epoch.since
        self.passed.add(Claim(
            items, route, since, until, now + MAX_MESSAGE_DELAY, epoch.number,
            self._frames_of_reached(begin, end, now, frame), frame, skips, in_flight,
            first=epoch.items[begin], others_since=self._reported_until(begin)))

    def _reported_until(self, seq: int) -> float:
        """Vehicle time [s] until which an item was reported as current; -inf: it was not."""
        reports = self.reports
        if reports.reported != seq or reports.last_frame is None:
            return -math.inf
        return self._positions.sent_between(reports.last_frame)[0]

    def _frames_of_reached(self, begin: int, end: int, now: float,
                           frame: int | None) -> tuple[int, int] | None:
        """Frames between which a REACHED of the passed items would be; None: not known."""
        previous = self.reports.previous_frame
        if frame is None or previous is None:
            return None
        after = self._epoch.items[end:end + 1]
        if after and after[0].command == dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return None  # PX4 sends no REACHED of the item before it
        if self._epochs.series.named_lately(begin, end, now):
            return None  # one came, perhaps a repetition: only the positions decide
        return previous, frame

    def _skip_others(self, items: tuple[Item, ...], candidates: tuple[Item, ...],
                     end: int) -> tuple[Item, ...]:
        """Note all but the candidates as skipped by another station; returns the candidates."""
        skipped = tuple(i for i in items if i not in candidates)
        self.passed_over.extend(skipped)
        self.skipped.extend(item.task for item in skipped)
        if skipped:
            self._after_skipped = end
        return candidates
