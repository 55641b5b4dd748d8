# SPDX-License-Identifier: Apache-2.0
"""Reports of progress during an upload: are they of the old mission, or of the new one?

They are kept until the mission on board is known. A MISSION_ITEM_REACHED is credited by where the
vehicle was; a MISSION_CURRENT belongs to the new mission by PX4's mission id, else by the order
of the frames.
"""
from __future__ import annotations

import math
from typing import NamedTuple

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.mission.diff import DiffKind, MissionDiff
from uav_task_alloc.mavlink.mission.items import Item, alike, with_position
from uav_task_alloc.mavlink.mission.position_history import MAX_MESSAGE_DELAY
from uav_task_alloc.mavlink.mission.progress import ProgressTable

_MAX_MESSAGES = 32  # REACHED, without repetitions
_MAX_CURRENT = 512  # MISSION_CURRENT: four minutes at 2 Hz


class _Reached(NamedTuple):
    """A series of REACHED with the same seq."""

    seq: int  # index without home
    frame: int  # number of the first frame that was kept
    last: float  # [s] the last one was received
    last_frame: int  # its number
    kept_at: float  # [s] the first one was received that was kept


class _Current(NamedTuple):
    """One MISSION_CURRENT."""

    seq: int  # index without home
    now: float  # [s] received
    frame: int  # its number
    flying: bool  # in mission mode
    plan: int  # mission id (PX4); 0: none


class _Passed(NamedTuple):
    """A report that was passed on for a mission that is not read back yet."""

    frame: int  # its number
    is_current: bool  # MISSION_CURRENT, not MISSION_ITEM_REACHED
    seq: int  # index without home
    when: float  # [s] received
    flying: bool  # in mission mode


