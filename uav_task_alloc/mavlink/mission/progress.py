# SPDX-License-Identifier: Apache-2.0
"""Progress of a mission: (epoch, seq) -> task, an epoch being one verified upload.

MISSION_ITEM_REACHED completes the item it names (`reached_items`). A current item that has moved
on is a claim about those before it, which is judged by the positions (`current_item`).
"""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from itertools import chain

from uav_task_alloc.mavlink.mission.completed_tasks import CompletedTasks, ProgressEvent
from uav_task_alloc.mavlink.mission.current_item import CurrentItem
from uav_task_alloc.mavlink.mission.end_before_restart import EndBeforeRestart
from uav_task_alloc.mavlink.mission.epoch import Epoch
from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.items import Item, all_alike
from uav_task_alloc.mavlink.mission.passed_items import NO_TASKS
from uav_task_alloc.mavlink.mission.piece_coverage import PieceCoverage
from uav_task_alloc.mavlink.mission.position_history import PositionHistory
from uav_task_alloc.mavlink.mission.reached_epoch import REPEAT_WINDOW, PreviousEpoch, ReachedEpoch
from uav_task_alloc.mavlink.mission.reached_items import ReachedItems
from uav_task_alloc.mavlink.mission.reached_series import ReachedSeries
from uav_task_alloc.mavlink.mission.report_evidence import ReportEvidence
from uav_task_alloc.mavlink.mission.stop_items import place_of
from uav_task_alloc.mavlink.transport.frame_log import FrameLog
from uav_task_alloc.model import Point, Task


