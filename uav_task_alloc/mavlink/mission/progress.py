# SPDX-License-Identifier: Apache-2.0
"""Progress of a mission: (epoch, seq) -> task, an epoch being one verified upload.

MISSION_ITEM_REACHED completes the item it names, and no other; while one of the previous epoch
may still arrive, only where the vehicle was at that item (`reached_epoch`). A current item that
has moved on is a claim, which is judged by the vehicle's positions (`passed_items`).
"""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.mission.current_item_reports import CurrentItemReports
from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.items import Item, all_alike
from uav_task_alloc.mavlink.mission.passed_items import Claim, PassedItems, flown_nearby
from uav_task_alloc.mavlink.mission.position_history import MAX_MESSAGE_DELAY, PositionHistory
from uav_task_alloc.mavlink.mission.reached_epoch import (
    REPEAT_WINDOW,
    CurrentEpoch,
    PreviousEpoch,
    ReachedEpoch,
)
from uav_task_alloc.mavlink.transport.frame_log import FrameLog
from uav_task_alloc.model import Point, Task


@dataclass(frozen=True, slots=True)
class ProgressEvent:
    """A task started or completed."""

    task: str
    completed: bool
    while_offline: bool = False  # it was flown while no bridge was connected


class ProgressTable:
    """The items on board, the one being flown, and the completed tasks.

    Each `seq` and `current` is an index without home; `now` is steady time [s].

    Args:
        frames: numbers of the frames received from the vehicle.
        repeats: whether the autopilot repeats MISSION_ITEM_REACHED (PX4: 10 times at 1 Hz).
    """

    def __init__(self, frames: FrameLog | None = None, repeats: bool = False) -> None:
        self._positions = PositionHistory()
        self._frames, self._repeats = frames or FrameLog(), repeats
        self._passed = PassedItems(self._frames, self._positions)
        self._epochs = ReachedEpoch(self._positions, repeats, self._frames)
        self._currents = CurrentItemReports()
        self.path = self._positions.path
        self.epoch = 0
        self.items: tuple[Item, ...] = ()
        self.current: int | None = None  # len(items): flown to the end
        self.completed: dict[str, Point | None] = {}  # in order, of all epochs; where
        self._listed_at: dict[str, Point] = {}  # positions of the tasks of the list
        self.events: deque[ProgressEvent] = deque()
        self.skipped: deque[str] = deque()  # tasks skipped by another station
        self.reached_seqs: set[int] = set()  # by REACHED, in this epoch
        self.passed_over: deque[Item] = deque()  # passed, and not known to be flown
        self.set_by_other: int | None = None  # the current item, where another station set it
        self._started: str | None = None
        self._left_at = -math.inf  # vehicle time [s] at which it left mission mode
        self._reached: int | None = None  # the last REACHED of this epoch
        self._after_skipped: int | None = None  # the item after those that were skipped
        self._since = -math.inf  # vehicle time [s] from which the current item is flown
        self._since_begin = -math.inf  # vehicle time [s] at which this epoch began
        self._taken = -math.inf  # vehicle time [s] before which it was not on board
        self._taken_frame = math.inf  # number of the last frame before it was on board
        self._end_at = -math.inf  # [s] REACHED of the last item was received

    @property
    def active(self) -> Item | None:
        """The item being flown."""
        if self.current is None or self.current >= len(self.items):
            return None
        return self.items[self.current]

    @property
    def finished(self) -> bool:
        """Whether the mission is flown to its end."""
        return bool(self.items) and self.current == len(self.items)

    @property
    def pending(self) -> frozenset[str]:
        """Tasks that may be completed: the evidence may still arrive."""
        return frozenset(item.task for claim in self._passed.claims for item in claim.items)

    @property
    def passed_in_order(self) -> frozenset[str]:
        """The pending tasks that were passed one by one, as a mission is flown."""
        return frozenset(item.task for claim in self._passed.claims if not claim.skips
                         for item in claim.items)

    @property
    def last_flown(self) -> int:
        """The index of the last item with a position."""
        return len(self.items) - 1 - int(self.returns)

    @property
    def returns(self) -> bool:
        """Whether the mission ends with NAV_RETURN_TO_LAUNCH."""
        return bool(self.items) and self.items[-1].command == dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH

    def may_end(self, now: float) -> bool:
        """Whether the mission may be at its end, or was when it was just replaced."""
        if self.items and self.current is not None and self.current >= self.last_flown:
            return True
        return self._epochs.may_have_ended(now)

    def ended_lately(self, now: float, within: float) -> bool:
        """Whether REACHED of the last item, of this or the previous epoch, is `within` [s] old."""
        return now - self._end_at <= within

    def begin(self, items: tuple[Item, ...], start: int | None, now: float,
              read: bool = False, since: float | None = None) -> None:
        """Begin a new epoch, to which REACHED and CURRENT refer from now on.

        Args:
            items: on board, without home.
            start: index of the one being flown; None: not known.
            now: steady time [s].
            read: whether they were found on board, since an unknown time.
            since: vehicle time [s] from which it may have flown them; None: now.
        """
        self.epoch += 1
        if (self.items or read) and not all_alike(self.items, items):
            self._epochs.begin(PreviousEpoch(
                self.items, self._since, self._positions.vehicle_time(now), self.may_end(now),
                now + REPEAT_WINDOW, self._taken))
        self.items, self.current, self._reached = items, start, None
        self.reached_seqs.clear()
        self._currents.begin(start, now)
        self.set_by_other = None
        known_since = self.path.newest if since is None else since
        self._since = self._since_begin = -math.inf if read else known_since
        self._taken = -math.inf if since is None else since
        self._taken_frame = math.inf if since is None else self._frames.newest

    def extend(self, items: tuple[Item, ...]) -> None:
        """Begin a new epoch whose first items are those of the last one; the vehicle flies on."""
        self.epoch += 1
        self.items = items

    def invalidate(self) -> None:
        """End the epoch: the mission on board is unknown."""
        for item in self._passed.seen():
            self._complete(item.task, item.position)
        self.items, self.current, self._reached = (), None, None
        self._epochs.clear()
        self._currents.clear()
        self._started = self.set_by_other = None
        self._passed.clear()
        self._positions.clear()
        self._since = -math.inf

    def retag(self, items: tuple[Item, ...]) -> None:
        """Replace the items by the same items with their tasks."""
        self.items = items

    def add_position(
        self, sample: PositionSample, newest: bool, now: float, frame: int | None = None
    ) -> None:
        """Add a position of the vehicle; see `PositionHistory.add`."""
        self._positions.add(sample, newest, now, frame)

    def begin_set_current(self, seq: int) -> None:
        """Note that we are about to set the current item; it may be reported before the ack."""
        self._currents.begin_set(seq)

    def note_set_current(self, seq: int, now: float) -> None:
        """Note that we have set the current item: the items skipped by that were not flown."""
        self._currents.note_set(seq, now)
        self.current, self.set_by_other, self._since = seq, None, self.path.newest

    def note_mission_mode(self) -> None:
        """Note that the vehicle flies its mission: the task of the current item has started."""
        item = self.active
        if item and item.task and item.task != self._started and item.task not in self.completed:
            self._started = item.task
            self.events.append(ProgressEvent(item.task, completed=False))

    def note_mission_left(self) -> None:
        """Note that the vehicle has left the list: a task resumed later starts again."""
        if self._started is not None:
            self._left_at = self.path.newest
        self._started = self.set_by_other = None

    def note_reached(self, seq: int, now: float, proven: bool = False,
                     frame: int | None = None) -> None:
        """Take a MISSION_ITEM_REACHED, which may be a repetition.

        Args:
            seq: index without home.
            now: steady time [s] at which it was received.
            proven: whether it is known to be of this epoch.
            frame: its number. What is sent once, after the mission was taken, is of it.
        """
        proven = proven or (
            frame is not None and not self._repeats and frame > self._taken_frame)
        when = self._epochs.first_at(seq, now)
        repetition = self._epochs.note_reached(seq, now)
        if (proven or now >= self._epochs.before.until) and self.items:
            if 0 <= seq < len(self.items) and (
                    proven or self._positions.can_have_reached(self.items[seq], now)):
                self._accept(seq, now)
        elif not self._prove(seq, now, when, repetition) and not repetition:
            # a position that shows it may still arrive
            self._epochs.unproven[seq] = now + MAX_MESSAGE_DELAY, when

    def note_repeated(self, seq: int, now: float) -> None:
        """Note that the last REACHED was repeated, also while its epoch was unknown."""
        self._epochs.note_repeated(seq, now)

    def reached_first_at(self, seq: int, now: float) -> float:
        """See `ReachedEpoch.first_at`."""
        return self._epochs.first_at(seq, now)

    def _prove(self, seq: int, now: float, when: float, repetition: bool = False) -> bool:
        """Credit a REACHED received at `when` [s] to the epoch at whose item the vehicle was.

        Returns:
            False where the epoch is not known yet.
        """
        epoch = CurrentEpoch(self.items, self._currents.reported, self._since,
                             self._since_begin, self._taken)
        if 0 <= seq < len(self.items) and self._epochs.is_of_current(seq, epoch, now, when):
            self._accept(seq, now)
            return True
        item = None if repetition else self._epochs.previous_item(seq, self.items, when)
        if item is None:
            return False
        if self._epochs.ends_previous(item):
            self._end_at = now
        self.credit(item)
        self._epochs.credited = seq
        return True

    def _passed_unseen(self, seq: int) -> bool:
        """Whether it flies a later item, and the positions have a gap since this one."""
        return (0 <= seq < len(self.items) and self.current is not None and seq < self.current
                and self._positions.not_seen_at(self.items[seq], self._since))

    def _accept(self, seq: int, now: float) -> None:
        if seq == self.last_flown and self._reached != seq:
            self._end_at = now
        self._reached = self._epochs.credited = seq
        self.reached_seqs.add(seq)
        if self.current is None or seq >= self.current:
            if self.current is not None and self.current < seq:
                self._claim(self.current, seq, now)
            self._advance_after(seq)
        item = self.items[seq]
        if item.completes:
            self._complete(item.task, item.position)

    def note_end(self, seq: int, now: float) -> None:
        """Note a REACHED of this epoch or the next: the mission may have ended."""
        if seq == self.last_flown:
            self._end_at = now
        if 0 <= seq < len(self.items):
            self._passed.note_reached(self.items[seq])

    def note_current(self, seq: int, now: float, flying: bool, frame: int | None = None) -> None:
        """Take a MISSION_CURRENT; items before it are claimed to be flown.

        Args:
            seq: index without home.
            now: steady time [s].
            flying: whether the vehicle is in mission mode in the air.
            frame: number of its frame; None: not known.
        """
        currents = self._currents
        currents.previous_frame = currents.last_frame
        if not currents.is_old(seq, now):
            self._move(seq, now, flying, frame)
        currents.note(seq, frame)
        if currents.was_set_back(seq, now, None if not flying or self.current is None else (
                min(self.current, len(self.items) - 1))):
            self._fly_from(seq)

    def _fly_from(self, seq: int) -> None:
        """Set the current item, which may be flown since before the message arrived."""
        self.current, self._since = seq, self._positions.recent(self._since)

    def _move(self, seq: int, now: float, flying: bool, frame: int | None) -> None:
        if self._started is None or not flying:
            if seq < len(self.items) and not (self.finished and seq == len(self.items) - 1):
                if self.current is not None and self.current < seq:
                    self._claim(self.current, seq, now, frame, in_flight=False)
                self.current = seq  # set by another station; nothing is flown
        elif self.current is not None and self.current < seq <= len(self.items):
            self._after_skipped = None
            self._claim(self.current, seq, now, frame)
            self._fly_from(seq)
            self.set_by_other = seq if self._after_skipped == seq else self.set_by_other

    def note_mission_complete(self, seq: int, now: float, frame: int | None = None) -> None:
        """Take the vehicle's report that its mission is complete up to item `seq`."""
        end = min(seq + 1, len(self.items))
        if (self.current is not None and not self._currents.awaits_set
                and self._started is not None and self.current < end):
            self._claim(self.current, end, now, frame)
            self._fly_from(end)

    def step(self, now: float) -> None:
        """Judge the open claims, and each REACHED of unknown epoch."""
        unproven = self._epochs.unproven
        for seq, (until, when) in list(unproven.items()):
            if self._prove(seq, now, when):
                unproven.pop(seq, None)
            elif now >= until:
                del unproven[seq]
                if self._passed_unseen(seq):
                    self._accept(seq, now)
        for claim in self._passed.claims:
            judged = self._passed.judge(claim, tuple(
                i for i in claim.items if i.task not in self.completed), now)
            for item in judged.flown:
                self._complete(item.task, item.position)
            self._pass_over(judged.passed_over, claim)

    def _pass_over(self, items: tuple[Item, ...], claim: Claim) -> None:
        self.passed_over.extend(items)
        if not claim.in_flight:
            return
        self.skipped.extend(item.task for item in items)
        if items and claim.epoch == self.epoch:
            self.set_by_other = self.current

    def complete_offline(self, tasks: Iterable[Task]) -> None:
        """Complete tasks that were flown while no bridge was connected."""
        for task in tasks:
            self._complete(task.id, task.position, while_offline=True)

    def credit(self, item: Item) -> None:
        """Complete the task of an item, of whichever epoch."""
        if item.completes:
            self._complete(item.task, item.position)

    def set_listed_tasks(self, tasks: Iterable[Task]) -> None:
        """Set the tasks of the list; a task completed at another position is to be flown again."""
        self._listed_at = {task.id: task.position for task in tasks}
        for task in tasks:
            if self.completed.get(task.id) not in (None, task.position):
                self.forget(task.id)

    def forget(self, task: str) -> None:
        """Forget the completion of a task id, which another task has now."""
        self.completed.pop(task, None)
        self._started = None if self._started == task else self._started

    def was_at(self, item: Item, since: float | None = None,
               until: float = math.inf) -> bool:
        """Whether the positions show that an item was reached between two vehicle times [s]."""
        return self._positions.was_at(item, self._since if since is None else since, until)

    def was_at_by(self, item: Item, when: float) -> bool:
        """Whether an item was reached before a message received at `when` [s]."""
        return self.was_at(item, until=self._positions.vehicle_time(when))

    def was_exactly_at(self, item: Item, when: float) -> bool:
        """Whether it was within the radius of an item before a message at `when` [s]."""
        return self._positions.was_at(
            item, self._since, self._positions.vehicle_time(when), close=0.0)

    def near_one(self, item: Item, other: Item | None, when: float) -> bool:
        """Whether it was near one item, but not another, before a message at `when` [s]."""
        return self._positions.near_one(item, other, when)

    def _claim(self, begin: int, end: int, now: float, frame: int | None = None,
               in_flight: bool = True) -> None:
        items = tuple(item for item in self.items[begin:end]
                      if item.completes and item.task not in self.completed)
        if in_flight and end - begin > 1 and self._currents.reported == begin and (
                self._positions.at_once(self._currents.last_frame, frame)):
            items = self._skip_others(items, flown_nearby(items, self.items[begin]), end)
        if items:
            route = tuple(item for item in self.items[begin:] if item.position is not None)
            until = self._positions.vehicle_time(now)
            if self._started is None:  # positions after it left mission mode prove nothing
                until = min(until, max(self._since, self._left_at))
            self._passed.add(Claim(
                items, route, self._since, until,
                now + MAX_MESSAGE_DELAY, self.epoch,
                self._frames_of_reached(begin, end, now, frame), frame, end - begin > 1,
                in_flight))

    def _frames_of_reached(self, begin: int, end: int, now: float,
                           frame: int | None) -> tuple[int, int] | None:
        """Frames between which a REACHED of the passed items would be; None: not known."""
        previous = self._currents.previous_frame
        if frame is None or previous is None:
            return None
        if self.items[end:] and self.items[end].command == dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return None  # PX4 sends no REACHED of the item before it
        if self._epochs.reached_recently(begin, end, now):
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

    def _advance_after(self, seq: int) -> None:
        """Make the item after `seq` current, flown since `seq` was reached."""
        item = self.items[seq]
        at = None if item.position is None else self.path.visited_at(
            item.position, item.radius, self._positions.recent(self._since))
        self.current, self.set_by_other = seq + 1, None
        self._since = self._positions.recent(self._since) if at is None else at

    def _complete(self, task: str, place: Point | None, while_offline: bool = False) -> None:
        if place is not None and self._listed_at.get(task, place) != place:
            return  # the list has it at another position now
        if task not in self.completed:
            self.completed[task] = place
            self.events.append(ProgressEvent(task, completed=True, while_offline=while_offline))