class ReportsDuringUpload:
    """Keeps reports until the upload is decided; then credits them to the old or new mission.

    Args:
        progress: where they are credited.
        origin: of the ENU frame of the mission items.
        atomic: the vehicle flies the old mission until it has all items of the new one (PX4).

    Attributes:
        sent_since: vehicle time [s] before which the new mission was not on board; None: it is
            not sent to its end.
        sent_frame: number of the frame received last at that time.

    Arguments of methods:
        seq: number of the mission item.
        now: [s] steady clock, when it was received.
        frame: number of the received frame, rising.
        flying: the vehicle is in mission mode.
        plan: PX4's mission id; 0: unknown.
        uploaded: the new mission; None: none is open.
    """

    def __init__(self, progress: ProgressTable, origin: Origin, atomic: bool) -> None:
        self._progress, self._origin, self._atomic = progress, origin, atomic
        self._evidence = progress.evidence
        self._reached: list[_Reached] = []
        self._currents: list[_Current] = []
        self._judged: set[tuple[int, int]] = set()  # first and last frame of series credited early
        self.sent_since: float | None = None
        self.sent_frame: int | None = None
        self._old_frame: int | None = None  # number of the latest since that shows the old one
        self._start = 0  # index of the item at which the new mission begins
        self._passed: list[_Passed] | None = None  # for the mission taken; None: it is read back

    @property
    def has_reached(self) -> bool:
        """Whether a REACHED was received that may be of either mission."""
        return bool(self._reached)

    def note_sent(self, frame: int) -> None:
        """Note that the new mission was sent to its end, and may be on board from now on."""
        self.sent_since, self.sent_frame = self._progress.path.newest, frame
        self._old_frame = None
        self._progress.coverage.mission_known = False

    def add_reached(self, seq: int, now: float, frame: int) -> None:
        """Keep a REACHED that may be of the old or of the new mission."""
        self._evidence.first_at(seq, now, frame)
        repeated = bool(self._reached) and self._reached[-1].seq == seq  # by PX4
        if repeated:
            self._reached[-1] = self._reached[-1]._replace(last=now, last_frame=frame)
        elif len(self._reached) < _MAX_MESSAGES:
            self._reached.append(_Reached(seq, frame, now, frame, now))
        self._progress.note_end(seq, now)

    def add_current(self, seq: int, now: float, frame: int, flying: bool, plan: int) -> None:
        """Keep a MISSION_CURRENT that may be of the new mission."""
        if len(self._currents) < _MAX_CURRENT:
            self._currents.append(_Current(seq, now, frame, flying, plan))

    def note_passed(self, seq: int, now: float, frame: int, is_current: bool,
                    flying: bool = True, of_taken: bool = False) -> None:
        """Keep a report that is passed on, until the mission taken is read back.

        Args:
            seq, now, frame, flying: see above.
            is_current: a MISSION_CURRENT, not a MISSION_ITEM_REACHED.
            of_taken: it has PX4's id of the mission taken.
        """
        if of_taken:
            self._progress.reports.note_id(frame, now)
        if self._passed is not None and len(self._passed) < _MAX_CURRENT:
            self._passed.append(_Passed(frame, is_current, seq, now, flying))

    def confirm(self) -> None:
        """Note that the mission taken was read back, and is the one sent."""
        self._passed = None

    def correct(self, items: tuple[Item, ...], now: float) -> bool:
        """Pass on again, for the items read back, what was reported since a mission was taken.

        Args:
            items: on board, with their tasks: other ones than were sent.
            now: see above.

        Returns:
            Whether the vehicle has taken a mission that was not read back until now.
        """
        passed, self._passed = self._passed, None
        if passed is None:
            return False
        currents = [each.seq for each in passed if each.is_current]
        self._progress.correct(items, currents[0] if currents else self._start, now)
        for each in passed:
            self._pass_on(each, proven=False)
        return True

    def _pass_on(self, report: _Passed, proven: bool) -> None:
        frame, is_current, seq, when, flying = report
        if is_current:
            self._progress.note_current(seq, when, flying, frame)
        else:
            self._progress.note_reached(seq, when, proven=proven, frame=frame)

    def end(self, uploaded: MissionDiff | None) -> float:
        """Credit by the positions, and drop the rest: the vehicle was restarted.

        Returns:
            Vehicle time [s] until which the old mission was on board.
        """
        until = math.inf
        if uploaded is not None:
            self._credit_reached(uploaded)
            if self.sent_since is not None and uploaded.kind is not DiffKind.APPEND:
                until = self.sent_since if self._old_frame is None else max(
                    self.sent_since, self._progress.positions.sent_between(self._old_frame)[0])
        self._reached.clear()
        self._currents.clear()
        self._judged.clear()
        self._passed = None
        return until

    def release(self, frame: int) -> None:
        """Credit REACHED sent before a frame that shows the old mission on board."""
        self._old_frame = frame
        for reached in self._reached:
            if reached.frame < frame:
                self._progress.note_reached(
                    reached.seq, self._first_at(reached), frame=reached.frame)
        self._reached = [each for each in self._reached if each.frame >= frame]

    def _first_at(self, reached: _Reached) -> float:
        """When [s] the first of its series was received."""
        return self._evidence.first_at(reached.seq, reached.last, reached.last_frame)

    def begin_new(self, uploaded: MissionDiff) -> list[tuple[int, float, int]]:
        """Credit the REACHED of the old mission.

        Args:
            uploaded: the new mission.

        Returns:
            (seq, received at [s], frame) of those of the new mission.
        """
        of_new, old, self._start = [], self._progress.items, uploaded.start
        for reached in self._reached:
            seq = reached.seq
            before = with_position(old[seq], self._origin) if 0 <= seq < len(old) else None
            after = uploaded.items[seq] if 0 <= seq < len(uploaded.items) else None
            when = self._credit_old(reached, before, after, uploaded)
            if when is not None:
                of_new.append((seq, when, reached.frame))
        self._reached.clear()
        self._judged.clear()
        return of_new

    def _credit_old(self, reached: _Reached, before: Item | None, after: Item | None,
                    uploaded: MissionDiff) -> float | None:
        """Credit a REACHED to the item of the old mission, where the vehicle was there.

        Returns:
            [s] at which it was received, where it is of the new mission.
        """
        seq, frame, last, last_frame, kept_at = reached
        progress, first = self._progress, self._first_at(reached)
        if first < kept_at or self._evidence.may_repeat_earlier(seq, last, last_frame):
            return self._credit_repeated(reached, before, after, uploaded)
        if before is not None and self._was_at(before, reached, len(progress.items), -math.inf):
            progress.note_reached(seq, first, proven=True, frame=frame)
        elif before is not None and after is not None and alike(before, after):
            progress.note_reached(seq, first, frame=frame)
        elif after is not None and self._was_at(
                after, reached, len(uploaded.items), self._new_since):
            return first
        elif before is not None and progress.positions.near_one(before, after, first):
            if before.task:
                progress.credit(before)
            else:  # of a mission that was read: `resume` finds the task by its position
                progress.note_reached(seq, first, frame=frame)
        elif after is not None and progress.positions.near_one(after, before, first):
            return first
        else:
            return self._credit_repeated(reached, before, after, uploaded)
        return None

    @property
    def _new_since(self) -> float:
        """Vehicle time [s] before which nothing of the new mission was flown."""
        return -math.inf if self.sent_since is None else self.sent_since

    def _was_at(self, item: Item, reached: _Reached, count: int, since: float) -> bool:
        """Whether it has reached an item of a mission of `count` items before a REACHED.

        Not as long as that item was still reported as current, before this REACHED; the last
        item stays current.
        """
        positions = self._progress.positions
        reported = -math.inf if reached.seq >= count - 1 else max((
            positions.sent_between(each.frame)[0] for each in self._currents
            if each.flying and each.seq == reached.seq and each.frame < reached.frame),
            default=-math.inf)
        return self._evidence.was_at(
            item, self._first_at(reached), max(since, reported - item.params[0]))

    def _credit_repeated(self, reached: _Reached, before: Item | None, after: Item | None,
                         uploaded: MissionDiff) -> float | None:
        """As `_credit_old`, where only a new one among repetitions of an older one counts."""
        progress, evidence, seq, last = (
            self._progress, self._evidence, reached.seq, reached.last)
        # a new one makes the next item current; the last item stays
        passed = seq == len(uploaded.items) - 1 or any(
            each.seq > seq and each.frame > reached.frame for each in self._currents)
        if after is not None and seq == uploaded.start and passed and evidence.was_exactly_at(
                after, last, self._new_since):
            return last
        if before is not None and seq == progress.current and (
                evidence.was_exactly_at(before, last)):
            progress.credit(before)
        return None

    def replay(self, of_new: list[tuple[int, float, int]], plan: int) -> None:
        """Pass on what is of the new mission, in the order in which it was sent.

        Args:
            of_new: what `begin_new` has returned.
            plan: mission id of the new mission (PX4); 0: none.
        """
        stored = self.sent_frame
        currents = [each for each in self._currents if (
            each.plan == plan if plan else not each.plan and stored is not None
            and each.frame > stored)]
        self._currents.clear()
        rows = [_Passed(frame, False, seq, when, True) for seq, when, frame in of_new]
        rows += [_Passed(each.frame, True, each.seq, each.now, each.flying) for each in currents]
        self._passed = sorted(rows)
        for each in self._passed:
            self._pass_on(each, proven=True)

    def credit(self, uploaded: MissionDiff) -> None:
        """Credit all by the positions after a failed transfer: either mission may be flown."""
        self._credit_reached(uploaded)
        self._currents.clear()

    def _credit_reached(self, uploaded: MissionDiff) -> None:
        for seq, _, _ in self.begin_new(uploaded):
            self._progress.credit(uploaded.items[seq])

    def step(self, uploaded: MissionDiff | None, now: float) -> None:
        """Credit by the positions what waits for longer than any message, and keep it.

        A readback may take long, and a bridge that is killed meanwhile would lose it.
        """
        self._progress.coverage.mission_known = uploaded is None or (
            uploaded.kind is DiffKind.APPEND or (self._atomic and self.sent_since is None))
        waiting = [each for each in self._reached if (each.frame, each.last_frame)
                   not in self._judged and now - self._first_at(each) >= MAX_MESSAGE_DELAY]
        if waiting and uploaded is not None:
            judged = {*self._judged, *((each.frame, each.last_frame) for each in waiting)}
            kept, self._reached = self._reached, waiting
            self._credit_reached(uploaded)
            self._reached, self._judged = kept, judged
