# SPDX-License-Identifier: Apache-2.0
"""Which task an item stands for: one table for each epoch, an epoch being one verified upload.

REACHED completes the item it names, and no other; while one of the epoch before may still come,
only where the vehicle was. That the current item has moved on is a claim: it completes what it
passes only where the vehicle was, by its own positions.
"""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from uav_task_alloc.mavlink.flown_path import CLOSE, GAP, FlownPath, Sample, Verdict
from uav_task_alloc.mavlink.frame_log import FrameLog
from uav_task_alloc.mission import RETURN, Item, all_alike
from uav_task_alloc.model import Point, Task

ECHO = 15.0  # [s] in which a REACHED of the epoch before may come; PX4 repeats it for 10 s
REACH = 60.0  # [m] beyond its radius from which an item can be reached between two positions
FRESH = 3.0  # [s] a position tells where the vehicle is
SETTLE = 3.0  # [s] in which a CURRENT sent before the last change may still come
FRAMES_AFTER = 10  # beyond the MISSION_CURRENT that moved on: REACHED may come after it
ADRIFT = 60.0  # [s] after a jump of its position in which another brings it back
AT_ONCE = 2.0  # [s] in which a vehicle does not fly two legs
FRAME_TIME = 0.2  # [s] by which the time of a frame among others is known
STAMPS = 150  # positions: half a minute at 5 Hz
LATE = 6.0  # [s] in which REACHED and positions that were sent before may still come
ROUGH = 10.0  # [m] from which an autopilot may count an item as reached, and turn to the next


@dataclass(frozen=True, slots=True)
class Progress:
    """A task begun or completed."""

    task: str
    completed: bool
    unheard: bool = False  # it was flown while nobody listened


@dataclass(frozen=True, slots=True)
class _Claim:
    """Items that the vehicle has passed, as MISSION_CURRENT says, without a REACHED."""

    items: tuple[Item, ...]
    route: tuple[Item, ...]  # from the first of them on, to the end of the mission
    since: float  # [s] of the vehicle's clock
    until: float  # the same: then it was past them
    deadline: float  # [s] after which nothing more is expected
    epoch: int
    frames: tuple[int, int] | None  # in which a REACHED would have come; None: not known
    frame: int | None  # that told the item after them
    leaps: bool  # over more than one item: somebody has set the current one
    sure: bool  # it was flying, so what was not seen may have been flown


@dataclass(frozen=True, slots=True)
class _Before:
    """The epoch before: until when a REACHED may be of it."""

    items: tuple[Item, ...]
    since: float  # [s] of the vehicle's clock: its current item was flown
    end: float  # the same: until then
    may_end: bool  # at its last item
    until: float  # [s]


_NOTHING = _Before((), -math.inf, -math.inf, False, -math.inf)


