# SPDX-License-Identifier: Apache-2.0
"""Which task an item stands for: one table for each epoch, an epoch being one verified upload."""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from uav_task_alloc.mission import Item
from uav_task_alloc.model import Point, Task

ECHO = 15.0  # [s] in which PX4 may repeat the last REACHED of the epoch before
REACH = 60.0  # [m] beyond its radius from which an item can be reached between two positions
FRESH = 3.0  # [s] a position tells where the vehicle is
SETTLE = 3.0  # [s] in which a CURRENT sent before the last change may still come


@dataclass(frozen=True, slots=True)
class Progress:
    """A task begun or completed."""

    task: str
    completed: bool
    unheard: bool = False  # it was flown while nobody listened


class ProgressTable:
    """The items on board, the one being flown, and what was completed; seq counts without home."""

    def __init__(self) -> None:
        self.epoch = 0
        self.items: tuple[Item, ...] = ()
        self.current: int | None = None  # len(items): flown to the end
        self.completed: dict[str, Point | None] = {}  # in order, of all epochs; where
        self.events: deque[Progress] = deque()
        self._started: str | None = None
        self._reached: tuple[int, float] | None = None  # last seq, when
        self._echo: tuple[int, float] | None = None  # seq of the epoch before, until when
        self._jump: tuple[int, float] | None = None  # set by us at a time, not seen yet
        self._asked: int | None = None  # we are setting this
        self._place: tuple[Point, float] | None = None

    @property
    def active(self) -> Item | None:
        """The item being flown."""
        if self.current is None or self.current >= len(self.items):
            return None
        return self.items[self.current]

    @property
    def finished(self) -> bool:
        return bool(self.items) and self.current == len(self.items)

    def begin(self, items: tuple[Item, ...], start: int | None, now: float) -> None:
        """A new epoch: what REACHED and CURRENT mean from now on."""
        self.epoch += 1
        if self._reached is not None and now - self._reached[1] < ECHO:
            self._echo = self._reached[0], now + ECHO
        self.items, self.current, self._reached = items, start, None
        self._jump = None if start is None else (start, now)
        self._asked = None

    def extend(self, items: tuple[Item, ...]) -> None:
        """A new epoch whose first items are those of the last: the vehicle goes on."""
        self.epoch += 1
        self.items = items

    def invalidate(self) -> None:
        """Nothing is known of what is on board."""
        self.items, self.current, self._reached, self._echo = (), None, None, None
        self._started = self._jump = None

    def retag(self, items: tuple[Item, ...]) -> None:
        """The same items, now known by their tasks."""
        self.items = items

    def at(self, position: Point, now: float) -> None:
        """Where the vehicle is [m] ENU."""
        self._place = position, now

    def asked(self, seq: int) -> None:
        """We are about to set the current item, and may see it before we know that it is done."""
        self._asked = seq

    def jumped(self, seq: int, now: float) -> None:
        """We have set the current item: what lies between was not flown."""
        self.current, self._jump, self._asked = seq, (seq, now), None

    def started(self) -> None:
        """The vehicle flies its mission: the task of the current item has begun."""
        item = self.active
        if item and item.task and item.task != self._started and item.task not in self.completed:
            self._started = item.task
            self.events.append(Progress(item.task, completed=False))

    def stopped(self) -> None:
        """The vehicle does not fly this list any more: what goes on later starts anew."""
        self._started = None

    def reached(self, seq: int, now: float) -> None:
        """MISSION_ITEM_REACHED, once or many times."""
        if not 0 <= seq < len(self.items) or self._is_echo(seq, now) or not self._near(seq, now):
            return
        self._reached = seq, now
        if self.current is None or seq >= self.current:
            self._pass(seq + 1)

    def moved(self, seq: int, now: float) -> None:
        """MISSION_CURRENT: items before it were reached, even where REACHED was lost."""
        if seq == self._asked:
            return
        if self._jump is not None:
            start, when = self._jump
            if seq != start and (seq < start or now - when < SETTLE):
                return  # sent before we set it
            self._jump = None
        if self._started is None:
            if seq < len(self.items) and not (self.finished and seq == len(self.items) - 1):
                self.current = seq  # somebody sets it; nothing is flown
        elif self.current is not None and self.current < seq <= len(self.items):
            self._pass(seq)

    def caught_up(self, tasks: Iterable[Task]) -> None:
        """These were flown while nobody listened."""
        for task in tasks:
            self._complete(task.id, task.position, unheard=True)

    def asked_for(self, tasks: Iterable[Task]) -> None:
        """One that was flown at another place is another task, and still to be flown."""
        for task in tasks:
            if self.completed.get(task.id) not in (None, task.position):
                del self.completed[task.id]
                self._started = None if self._started == task.id else self._started

    def ended(self) -> None:
        """The vehicle says that the whole mission is flown."""
        if self.current is not None and self._jump is None and self._started is not None:
            self._pass(len(self.items))

    def _pass(self, seq: int) -> None:
        assert self.current is not None or seq > 0
        for item in self.items[self.current if self.current is not None else seq - 1:seq]:
            if item.completes:
                self._complete(item.task, item.position)
        self.current = seq

    def _complete(self, task: str, place: Point | None, unheard: bool = False) -> None:
        if task not in self.completed:
            self.completed[task] = place
            self.events.append(Progress(task, completed=True, unheard=unheard))

    def _is_echo(self, seq: int, now: float) -> bool:
        """A repetition from the epoch before, unless the new item is being reached as well."""
        if self._echo is None or now > self._echo[1] or seq != self._echo[0]:
            return False
        return self._distance(seq) > self.items[seq].radius + 10.0 or seq != self.current

    def _near(self, seq: int, now: float) -> bool:
        if self._place is None or now - self._place[1] > FRESH:
            return True
        distance = self._distance(seq)
        return math.isinf(distance) or distance <= self.items[seq].radius + REACH

    def _distance(self, seq: int) -> float:
        position = self.items[seq].position
        if position is None or self._place is None:
            return math.inf
        return math.dist(position, self._place[0])
