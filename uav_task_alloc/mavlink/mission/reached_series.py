# SPDX-License-Identifier: Apache-2.0
"""MISSION_ITEM_REACHED as PX4 repeats it: which of those received may be one series?

The time at which each was sent is known by the positions sent before and after it, not by when
it arrived. What may be a repetition is taken as one.
"""
from __future__ import annotations

import math
from dataclasses import dataclass

from uav_task_alloc.mavlink.mission.position_history import MAX_MESSAGE_DELAY, PositionHistory
from uav_task_alloc.mavlink.transport.frame_log import FrameLog

_MIN_PERIOD = 0.7  # [s] two repetitions are further apart (PX4: 1 s)
_MAX_PERIOD = 2.0  # [s] the same, where no frame is lost
_DURATION = 11.5  # [s] of a series (PX4: 10 s)
_KEPT = 32  # REACHED


@dataclass(slots=True, eq=False)
class ReachedReport:
    """One REACHED that was received."""

    seq: int  # index without home
    now: float  # [s] received
    frame: int | None  # its number; None: not known
    sent: tuple[float, float] | None = None  # vehicle times [s] between which; None: not known yet


class ReachedSeries:
    """Keeps the last REACHED in the order in which they were sent.

    Args:
        positions: of the vehicle.
        repeats: whether the autopilot repeats REACHED (PX4: 10 times at 1 Hz).
        frames: numbers of the frames received.

    Attributes:
        repeats: see above.

    Arguments of methods:
        reached: one that `add` has returned.
    """

    def __init__(self, positions: PositionHistory, repeats: bool, frames: FrameLog) -> None:
        self._positions, self.repeats, self._frames = positions, repeats, frames
        self._log: list[ReachedReport] = []  # by the number of the frame
        self._complete = True  # the first one received is still in the log
        self._credited: ReachedReport | None = None

    def add(self, seq: int, now: float, frame: int | None) -> ReachedReport:
        """Add a REACHED; one that was added before is returned.

        Args:
            seq: index without home.
            now: steady time [s] at which it was received.
            frame: its number; None: not known.
        """
        known = next((one for one in self._log if frame is not None and one.frame == frame), None)
        if known is not None:
            return known
        reached = ReachedReport(seq, now, frame)
        at = len(self._log)
        while frame is not None and at and (self._log[at - 1].frame or -math.inf) > frame:
            at -= 1
        self._log.insert(at, reached)
        if len(self._log) > _KEPT:
            del self._log[0]
            self._complete = False
        return reached

    def clear(self) -> None:
        """Drop all: the vehicle was restarted."""
        self._log.clear()
        self._credited = None

    def note_credited(self, reached: ReachedReport) -> None:
        """Note that a REACHED has completed an item."""
        self._credited = reached

    def first_at(self, reached: ReachedReport) -> float:
        """When [s] the first one was received that a REACHED may repeat."""
        return min(one.now for one in self._of(reached))

    def first_sent(self, reached: ReachedReport) -> float:
        """Vehicle time [s] before which the first one was not sent that a REACHED may repeat."""
        times = ((self._sent(one)[0], one.now) for one in self._of(reached))
        return min(self._positions.vehicle_time(now) if math.isinf(sent) else sent
                   for sent, now in times)

    def is_placed(self, reached: ReachedReport) -> bool:
        """Whether it is known when it was sent."""
        return not math.isinf(self._sent(reached)[1])

    def repeats_credited(self, reached: ReachedReport) -> bool:
        """Whether a REACHED may repeat the one that was credited last."""
        return any(one is self._credited for one in self._of(reached)[:-1])

    def is_whole(self, reached: ReachedReport) -> bool:
        """Whether its series began after another REACHED was received."""
        return not self._complete or self._of(reached)[0] is not self._log[0]

    def named_lately(self, begin: int, end: int, now: float) -> bool:
        """Whether a REACHED named an item in [begin, end) lately, perhaps as a repetition."""
        return self.repeats and any(
            begin <= one.seq < end and now - one.now < MAX_MESSAGE_DELAY for one in self._log)

    def _of(self, reached: ReachedReport) -> list[ReachedReport]:
        """The series that a REACHED may belong to, up to it, in the order sent."""
        begin = end = self._log.index(reached) if self.repeats and reached in self._log else -1
        if end < 0:
            return [reached]
        while begin and self._log[begin - 1].seq == reached.seq:
            begin -= 1
        series: list[ReachedReport] = []
        for one in self._log[begin:end + 1]:
            if series and not self._may_continue(series, one):
                series = []
            series.append(one)
        earliest = self._sent(reached)[0] - _DURATION
        return [one for one in series if self._sent(one)[1] >= earliest]

    def _may_continue(self, series: list[ReachedReport], reached: ReachedReport) -> bool:
        last = series[-1]
        (begin, end), (earliest, latest) = self._sent(last), self._sent(reached)
        if len(series) > 1 and latest - begin < _MIN_PERIOD:
            return False  # too early for a repetition; the first one may come at any time
        # a series with a pause has ended, unless frames were lost
        return earliest - end <= _MAX_PERIOD or last.frame is None or reached.frame is None or (
            not self._frames.whole(last.frame, reached.frame))

    def _sent(self, reached: ReachedReport) -> tuple[float, float]:
        """Vehicle times [s] between which it was sent."""
        if reached.sent is not None:
            return reached.sent
        if reached.frame is None:
            reached.sent = (self._positions.vehicle_time(reached.now),) * 2
            return reached.sent
        sent = self._positions.sent_between(reached.frame)
        if not math.isinf(sent[1]):
            reached.sent = sent
        return sent
