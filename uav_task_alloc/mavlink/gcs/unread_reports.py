# SPDX-License-Identifier: Apache-2.0
"""The reports of a vehicle received before the mission on board was read."""
from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass
from itertools import pairwise, takewhile
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.mavlink.mission.passed_items import flown_between
from uav_task_alloc.mavlink.mission.position_history import LOOSE_RADIUS, PositionHistory
from uav_task_alloc.model import Point

_MAX_CURRENTS = 512  # MISSION_CURRENT kept until the vehicle is located: four minutes
_MAX_REACHED = 32  # REACHED kept until then
_PLACE_DELAY = 2.0  # [s] after a REACHED in which a position still shows its place
_REPETITION = 1.05  # [s] after which PX4 has repeated a REACHED
_LATE_PLACE = 10.0  # [s] the same, where the reports of the current item agree


class UnreadCurrent(NamedTuple):
    """A MISSION_CURRENT that was received before the mission was read."""

    seq: int  # index without home
    at: float  # [s] received
    frame: int  # its number
    flying: bool  # in mission mode, so that it is of the mission that is flown
    complete: bool  # with the report that the mission is flown to its end
    total: int | None = None  # items of the mission that it reported to fly; None: it did not
    holding: bool = False  # in the mode in which the bridge has it wait, as for an upload


@dataclass(slots=True)
class UnreadReached:
    """A REACHED that was received before the mission was read."""

    seq: int  # index without home
    at: float  # [s] received
    frame: int  # its number
    place: Point | None  # [m] ENU of the vehicle; None: not known
    current_after: int | None = None  # the largest current item reported since
    flown_since: float = 0.0  # [m] that it may have flown from the item to `place`
    late: bool = False  # `place` is of later than _PLACE_DELAY

    def place_later(self, place: Point, speed: float, now: float) -> None:
        """Take a position that came after the REACHED, as none had come before.

        Args:
            place: of the vehicle [m] ENU.
            speed: of the vehicle [m/s]; NaN: not known.
            now: steady time [s].
        """
        self.place, self.late = place, now - self.at >= _PLACE_DELAY
        self.flown_since = 0.0 if math.isnan(speed) else speed * (now - self.at)

    def may_be_of(self, held: tuple[Item, ...], repeats: bool) -> bool:
        """Whether the current item was past it then; a repetition of another mission may not.

        Args:
            held: the items on board, without home.
            repeats: REACHED is repeated (PX4), so that a current item has to show it.
        """
        after, last = self.current_after, len(held) - 1
        if after is None:
            return self.seq <= last and not repeats
        return self.seq <= last and (after > self.seq or self.seq == after == last)