class ProgressTable:
    """The items on board, the one being flown, and what was completed; seq counts without home."""

    def __init__(self, frames: FrameLog | None = None, repeats: bool = False) -> None:
        self._frames, self._repeats = frames or FrameLog(), repeats  # REACHED, many times (PX4)
        self._passed_over: int | None = None  # the item after those that were left out
        self._told: int | None = None  # the current item, as the vehicle said last
        self._last_frame: int | None = None  # that told the current item
        self._prior_frame: int | None = None  # the one before that
        self._back: tuple[int, float] | None = None  # it flies an item before ours since [s]
        self.epoch = 0
        self.items: tuple[Item, ...] = ()
        self.current: int | None = None  # len(items): flown to the end
        self.completed: dict[str, Point | None] = {}  # in order, of all epochs; where
        self._places: dict[str, Point] = {}  # of the tasks of the list
        self.events: deque[Progress] = deque()
        self.skipped: deque[str] = deque()  # tasks that somebody else has left out
        self.told_reached: set[int] = set()  # by REACHED, in this epoch
        self.left: deque[Item] = deque()  # passed, and not seen to be flown
        self.chosen: int | None = None  # the current item, where somebody else has set it
        self.path = FlownPath()
        self._started: str | None = None
        self._reached: tuple[int, float] | None = None  # last seq, when
        self._last_reached: tuple[int, float] | None = None  # of any epoch
        self._heard_first = False
        self._credited: int | None = None  # the seq of that, once it has completed an item
        self._before = _NOTHING
        self._unproven: dict[int, float] = {}  # REACHED of this epoch or the one before; until [s]
        self._jump: tuple[int, float] | None = None  # set by us at a time, not seen yet
        self._asked: int | None = None  # we are setting this
        self._place: tuple[Point, float] | None = None
        self._adrift_until = -math.inf  # [s] its position has jumped, and says nothing
        self._claims: list[_Claim] = []
        self._since = -math.inf  # [s] of the vehicle's clock: the current item is flown
        self._stamps: deque[tuple[int, float]] = deque(maxlen=STAMPS)  # positions: frame, when
        self._clock = -math.inf  # [s] of the vehicle less ours, by the fastest message
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
        return frozenset(item.task for claim in self._claims for item in claim.items)

    @property
    def last_flown(self) -> int:
        """The index of the last item with a place."""
        return len(self.items) - 1 - int(self.returns)

    @property
    def returns(self) -> bool:
        return bool(self.items) and self.items[-1].command == RETURN

    def may_end(self, now: float) -> bool:
        """The last item with a place is flown, or passed; or was, where a swap has just come."""
        if self.items and self.current is not None and self.current >= self.last_flown:
            return True
        return self._before.may_end and now < self._before.until - ECHO + LATE

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
            self._before = _Before(self.items, self._since, now + self._clock,
                                   self.may_end(now), now + ECHO)
            if self.items:
                self._unproven.clear()
        self.items, self.current, self._reached = items, start, None
        self.told_reached.clear()
        self._jump = None if start is None else (start, now)
        self._asked = self.chosen = self._told = None
        self._since = self._since_begin = self.path.newest if since is None else since

    def extend(self, items: tuple[Item, ...]) -> None:
        """A new epoch whose first items are those of the last: the vehicle goes on."""
        self.epoch += 1
        self.items = items

    def invalidate(self) -> None:
        """Nothing is known of what is on board."""
        self.items, self.current, self._reached = (), None, None
        self._before = _NOTHING
        self._unproven.clear()
        self._started = self._jump = self.chosen = self._last_frame = self._told = None
        self._claims.clear()
        self.path.clear()
        self._clock = -math.inf
        self._stamps.clear()
        self._since = -math.inf

    def retag(self, items: tuple[Item, ...]) -> None:
        """The same items, now known by their tasks."""
        self.items = items

    def at(self, sample: Sample, newest: bool, now: float, frame: int | None = None) -> None:
        """A position of the vehicle, the newest or one that comes late."""
        self._clock = max(self._clock, sample.t - now)
        if frame is not None:
            self._stamps.append((frame, sample.t))
        if newest:
            if self.path.jumps(sample):
                back = now < self._adrift_until
                self._adrift_until = now + (FRESH if back else ADRIFT)
            self._place = sample.position, now
        self.path.add(sample)

    def asked(self, seq: int) -> None:
        """We are about to set the current item, and may see it before we know that it is done."""
        self._asked = seq

    def jumped(self, seq: int, now: float) -> None:
        """We have set the current item: what lies between was not flown."""
        self.current, self._jump, self._asked = seq, (seq, now), None
        self.chosen, self._since = None, self.path.newest

    def started(self) -> None:
        """The vehicle flies its mission: the task of the current item has begun."""
        item = self.active
        if item and item.task and item.task != self._started and item.task not in self.completed:
            self._started = item.task
            self.events.append(Progress(item.task, completed=False))

    def stopped(self) -> None:
        """The vehicle does not fly this list any more: what goes on later starts anew."""
        self._started = self.chosen = None

    def reached(self, seq: int, now: float, proven: bool = False) -> None:
        """MISSION_ITEM_REACHED, once or many times; `proven`: it is of this epoch."""
        echo = self._repeats and self._run(seq, now)
        if (proven or now >= self._before.until) and self.items:
            if 0 <= seq < len(self.items) and (proven or self._near(seq, now)):
                self._accept(seq, now)
        elif not self._prove(seq, now, echo) and not echo:  # else it is told again
            self._unproven[seq] = now + LATE  # a position on its way may tell

    def repeated(self, seq: int, now: float) -> None:
        """The last REACHED has come again, also while nobody knew of which mission it was."""
        if self._last_reached is not None and self._last_reached[0] == seq:
            self._last_reached = seq, now

    def _prove(self, seq: int, now: float, echo: bool = False,
               came: float | None = None) -> bool:
        """Credit REACHED, which came at a time, to the epoch at whose item the vehicle was.

        Returns:
            False: not known yet.
        """
        if 0 <= seq < len(self.items) and self._is_of_now(seq, now):
            self._accept(seq, now)
            return True
        before = self._before
        if echo or not 0 <= seq < len(before.items):
            return False
        item = before.items[seq]
        after = self.items[seq] if 0 <= seq < len(self.items) else None
        same = after is not None and (after.task, after.position) == (item.task, item.position)
        if after is not None and not same and self._distance(seq) <= ROUGH + after.radius:
            return False  # of this epoch, if what comes shows it
        if not self.was_at(item, max(before.since, self.path.newest - ECHO), before.end) and not (
                self.near_one(item, None if same else after, now if came is None else came)):
            return False
        if before.may_end and item.position == _last_place(before.items):
            self._end_at = now
        self.credit(item)
        self._credited = seq
        return True

    def _run(self, seq: int, now: float) -> bool:
        """The last REACHED goes on, and was credited (PX4)."""
        goes_on = self._last_reached is not None and self._last_reached[0] == seq and (
            now - self._last_reached[1] < LATE)
        if not goes_on:  # heard to begin, after another one: no repetition of a mission before
            self._credited, self._heard_first = None, self._last_reached is not None
        self._last_reached = seq, now
        return self._credited == seq

    def _is_of_now(self, seq: int, now: float) -> bool:
        """Whether a REACHED that may be of the epoch before is of this one."""
        item, before = self.items[seq], self._before
        if not self._repeats:  # told once, where the vehicle is
            near = self._near(seq, now) if not before.items else (
                self._distance(seq) <= ROUGH + item.radius)
            return near or self.was_at(item)
        # a repetition goes on while the current item stays what it was
        if self._told is not None and self._told > seq:
            return self._near(seq, now) if not before.items else (
                item.position is not None and self.path.visited_at(
                    item.position, item.radius + ROUGH, self._since_begin) is not None)
        return seq == len(self.items) - 1 and self._told == seq and (
            self.was_at(item) or (item.position is None and self._heard_first))

    def _passed_unseen(self, seq: int) -> bool:
        """It flies beyond the item, and was not seen for a while."""
        if not (0 <= seq < len(self.items) and self.current is not None and seq < self.current):
            return False
        item = self.items[seq]
        return item.position is not None and self.path.judge(
            item.position, item.radius, item.params[0], self._since) is Verdict.BLIND

    def _accept(self, seq: int, now: float) -> None:
        if seq == self.last_flown and (self._reached is None or self._reached[0] != seq):
            self._end_at = now
        self._reached, self._credited = (seq, now), seq
        self.told_reached.add(seq)
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

    def moved(self, seq: int, now: float, flying: bool, frame: int | None = None) -> None:
        """MISSION_CURRENT in a frame: where it is flying, items before it were passed."""
        self._prior_frame = self._last_frame
        self._move(seq, now, flying, frame)
        self._last_frame, self._told = frame, seq
        self._go_back(seq, now, flying)

    def _go_back(self, seq: int, now: float, flying: bool) -> None:
        """Somebody has set the current item back: that is what it flies."""
        last = len(self.items) - 1
        if not flying or self.current is None or seq >= min(self.current, last) or (
                self._jump is not None or seq == self._asked):
            self._back = None
        elif self._back is None or self._back[0] != seq:
            self._back = seq, now
        elif now - self._back[1] >= LATE:
            self.current, self._since, self._back = seq, self._recent(), None

    def _move(self, seq: int, now: float, flying: bool, frame: int | None) -> None:
        if seq == self._asked:
            return
        if self._jump is not None:
            start, when = self._jump
            if seq != start and (seq < start or now - when < SETTLE):
                return  # sent before we set it
            self._jump = None
        if self._started is None or not flying:
            if seq < len(self.items) and not (self.finished and seq == len(self.items) - 1):
                if self.current is not None and self.current < seq:
                    self._claim(self.current, seq, now, frame, sure=False)
                self.current = seq  # somebody sets it; nothing is flown
        elif self.current is not None and self.current < seq <= len(self.items):
            self._passed_over = None
            self._claim(self.current, seq, now, frame)
            self.current, self._since = seq, self._recent()
            self.chosen = seq if self._passed_over == seq else self.chosen

    def ended(self, seq: int, now: float, frame: int | None = None) -> None:
        """The vehicle says that the mission is flown to its item `seq`; more may be appended."""
        end = min(seq + 1, len(self.items))
        if (self.current is not None and self._jump is None and self._started is not None
                and self.current < end):
            self._claim(self.current, end, now, frame)
            self.current, self._since = end, self._recent()

    def step(self, now: float) -> None:
        """Judge what was passed without a REACHED, and REACHED that nothing has shown."""
        for seq, until in list(self._unproven.items()):
            if self._prove(seq, now, came=until - LATE):
                self._unproven.pop(seq, None)
            elif now >= until:
                del self._unproven[seq]
                if self._passed_unseen(seq):
                    self._accept(seq, now)
        for claim in list(self._claims):
            left = tuple(i for i in claim.items if i.task not in self.completed)
            if self._silent(claim):
                self._claims.remove(claim)
                self._leave(left, claim)
                continue
            if left and claim.frames is not None and now < claim.deadline:
                continue  # REACHED may still come, or all that came without it
            verdicts = {item.task: self._verdict(item, claim) for item in left}
            for item in left:
                if verdicts[item.task] is Verdict.YES:
                    self._complete(item.task, item.position)
            left = tuple(i for i in left if verdicts[i.task] is not Verdict.YES)
            if left and now < claim.deadline:
                continue
            self._claims.remove(claim)
            if left:
                self._settle(left, verdicts, claim)

    def _settle(self, left: tuple[Item, ...], verdicts: dict[str, Verdict],
                claim: _Claim) -> None:
        """Nothing more will come: what it can have flown unseen it has flown, else it was left."""
        blind = [i for i in left if verdicts[i.task] is Verdict.BLIND and i.position is not None]
        flown = bool(blind) and self._flown_unseen(blind, claim)
        for item in left:
            if flown and item in blind:
                self._complete(item.task, item.position)
            else:
                self._leave((item,), claim)

    def _flown_unseen(self, blind: list[Item], claim: _Claim) -> bool:
        """Wherever it was seen again: on the way from one of the items after them to the next."""
        at = [n for n, item in enumerate(claim.route) if any(item is one for one in blind)]
        if not at:
            return False
        for end in range(at[-1] + 1, len(claim.route) + 1):
            flown = claim.route[at[0]:end]
            then = claim.route[end].position if end < len(claim.route) else None
            if self.path.could_have(
                    [item.position for item in flown if item.position is not None], then,
                    math.fsum(item.params[0] for item in flown), claim.since):
                return True
        return False

    def _silent(self, claim: _Claim) -> bool:
        """Every frame has come in which the vehicle would have told REACHED, and it did not."""
        if claim.frames is None:
            return False
        first, last = claim.frames[0], claim.frames[1] + FRAMES_AFTER
        return self._frames.newest >= last and self._frames.whole(first, last)

    def _leave(self, items: tuple[Item, ...], claim: _Claim) -> None:
        """They were passed over."""
        self.left.extend(items)
        if not claim.sure:
            return
        self.skipped.extend(item.task for item in items)
        if items and claim.epoch == self.epoch:
            self.chosen = self.current

    def caught_up(self, tasks: Iterable[Task]) -> None:
        """These were flown while nobody listened."""
        for task in tasks:
            self._complete(task.id, task.position, unheard=True)

    def credit(self, item: Item) -> None:
        """It was reached, whichever mission it was of."""
        if item.completes:
            self._complete(item.task, item.position)

    def asked_for(self, tasks: Iterable[Task]) -> None:
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
        return item.position is not None and self.path.judge(
            item.position, item.radius, item.params[0],
            self._since if since is None else since, until) is Verdict.YES

    def was_at_by(self, item: Item, when: float) -> bool:
        """The same, before a message came at a time [s] of ours."""
        return self.was_at(item, until=when + self._clock)

    def near_one(self, item: Item, other: Item | None, when: float) -> bool:
        """It was near one item, and not near another, just before a message came at `when` [s].

        PX4 may count an item as reached up to 10 m from it.
        """
        return self._came_near(item, when) and not (
            other is not None and self._came_near(other, when))

    def _came_near(self, item: Item, when: float) -> bool:
        until = when + self._clock
        return item.position is not None and self.path.visited_at(
            item.position, item.radius + ROUGH, until - LATE, until) is not None

    def _verdict(self, item: Item, claim: _Claim) -> Verdict:
        if item.position is None:
            return Verdict.NO
        return self.path.judge(item.position, item.radius, item.params[0], claim.since,
                               self._until(claim), 0.0 if claim.leaps else CLOSE)

    def _until(self, claim: _Claim) -> float:
        """[s] of the vehicle's clock at which it was past them, by the order of its frames."""
        if claim.frame is None:
            return claim.until
        after = min(((f, t) for f, t in self._stamps if f > claim.frame), default=None)
        before = max(((f, t) for f, t in self._stamps if f < claim.frame), default=None)
        if after is None or before is None:
            return claim.until if after is None else after[1]
        gap = after[1] - before[1]
        if claim.leaps and gap <= GAP:
            return before[1]  # what it came by after somebody had set the current item is nothing
        share = (claim.frame - before[0]) / (after[0] - before[0])
        return min(after[1], before[1] + gap * share + FRAME_TIME)

    def _claim(self, begin: int, end: int, now: float, frame: int | None = None,
               sure: bool = True) -> None:
        items = tuple(item for item in self.items[begin:end]
                      if item.completes and item.task not in self.completed)
        if sure and end - begin > 1 and self._told == begin and self._at_once(frame):
            items = self._leave_out(items, self.items[begin], end)
        if items:
            route = tuple(item for item in self.items[begin:] if item.position is not None)
            # PX4 tells no REACHED of the item before RETURN
            told = not (self.items[end:] and self.items[end].command == RETURN)
            frames = (self._prior_frame, frame) if told and frame is not None and (
                self._prior_frame is not None) else None
            if self._last_reached is not None and begin <= self._last_reached[0] < end and (
                    now - self._last_reached[1] < LATE):
                frames = None  # one has come, of this mission or repeated: the positions tell
            self._claims.append(_Claim(
                items, route, self._since, now + self._clock, now + LATE, self.epoch,
                frames, frame, end - begin > 1, sure))

    def _at_once(self, frame: int | None) -> bool:
        """The current item was told twice within a moment, by the order of the frames."""
        if frame is None or self._last_frame is None:
            return False
        before = [t for f, t in self._stamps if f <= self._last_frame]
        return bool(before) and max(
            t for f, t in self._stamps if f <= frame) - max(before) < AT_ONCE

    def _leave_out(self, items: tuple[Item, ...], flown: Item, end: int) -> tuple[Item, ...]:
        """Of items passed in a moment only what was flown, and what is beside it, may be."""
        place = flown.position
        may_be = tuple(i for i in items if flown.completes and place is not None
                       and i.position is not None and math.dist(i.position, place) < ROUGH)
        left = tuple(i for i in items if i not in may_be)
        self.left.extend(left)
        self.skipped.extend(item.task for item in left)
        if left:
            self._passed_over = end
        return may_be

    def _turn(self, seq: int) -> None:
        """The item after `seq` is flown from when that one was reached."""
        item = self.items[seq]
        at = None if item.position is None else self.path.visited_at(
            item.position, item.radius, self._recent())
        self.current, self.chosen = seq + 1, None
        self._since = self._recent() if at is None else at

    def _recent(self) -> float:
        """[s] of the vehicle's clock: positions since then may be newer than the last message."""
        return max(self._since, self.path.newest - LATE)

    def _complete(self, task: str, place: Point | None, unheard: bool = False) -> None:
        if place is not None and self._places.get(task, place) != place:
            return  # it is to be flown at another place now
        if task not in self.completed:
            self.completed[task] = place
            self.events.append(Progress(task, completed=True, unheard=unheard))

    def _near(self, seq: int, now: float) -> bool:
        if self._place is None or now - self._place[1] > FRESH or now < self._adrift_until:
            return True
        distance = self._distance(seq)
        return math.isinf(distance) or distance <= self.items[seq].radius + REACH

    def _distance(self, seq: int) -> float:
        position = self.items[seq].position
        if position is None or self._place is None:
            return math.inf
        return math.dist(position, self._place[0])


def _last_place(items: tuple[Item, ...]) -> Point | None:
    return next((item.position for item in reversed(items) if item.position is not None), None)
