# SPDX-License-Identifier: Apache-2.0
"""Which task an item stands for: one table for each epoch, an epoch being one verified upload.

REACHED completes the item it names, and no other; while one of the epoch before may still come,
only where the vehicle was (`reached_epoch`). That the current item has moved on is a claim, which
is judged by the vehicle's positions (`passed_items`).
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
    """A task begun or completed."""

    task: str
    completed: bool
    while_offline: bool = False  # it was flown while nobody listened


class ProgressTable:
    """The items on board, the one being flown, and what was completed; seq counts without home."""

    def __init__(self, frames: FrameLog | None = None, repeats: bool = False) -> None:
        self._positions = PositionHistory()
        self._passed = PassedItems(frames or FrameLog(), self._positions)
        self._epochs = ReachedEpoch(self._positions, repeats)
        self._currents = CurrentItemReports()
        self.path = self._positions.path
        self.epoch = 0
        self.items: tuple[Item, ...] = ()
        self.current: int | None = None  # len(items): flown to the end
        self.completed: dict[str, Point | None] = {}  # in order, of all epochs; where
        self._places: dict[str, Point] = {}  # of the tasks of the list
        self.events: deque[ProgressEvent] = deque()
        self.skipped: deque[str] = deque()  # tasks that somebody else has left out
        self.reached_seqs: set[int] = set()  # by REACHED, in this epoch
        self.passed_over: deque[Item] = deque()  # passed, and not seen to be flown
        self.set_by_other: int | None = None  # the current item, where somebody else has set it
        self._started: str | None = None
        self._reached: int | None = None  # the last item of this epoch
        self._passed_over: int | None = None  # the item after those that were left out
        self._since = -math.inf  # [s] of the vehicle's clock: the current item is flown
        self._since_begin = -math.inf  # [s] of the vehicle's clock: this epoch
        self._end_at = -math.inf  # [s] REACHED of the last item came

    @property
    def active(self) -> Item | None:
        """The item being flown."""
        if self.current is None or self.current >= len(self.items):
            return None
        return self.items[self.current]

    @property
    def finished(self) -> bool:
        return bool(self.items) and self.current == len(self.items)

    @property
    def pending(self) -> frozenset[str]:
        """Tasks that may be flown: what shows it may still come."""
        return frozenset(item.task for claim in self._passed.claims for item in claim.items)

    @property
    def last_flown(self) -> int:
        """The index of the last item with a place."""
        return len(self.items) - 1 - int(self.returns)

    @property
    def returns(self) -> bool:
        return bool(self.items) and self.items[-1].command == dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH

    def may_end(self, now: float) -> bool:
        """The last item with a place is flown, or passed; or was, where a swap has just come."""
        if self.items and self.current is not None and self.current >= self.last_flown:
            return True
        return self._epochs.may_have_ended(now)

    def ended_lately(self, now: float, within: float) -> bool:
        """REACHED of the last item has come, of this epoch or of the one before."""
        return now - self._end_at <= within

    def begin(self, items: tuple[Item, ...], start: int | None, now: float,
              read: bool = False, since: float | None = None) -> None:
        """A new epoch: what REACHED and CURRENT mean from now on.

        Args:
            items: on board, without home.
            start: index of the one being flown; None: not known.
            now: [s].
            read: found on board: nobody knows since when.
            since: [s] of the vehicle's clock from which it may have flown them; None: now.
        """
        self.epoch += 1
        if (self.items or read) and not all_alike(self.items, items):
            self._epochs.begin(PreviousEpoch(
                self.items, self._since, self._positions.vehicle_time(now), self.may_end(now),
                now + REPEAT_WINDOW))
        self.items, self.current, self._reached = items, start, None
        self.reached_seqs.clear()
        self._currents.begin(start, now)
        self.set_by_other = None
        self._since = self._since_begin = self.path.newest if since is None else since

    def extend(self, items: tuple[Item, ...]) -> None:
        """A new epoch whose first items are those of the last: the vehicle goes on."""
        self.epoch += 1
        self.items = items

    def invalidate(self) -> None:
        """Nothing is known of what is on board."""
        self.items, self.current, self._reached = (), None, None
        self._epochs.clear()
        self._currents.clear()
        self._started = self.set_by_other = None
        self._passed.clear()
        self._positions.clear()
        self._since = -math.inf

    def retag(self, items: tuple[Item, ...]) -> None:
        """The same items, now known by their tasks."""
        self.items = items

    def add_position(
        self, sample: PositionSample, newest: bool, now: float, frame: int | None = None
    ) -> None:
        """A position of the vehicle, the newest or one that comes late."""
        self._positions.add(sample, newest, now, frame)

    def begin_set_current(self, seq: int) -> None:
        """We are about to set the current item, and may see it before we know that it is done."""
        self._currents.begin_set(seq)

    def note_set_current(self, seq: int, now: float) -> None:
        """We have set the current item: what lies between was not flown."""
        self._currents.note_set(seq, now)
        self.current, self.set_by_other, self._since = seq, None, self.path.newest

    def note_mission_mode(self) -> None:
        """The vehicle flies its mission: the task of the current item has begun."""
        item = self.active
        if item and item.task and item.task != self._started and item.task not in self.completed:
            self._started = item.task
            self.events.append(ProgressEvent(item.task, completed=False))

    def note_mission_left(self) -> None:
        """The vehicle does not fly this list any more: what goes on later starts anew."""
        self._started = self.set_by_other = None

    def note_reached(self, seq: int, now: float, proven: bool = False) -> None:
        """MISSION_ITEM_REACHED, once or many times; `proven`: it is of this epoch."""
        echo = self._epochs.note_reached(seq, now)
        if (proven or now >= self._epochs.before.until) and self.items:
            if 0 <= seq < len(self.items) and (
                    proven or self._positions.can_have_reached(self.items[seq], now)):
                self._accept(seq, now)
        elif not self._prove(seq, now, now, echo) and not echo:  # else it is told again
            self._epochs.unproven[seq] = now + MAX_MESSAGE_DELAY  # a position on its way may tell

    def note_repeated(self, seq: int, now: float) -> None:
        """The last REACHED has come again, also while nobody knew of which mission it was."""
        self._epochs.note_repeated(seq, now)

    def _prove(self, seq: int, now: float, when: float, echo: bool = False) -> bool:
        """Credit REACHED, which came at `when` [s], to the epoch at whose item the vehicle was.

        Returns:
            False: not known yet.
        """
        epoch = CurrentEpoch(self.items, self._currents.reported, self._since, self._since_begin)
        if 0 <= seq < len(self.items) and self._epochs.is_of_current(seq, epoch, now):
            self._accept(seq, now)
            return True
        item = None if echo else self._epochs.previous_item(seq, self.items, when)
        if item is None:
            return False
        if self._epochs.ends_previous(item):
            self._end_at = now
        self.credit(item)
        self._epochs.credited = seq
        return True

    def _passed_unseen(self, seq: int) -> bool:
        """It flies beyond the item, and was not seen for a while."""
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
            self._turn(seq)
        item = self.items[seq]
        if item.completes:
            self._complete(item.task, item.position)

    def note_end(self, seq: int, now: float) -> None:
        """REACHED that may be of this epoch or of the next: perhaps its mission has ended."""
        if seq == self.last_flown:
            self._end_at = now

    def note_current(self, seq: int, now: float, flying: bool, frame: int | None = None) -> None:
        """MISSION_CURRENT in a frame: where it is flying, items before it were passed."""
        currents = self._currents
        currents.previous_frame = currents.last_frame
        if not currents.is_old(seq, now):
            self._move(seq, now, flying, frame)
        currents.note(seq, frame)
        if currents.was_set_back(seq, now, None if not flying or self.current is None else (
                min(self.current, len(self.items) - 1))):
            self._fly_from(seq)

    def _fly_from(self, seq: int) -> None:
        """It flies an item, perhaps since the last positions that were sent."""
        self.current, self._since = seq, self._positions.recent(self._since)

    def _move(self, seq: int, now: float, flying: bool, frame: int | None) -> None:
        if self._started is None or not flying:
            if seq < len(self.items) and not (self.finished and seq == len(self.items) - 1):
                if self.current is not None and self.current < seq:
                    self._claim(self.current, seq, now, frame, sure=False)
                self.current = seq  # somebody sets it; nothing is flown
        elif self.current is not None and self.current < seq <= len(self.items):
            self._passed_over = None
            self._claim(self.current, seq, now, frame)
            self._fly_from(seq)
            self.set_by_other = seq if self._passed_over == seq else self.set_by_other

    def note_mission_complete(self, seq: int, now: float, frame: int | None = None) -> None:
        """The vehicle says that the mission is flown to its item `seq`; more may be appended."""
        end = min(seq + 1, len(self.items))
        if (self.current is not None and not self._currents.awaits_set and self._started is not None
                and self.current < end):
            self._claim(self.current, end, now, frame)
            self._fly_from(end)

    def step(self, now: float) -> None:
        """Judge what was passed without a REACHED, and REACHED that nothing has shown."""
        unproven = self._epochs.unproven
        for seq, until in list(unproven.items()):
            if self._prove(seq, now, until - MAX_MESSAGE_DELAY):
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
            self._leave(judged.left, claim)

    def _leave(self, items: tuple[Item, ...], claim: Claim) -> None:
        """They were passed over."""
        self.passed_over.extend(items)
        if not claim.in_flight:
            return
        self.skipped.extend(item.task for item in items)
        if items and claim.epoch == self.epoch:
            self.set_by_other = self.current

    def complete_offline(self, tasks: Iterable[Task]) -> None:
        """These were flown while nobody listened."""
        for task in tasks:
            self._complete(task.id, task.position, while_offline=True)

    def credit(self, item: Item) -> None:
        """It was reached, whichever mission it was of."""
        if item.completes:
            self._complete(item.task, item.position)

    def set_listed_tasks(self, tasks: Iterable[Task]) -> None:
        """One that was flown at another place is another task, and still to be flown."""
        self._places = {task.id: task.position for task in tasks}
        for task in tasks:
            if self.completed.get(task.id) not in (None, task.position):
                self.forget(task.id)

    def forget(self, task: str) -> None:
        """Another task has its id now: that one is still to be flown."""
        self.completed.pop(task, None)
        self._started = None if self._started == task else self._started

    def was_at(self, item: Item, since: float | None = None,
               until: float = math.inf) -> bool:
        """Whether the vehicle's own positions show that it has reached an item."""
        return self._positions.was_at(item, self._since if since is None else since, until)

    def was_at_by(self, item: Item, when: float) -> bool:
        """The same, before a message came at a time [s] of ours."""
        return self.was_at(item, until=self._positions.vehicle_time(when))

    def near_one(self, item: Item, other: Item | None, when: float) -> bool:
        """It was near one item, and not near another, just before a message came at `when` [s]."""
        return self._positions.near_one(item, other, when)

    def _claim(self, begin: int, end: int, now: float, frame: int | None = None,
               sure: bool = True) -> None:
        items = tuple(item for item in self.items[begin:end]
                      if item.completes and item.task not in self.completed)
        if sure and end - begin > 1 and self._currents.reported == begin and (
                self._positions.at_once(self._currents.last_frame, frame)):
            items = self._leave_out(items, flown_nearby(items, self.items[begin]), end)
        if items:
            route = tuple(item for item in self.items[begin:] if item.position is not None)
            self._passed.add(Claim(
                items, route, self._since, self._positions.vehicle_time(now), now + MAX_MESSAGE_DELAY,
                self.epoch, self._frames_of_reached(begin, end, now, frame), frame,
                end - begin > 1, sure))

    def _frames_of_reached(self, begin: int, end: int, now: float,
                           frame: int | None) -> tuple[int, int] | None:
        """In which a REACHED of the items passed would have come; None: not known."""
        prior = self._currents.previous_frame
        if frame is None or prior is None:
            return None
        if self.items[end:] and self.items[end].command == dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return None  # PX4 tells no REACHED of the item before RETURN
        if self._epochs.reached_recently(begin, end, now):
            return None  # one has come, of this mission or repeated: the positions tell
        return prior, frame

    def _leave_out(self, items: tuple[Item, ...], may_be: tuple[Item, ...],
                   end: int) -> tuple[Item, ...]:
        left = tuple(i for i in items if i not in may_be)
        self.passed_over.extend(left)
        self.skipped.extend(item.task for item in left)
        if left:
            self._passed_over = end
        return may_be

    def _turn(self, seq: int) -> None:
        """The item after `seq` is flown from when that one was reached."""
        item = self.items[seq]
        at = None if item.position is None else self.path.visited_at(
            item.position, item.radius, self._positions.recent(self._since))
        self.current, self.set_by_other = seq + 1, None
        self._since = self._positions.recent(self._since) if at is None else at

    def _complete(self, task: str, place: Point | None, while_offline: bool = False) -> None:
        if place is not None and self._places.get(task, place) != place:
            return  # it is to be flown at another place now
        if task not in self.completed:
            self.completed[task] = place
            self.events.append(ProgressEvent(task, completed=True, while_offline=while_offline))