class ProgressTable:
    """The items on board, the one being flown, and the completed tasks.

    Each `seq` and `current` is an index without home; `now` is steady time [s].

    Args:
        frames: numbers of the frames received from the vehicle.
        repeats: whether the autopilot repeats MISSION_ITEM_REACHED (PX4: 10 times at 1 Hz).
        plane: whether the vehicle turns as wide as a plane.

    Arguments of methods:
        now: steady time [s].
        seq, start: of an item of the mission on board.
        item, items: of a mission.
        sample: a position of the vehicle.
        newest: the sample did not arrive late.
        frame: number of its frame; None: not known.
        flying: the vehicle is in mission mode.
        restarted: the mission began again from its first item.
        flew: it was in mission mode, and has left it since.
        task, tasks: ids.

    Attributes:
        completed: the completed tasks of all epochs in order, and where each was [m] ENU.
        events: tasks that started or completed; this and the next are taken by the caller.
        evidence: whether a report can be of a mission, by the positions.
        passed: the items that were passed and may be completed still.
        skipped: tasks skipped by another station.
        passed_over: items passed and not known to be flown.
        uncovered: tasks whose way was not flown as a whole.
    """

    def __init__(self, frames: FrameLog | None = None, repeats: bool = False,
                 plane: bool = False) -> None:
        self._frames = frames or FrameLog()
        self.positions = PositionHistory()
        self._epoch, self._tasks = Epoch(), CompletedTasks()
        self.coverage = PieceCoverage(plane)
        self._tasks.is_covered = self._is_covered
        self._stepped_at = -math.inf  # [s]
        self._epochs = ReachedEpoch(
            self.positions, ReachedSeries(self.positions, repeats, self._frames))
        self._moves = CurrentItem(
            self._epoch, self._tasks, self.positions, self._epochs, self._frames)
        self._mode = self._moves.mode
        self._reached = ReachedItems(
            self._epoch, self._tasks, self.positions, self._epochs, self._moves, repeats,
            plane)
        self.end_before_restart = EndBeforeRestart(
            self._epoch, self._tasks, self.positions, self._moves)
        self.evidence = ReportEvidence(
            self._epoch, self.positions, self._mode, self._epochs.series)
        self.path, self.previous_returned = self.positions.path, self._epochs.has_returned
        self.reports, self.passed = self._moves.reports, self._moves.passed
        self.completed: dict[str, Point | None] = self._tasks.places
        self.events: deque[ProgressEvent] = self._tasks.events
        self.skipped: deque[str] = self._moves.skipped
        self.passed_over: deque[Item] = self._moves.passed_over
        self.uncovered: deque[str] = self._tasks.uncovered

    @property
    def epoch(self) -> int:
        """Number of the epoch."""
        return self._epoch.number

    @property
    def items(self) -> tuple[Item, ...]:
        """The items on board, without home."""
        return self._epoch.items

    @property
    def current(self) -> int | None:
        """Index of the item being flown; `len(items)`: flown to the end; None: not known."""
        return self._epoch.current

    @property
    def active(self) -> Item | None:
        """The item being flown."""
        return self._epoch.active

    @property
    def finished(self) -> bool:
        """Whether the mission is flown to its end."""
        return self._epoch.finished

    @property
    def last_flown(self) -> int:
        """The index of the last item with a position."""
        return self._epoch.last_flown

    @property
    def returns(self) -> bool:
        """Whether the mission ends with NAV_RETURN_TO_LAUNCH, or with NAV_LAND."""
        return self._epoch.returns

    @property
    def returning(self) -> bool:
        """Whether the item that returns or lands is next, is being flown, or is flown."""
        return self._epoch.returning

    @property
    def set_by_other(self) -> int | None:
        """The current item, where another station has set it."""
        return self._moves.set_by_other

    @property
    def reached_seqs(self) -> set[int]:
        """The items of this epoch of which a REACHED was received."""
        return self._reached.seqs

    @property
    def pending(self) -> frozenset[str]:
        """Tasks that may be completed: the evidence may still arrive."""
        claims, doubtful = self.passed.claims, self._tasks.doubtful
        return frozenset(chain((i.task for claim in claims for i in claim.items), doubtful)) if (
            claims or doubtful) else NO_TASKS

    @property
    def done(self) -> frozenset[str]:
        """Ids of the completed tasks, and of those that are pending."""
        return self.pending.union(self.completed)

    @property
    def passed_in_flight(self) -> tuple[frozenset[str], int]:
        """See `CurrentItem.passed_in_flight`."""
        return self._moves.passed_in_flight()

    def may_end(self, now: float) -> bool:
        """Whether the mission may be at its end, or was when it was just replaced."""
        return self._epoch.at_end or self._epochs.may_have_ended(now)

    @property
    def ended_at(self) -> float:
        """When [s] REACHED of the last item was received, of this or the previous epoch."""
        return self._reached.end_at

    def begin(self, items: tuple[Item, ...], start: int | None, now: float,
              read: bool = False, since: float | None = None) -> None:
        """Begin a new epoch, to which REACHED and CURRENT refer from now on.

        Args:
            items: on board, without home.
            start: index of the one being flown; None: not known.
            now: steady time [s].
            read: whether they were found on board, since an unknown time.
            since: vehicle time [s] from which it may have flown them; None: now, or not known
                where they were found on board.
        """
        epoch = self._epoch
        if (epoch.items or read) and not all_alike(epoch.items, items):
            self._epochs.begin(PreviousEpoch(
                epoch.items, epoch.since, self.positions.vehicle_time(now), self.may_end(now),
                now + REPEAT_WINDOW, epoch.taken, epoch.returning, self.reports.reported))
            self.coverage.note_replaced(
                items[start] if start is not None and start < len(items) else None)
        if since is not None:
            epoch.replace(items, start, since, since, self._frames.newest)
        else:
            epoch.replace(items, start, -math.inf if read else self.path.newest)
        self._reached.begin()
        self._moves.begin(None if read or start == len(items) else start, now)
        if read:
            self._moves.reports.note_read(start if since is None and start != len(items) else None)
        if read and since is None:  # along the way that a mission found on board is on
            self.coverage.continue_at(self.active, self.path.sample)

    def correct(self, items: tuple[Item, ...], start: int, now: float) -> None:
        """Replace the items of this epoch: the vehicle has taken other ones than were sent."""
        self.passed.drop_epoch(self._epoch.number)
        self._epoch.correct(items, start)
        self._reached.begin()
        self._moves.begin(start, now)

    def extend(self, items: tuple[Item, ...]) -> None:
        """Begin a new epoch whose first items are those of the last one; the vehicle flies on."""
        self._epoch.extend(items)

    def invalidate(self, until: float = math.inf) -> None:
        """End the epoch, known until vehicle time `until` [s]: the mission is not known."""
        self.end_before_restart.note_restart(self._stepped_at, self._epochs.series)
        self._moves.invalidate(self._stepped_at, until)
        self._reached.end()
        self._epochs.clear()
        self._epochs.series.clear()
        self._epoch.invalidate()
        self.positions.clear()
        self.coverage.leave()
        self._tasks.doubtful.clear()

    def retag(self, items: tuple[Item, ...]) -> None:
        """Replace the items by the same items with their tasks."""
        self._epoch.items = items

    def add_position(
        self, sample: PositionSample, newest: bool, now: float, frame: int | None = None
    ) -> None:
        """Add a position of the vehicle; see `PositionHistory.add`."""
        if self.positions.add(sample, newest, now, frame):
            self._epoch.restart_clock()
        self._note_active()
        if newest and not self.positions.invalid(now):
            self.coverage.add_position(sample, self.path.fastest)

    def last_positions(self) -> tuple[PositionSample, ...]:
        """The newest position, after those around a gap since the current item is flown."""
        return self.path.last(min((self._epoch.since, *(
            claim.since for claim in self.passed.claims))))

    def has_arrived(self, seq: int) -> bool:
        """Whether the vehicle was within the radius of an item since it is current."""
        items = self._epoch.items
        return seq < len(items) and self.positions.was_inside(
            items[seq], self._moves.current_since(items[seq]))

    def begin_set_current(self, seq: int) -> None:
        """Note that we are about to set the current item; it may be reported before the ack."""
        self._moves.reports.begin_set(seq)

    def note_set_current(self, seq: int, now: float) -> None:
        """Note that we have set the current item: the items skipped by that were not flown."""
        self._moves.note_set(seq, now)

    def note_mission_mode(self) -> None:
        """Note that the vehicle flies its mission: the task of the current item has started."""
        epoch, item = self._epoch, self.active
        self._mode.note_in_mission()
        if item and item.task and item.task != epoch.started and item.task not in self._tasks:
            epoch.started = item.task
            self._tasks.start(item.task)

    def note_in_mission(self, frame: int | None = None) -> None:
        """Note that the vehicle is in mission mode, by whichever command.

        Args:
            frame: number of the frame that shows it; None: an earlier one does.
        """
        self._mode.note_in_mission(frame)

    def note_other_mode(self, now: float) -> None:
        """Note that the vehicle is not in mission mode, by whichever command."""
        self._mode.note_other_mode(now)
        self.coverage.note_left(self._mode.shown_until)

    def note_mission_left(self, now: float) -> None:
        """Note that the vehicle has left the list: a task resumed later starts again."""
        self._moves.note_mission_left(now)
        self.coverage.note_left(self._mode.shown_until)

    def note_reached(self, seq: int, now: float, proven: bool = False,
                     frame: int | None = None) -> None:
        """Take a MISSION_ITEM_REACHED, which may be a repetition.

        Args:
            seq: index without home.
            now: steady time [s] at which it was received.
            proven: whether it is known to be of this epoch.
            frame: its number. What is sent once, after the mission was taken, is of it.
        """
        self.end_before_restart.note_reached(seq, now)
        self._reached.note(seq, now, proven, frame)

    def take_contradicted(self) -> bool:
        """Whether a REACHED has named an item far from the vehicle; True once."""
        contradicted, self._reached.contradicted = self._reached.contradicted, False
        return contradicted

    def note_end(self, seq: int, now: float) -> None:
        """Note a REACHED of this epoch or the next: the mission may have ended."""
        self._reached.note_end(seq, now)

    def note_current(self, seq: int, now: float, flying: bool, frame: int | None = None,
                     restarted: bool = False, flew: bool = False) -> None:
        """Take a MISSION_CURRENT; see `CurrentItem.note_report`."""
        self._moves.note_report(seq, now, flying, frame, restarted, flew)

    def may_have_ended_unseen(self, seq: int) -> bool:
        """Whether it left mission mode while no position came, with item `seq` as the last."""
        return seq == self.last_flown and self._mode.left_unseen

    def note_mission_complete(self, seq: int, now: float, frame: int | None = None) -> None:
        """Take the vehicle's report that its mission is complete up to item `seq`."""
        self._moves.note_mission_complete(seq, now, frame)

    def step(self, now: float) -> None:
        """Judge the open claims, and each REACHED of unknown epoch."""
        self._stepped_at = now
        self._reached.step(now)
        self._moves.judge(now)
        self._note_active()
        self._tasks.judge_doubtful(now)

    def complete_offline(self, tasks: Iterable[Task]) -> None:
        """Complete tasks that were flown while no bridge was connected."""
        for task in tasks:
            if self.coverage.covered_before(task.id):
                self._tasks.complete(task.id, place_of(task), while_offline=True)
            elif task.id not in self._tasks:
                self._tasks.uncovered.append(task.id)

    def credit(self, item: Item) -> None:
        """Complete the task of an item, of whichever epoch."""
        self._tasks.credit(item)

    def set_listed_tasks(self, tasks: Iterable[Task]) -> None:
        """Set the tasks of the list; a task completed at another position is to be flown again."""
        for task in self._tasks.set_listed(tasks):
            self.forget(task)

    def forget(self, task: str) -> None:
        """Forget the completion of a task id, which another task has now."""
        self.completed.pop(task, None)
        self.coverage.pieces.forget(task)
        self._epoch.started = None if self._epoch.started == task else self._epoch.started

    def _note_active(self) -> None:
        self.coverage.note_active(self.active, self._mode.in_mission, self._vehicle_now,
                                  self.items)

    def _vehicle_now(self) -> float:
        return self.positions.vehicle_time(self._stepped_at)

    def _is_covered(self, task: str) -> bool:
        return self.coverage.covers(
            task, self._vehicle_now(), self.path.fastest)