class UnreadReports:
    """Keeps what is received of a mission until it is read, also over a restart of the vehicle.

    Args:
        telemetry: of the vehicle.
        positions: of the vehicle.
        repeats: it repeats a REACHED of the mission before (PX4).
    """

    def __init__(self, telemetry: Telemetry, positions: PositionHistory, repeats: bool) -> None:
        self._telemetry, self._positions, self._repeats = telemetry, positions, repeats
        self.currents: list[UnreadCurrent] = []
        self._reached: list[UnreadReached] = []
        self._stored: int | None = None  # items on board by the newest report of that
        # of before a restart of the vehicle, whose clock starts again
        self._before: tuple[list[UnreadCurrent], PositionHistory] | None = None
        self._earlier: list[UnreadCurrent] = []  # of before it, until each REACHED was judged

    def note_current(self, seq: int, now: float, frame: int, located: bool) -> None:
        """Take a MISSION_CURRENT.

        Args:
            seq: index without home.
            now: steady time [s].
            frame: its number.
            located: whether the vehicle is located, so that it needs not be kept.
        """
        if not located and len(self.currents) < _MAX_CURRENTS:
            self.currents.append(UnreadCurrent(
                seq, now, frame, self._telemetry.in_mission,
                self._telemetry.mission.state == d.MISSION_STATE_COMPLETE, self._count_flown(),
                self._telemetry.mode is ModeFunction.HOLD))
        self._drop_replaced()
        for reached in self._reached:
            if frame > reached.frame:
                reached.current_after = max(seq, reached.current_after or 0)
        self._place(now)

    def _drop_replaced(self) -> None:
        """Drop each REACHED of a PX4 whose mission was replaced since, by its number of items."""
        before, stored = self._stored, self._telemetry.mission.total
        self._stored = before if stored is None else stored
        if self._repeats and before not in (None, self._stored):
            self._reached.clear()

    def _count_flown(self) -> int | None:
        """How many items the mission has that the newest MISSION_CURRENT reports to be flown."""
        telemetry = self._telemetry
        return telemetry.mission.total if telemetry.in_mission and (
            telemetry.mission.state == d.MISSION_STATE_ACTIVE) else None

    def note_reached(self, seq: int, now: float, frame: int) -> None:
        """Take a MISSION_ITEM_REACHED.

        Args:
            seq: index without home.
            now: steady time [s].
            frame: its number.
        """
        if len(self._reached) < _MAX_REACHED and all(seq != each.seq for each in self._reached):
            known = self._telemetry.has_position
            self._reached.append(
                UnreadReached(seq, now, frame, self._telemetry.position if known else None))

    def _place(self, now: float) -> None:
        """Give each REACHED that came before any position the present one."""
        for reached in self._reached if self._telemetry.has_position else ():
            if reached.place is None and now - reached.at < _LATE_PLACE:
                reached.place_later(self._telemetry.position, self._telemetry.speed, now)

    def restarted(self, located: bool) -> None:
        """Keep what was received before a restart of the vehicle, with the positions of then.

        Args:
            located: whether the vehicle is located, so that all is judged; the mission may have
                been replaced since.
        """
        if located:
            self._before, self._earlier = None, []
        elif self.currents:
            self._before = self.currents, deepcopy(self._positions)
            self._earlier, self.currents = self.currents, []

    def take_reached(self, held: tuple[Item, ...], recorded: int | None,
                     now: float) -> list[UnreadReached]:
        """Take each REACHED that can be of the mission on board, and drop all.

        Args:
            held: the items on board, with their positions, without home.
            recorded: current item of the previous run of the bridge; None: it was of another
                mission, or is not known.
            now: steady time [s].

        Returns:
            Those of the mission on board.
        """
        self._place(now)
        reached = []
        for each in self._reached:
            placed, in_turn = each.place is not None and not each.late, self._is_in_turn(
                each, recorded)
            if (self._is_of(each, held) and (placed or in_turn or each.place is None)) or (
                    recorded is not None and not placed and in_turn) or (
                    self._is_recorded(each, recorded, held)):
                reached.append(each)
        self._reached.clear()
        self._earlier = []
        return reached

    def passed(self, held: tuple[Item, ...], home: Point | None,
               while_current: bool = False) -> set[int]:
        """Return the items that it was seen to pass in mission mode.

        Args:
            held: the items on board, with their positions, without home.
            home: [m] ENU, where it returns to after the last item; None: it does not, or not
                known.
            while_current: only what it was at since a report of it as the item that it flies.

        Returns:
            Indices of those that the positions show to be flown.
        """
        return _passed(self.currents, self._positions, held, home, while_current)

    def passed_unseen(self, held: tuple[Item, ...]) -> set[int]:
        """Return the items passed in mission mode before any position, by the first position.

        It is on the leg after such an item, of a vehicle that flies it.

        Args:
            held: see `passed`.
        """
        positions, path = self._positions, self._positions.path
        if not path.samples:
            return set()
        return {before.seq for before, then in pairwise(each for each in self.currents
                                                        if each.flying)
                if then.seq == before.seq + 1 < len(held)
                and positions.vehicle_time(then.at) <= path.samples[0].t
                and path.begins_on_leg(held[before.seq].position, held[then.seq].position)}

    @property
    def began_held(self) -> bool:
        """Whether it waited where the bridge has it wait, as for an upload, before it flew.

        An ArduPilot keeps the current item when its mission is replaced.
        """
        before = takewhile(lambda each: not each.flying, self.currents)
        return not self._repeats and any(each.holding for each in before)

    def flown_first(self, count: int) -> int:
        """Return the item that a mission of so many items was flying when this run began.

        Args:
            count: number of items on board, without home.

        Returns:
            Its index; 0: not known. A report that was sent before the first frame of this run may
            be of a mission that was replaced since, as may what follows a hold.
        """
        first = self._telemetry.frames.first
        if self.began_held:
            return 0
        return next((each.seq for each in self.currents
                     if each.total == count and each.frame > first), 0)

    def take_passed_before(self, held: tuple[Item, ...], home: Point | None) -> set[int]:
        """Take the items that it was seen to pass before it was restarted.

        Args:
            held: see `passed`.
            home: see `passed`.

        Returns:
            Indices of those that were flown.
        """
        before, self._before = self._before, None
        return set() if before is None else _passed(*before, held, home)

    def _is_in_turn(self, reached: UnreadReached, recorded: int | None) -> bool:
        """Whether it came between reports of its item and of what follows as the current item.

        It shows that without a position, too, as in an EKF failsafe; PX4's repetitions do not.
        The first one is known as that where no frame was lost in the second before it.
        """
        currents = self._earlier + self.currents
        before = [each.seq for each in currents if each.frame < reached.frame]
        after = [each for each in currents if each.frame > reached.frame][:1]
        known = before[-1] if before else recorded
        if self._repeats and not any(
                reached.at - each.at >= _REPETITION
                and self._telemetry.frames.whole(each.frame, reached.frame)
                for each in currents if each.frame < reached.frame):
            return False
        return known == reached.seq and any(
            each.flying and each.seq == reached.seq + (not each.complete) for each in after)

    def _is_recorded(self, reached: UnreadReached, recorded: int | None,
                     held: tuple[Item, ...]) -> bool:
        """Whether it names the item that was flown last by the record, and was sent there.

        It is sent once (ArduPilot); a restart of the vehicle since then sets the current item
        back to the first.
        """
        return not self._repeats and recorded is not None and reached.place is not None and (
            not reached.late and reached.seq == recorded < len(held)
            and self._was_near(held[recorded], reached))

    def _is_of(self, reached: UnreadReached, held: tuple[Item, ...]) -> bool:
        """Whether a REACHED can be of the mission on board, by the current item and the place."""
        before = [each.seq for each in self.currents if each.frame < reached.frame][-1:]
        after = reached.current_after
        if self._repeats and before == [len(held) - 1] == [reached.seq] and (
                after is None or after < reached.seq):  # it may begin again
            reached.current_after = before[0]  # no item follows the last one
        if not reached.may_be_of(held, self._repeats):
            return False
        item = held[reached.seq]
        if reached.seq == reached.current_after:  # the last one, which may be still ahead
            return item.position is not None and self._positions.path.visited_at(
                item.position, item.radius, -math.inf) is not None
        return self._was_near(item, reached)

    def _was_near(self, item: Item, reached: UnreadReached) -> bool:
        """Whether an item is near the place of a REACHED, or any position received so far."""
        if item.position is None:
            return False
        if reached.place is None:
            return self._positions.path.visited_at(
                item.position, item.radius + LOOSE_RADIUS, -math.inf) is not None
        return math.dist(item.position, reached.place) <= (
            item.radius + LOOSE_RADIUS + reached.flown_since)


def _passed(currents: list[UnreadCurrent], positions: PositionHistory, held: tuple[Item, ...],
            home: Point | None, while_current: bool = False) -> set[int]:
    flying, passed = [each for each in currents if each.flying], set[int]()
    for before, then in pairwise(flying):  # it falls at a restart that is not noticed yet
        if before.seq < then.seq <= len(held):
            since = -math.inf if not while_current else positions.vehicle_time(
                next(each.at for each in flying if each.seq == before.seq))
            passed |= flown_between(
                held, before.seq, then.seq, then.at, then.frame, positions, home, since=since)
    return passed
