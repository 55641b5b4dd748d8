# SPDX-License-Identifier: Apache-2.0
"""Items passed by MISSION_CURRENT without a REACHED: were they flown, or skipped?

A current item that has moved on only claims that the items before it were flown: those are
completed at which the vehicle's own positions were.
"""
from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

from uav_task_alloc.mavlink.mission.flown_path import CLOSE, PositionSample, Visit
from uav_task_alloc.mavlink.mission.item import Item, leg_count
from uav_task_alloc.mavlink.mission.position_history import LOOSE_RADIUS, PositionHistory
from uav_task_alloc.mavlink.transport.frame_log import FrameLog
from uav_task_alloc.model import Point

NO_TASKS: frozenset[str] = frozenset()
_BLIND = 30.0  # [s] to wait for a position that shows where it is after a claim
_FRAMES_AFTER = 10  # frames after MISSION_CURRENT in which REACHED may follow
_COUNTED = 2.0  # [s] for which a vehicle is at an item, at most, before it goes on to the next


@dataclass(frozen=True, slots=True)
class Claim:
    """Items that the vehicle has passed by MISSION_CURRENT, without a REACHED."""

    items: tuple[Item, ...]
    route: tuple[Item, ...]  # from the first of them on, to the end of the mission
    since: float  # vehicle time [s] at which the first of them became current
    until: float  # vehicle time [s] at which it was past them
    deadline: float  # [s] after which no evidence is awaited
    epoch: int
    frames: tuple[int, int] | None  # between which a REACHED would be; None: not known
    frame: int | None  # of the MISSION_CURRENT with the item after them
    skips: bool  # more than one item: another station has set the current item
    in_flight: bool  # in mission mode, so that unobserved items may have been flown
    home: Point | None = None  # [m] ENU; where it returns to at the end of `route`
    first: Item | None = None  # that was current; None: not known
    others_since: float = -math.inf  # vehicle time [s] until which `first` was reported as current


class _Judged(NamedTuple):
    """Items of one claim that are decided."""

    flown: tuple[Item, ...]
    passed_over: tuple[Item, ...]


class PassedItems:
    """The claims that are not decided yet.

    Args:
        frames: numbers of the frames received.
        positions: of the vehicle.
    """

    def __init__(self, frames: FrameLog, positions: PositionHistory) -> None:
        self._frames, self._positions = frames, positions
        self.claims: tuple[Claim, ...] = ()  # those that are open, in order

    def add(self, claim: Claim) -> None:
        """Add a claim, to be judged."""
        self.claims = (*self.claims, claim)

    def note_reached(self, item: Item) -> None:
        """Note a REACHED that may be of an item: the lack of one proves nothing any more."""
        self.claims = tuple(
            replace(claim, frames=None) if any(item is one for one in claim.items) else claim
            for claim in self.claims)

    def seen(self) -> tuple[Item, ...]:
        """Items of open claims at which the vehicle was seen, where nothing more will come."""
        return () if not self.claims else tuple(
            item for claim in self.claims for item in claim.items
            if self._visit(item, claim) is Visit.YES or self._approached(item, claim))

    def in_order(self) -> frozenset[str]:
        """Tasks of open claims that were passed one by one, as a mission is flown."""
        return frozenset(item.task for claim in self.claims if not claim.skips
                         for item in claim.items) if self.claims else NO_TASKS

    def drop_epoch(self, epoch: int) -> None:
        """Drop the claims of an epoch, by its number: its items are other ones."""
        self.claims = tuple(claim for claim in self.claims if claim.epoch != epoch)

    def clear(self) -> None:
        """Drop all claims: the mission on board is unknown."""
        self.claims = ()

    def judge(self, claim: Claim, items: tuple[Item, ...], now: float,
              left_unseen: bool = False) -> _Judged:
        """Decide which items of a claim were flown; the claim is dropped once all are decided.

        Args:
            claim: an open one.
            items: those of it that are not completed.
            now: steady time [s].
            left_unseen: whether it left mission mode in a gap of the positions since the claim.

        Returns:
            The items decided by this call.
        """
        if self._has_no_reached(claim):
            self._drop(claim)
            return _Judged((), items)
        if items and claim.frames is not None and now < claim.deadline:
            return _Judged((), ())  # REACHED may still come, or every frame without one
        visits = {item.task: self._visit(item, claim) for item in items}
        seen = tuple(i for i in items if visits[i.task] is Visit.YES)
        rest = tuple(i for i in items if visits[i.task] is not Visit.YES)
        blind = self._positions.path.newest < claim.until
        if rest and now < claim.deadline + _BLIND * blind:
            return _Judged(seen, ())
        self._drop(claim)
        unseen = self._unobserved(rest, visits, claim, left_unseen)
        return _Judged(seen + unseen, tuple(i for i in rest if i not in unseen))

    def _drop(self, claim: Claim) -> None:
        self.claims = tuple(each for each in self.claims if each is not claim)

    def _unobserved(self, rest: tuple[Item, ...], visits: dict[str, Visit],
                    claim: Claim, left_unseen: bool) -> tuple[Item, ...]:
        """At the deadline: the items that can have been flown in a gap of the positions."""
        items = tuple(
            i for i in rest if visits[i.task] is Visit.UNOBSERVED and i.position is not None)
        return items if items and self.flown_unseen(items, claim, left_unseen) else ()

    def flown_unseen(self, items: tuple[Item, ...], claim: Claim, left_unseen: bool) -> bool:
        """Whether it reappeared on a leg after them, and had the time to fly there.

        Where it has left mission mode unseen, it may reappear anywhere after a single item.

        Args:
            items: of the claim, that were not observed.
            claim: of them.
            left_unseen: whether it has left mission mode unseen since.
        """
        at = [n for n, item in enumerate(claim.route) if any(item is one for one in items)]
        if not at:
            return False
        for end in range(at[-1] + 1, len(claim.route) + 1):
            flown = claim.route[at[0]:end]
            last = end == len(claim.route)
            then = None if last else claim.route[end].position
            if self._positions.path.could_have_flown(
                    [item.position for item in flown if item.position is not None], then,
                    math.fsum(item.params[0] for item in flown), claim.since,
                    anywhere=left_unseen and not claim.skips,
                    home=claim.home if last else None, until=claim.until):
                return True
        return False

    def _has_no_reached(self, claim: Claim) -> bool:
        """Whether every frame was received among which REACHED would be, and it was not there."""
        if claim.frames is None:
            return False
        first, last = claim.frames[0], claim.frames[1] + _FRAMES_AFTER
        return self._frames.newest >= last and self._frames.whole(first, last)

    def _visit(self, item: Item, claim: Claim) -> Visit:
        if item.position is None:
            return Visit.NO
        # what ends the hold of a single item is that the mission goes on
        hold = item.params[0] if claim.skips or not claim.in_flight else 0.0
        return self._positions.path.visited(
            item.position, item.radius, hold, _current_since(item, claim), self._until(claim),
            0.0 if claim.skips else CLOSE)

    def _approached(self, item: Item, claim: Claim) -> bool:
        """Whether it was about to reach a single item without a hold, by its last position."""
        if claim.skips or not claim.in_flight or item.params[0] > 0.0 or item.position is None:
            return False
        return self._positions.path.approached(
            item.position, item.radius, _current_since(item, claim), self._until(claim))

    def _until(self, claim: Claim) -> float:
        """Vehicle time [s] at which it was past them, by the order of its frames."""
        if claim.frame is None:
            return claim.until
        # a place passed after another station had set the current item does not count
        return min(claim.until, self._positions.sent_before(
            claim.frame, claim.until, earliest=claim.skips))


def _current_since(item: Item, claim: Claim) -> float:
    """Vehicle time [s] from which an item of a claim may have been flown: while it is current."""
    if item is not claim.first:
        return max(claim.since, claim.others_since)
    if claim.in_flight:
        return claim.since
    # the mission was left: an item that stayed current long after it was passed was not flown
    return max(claim.since, claim.others_since - item.params[0] - _COUNTED)


def flown_nearby(items: tuple[Item, ...], flown: Item) -> tuple[Item, ...]:
    """Of items passed at once, those that may be completed: the one flown, and those next to it.

    Args:
        items: passed at once.
        flown: the item that was being flown.
    """
    at = flown.position
    return tuple(i for i in items if flown.completes and at is not None
                 and i.position is not None and math.dist(i.position, at) < LOOSE_RADIUS)


def flown_between(items: tuple[Item, ...], begin: int, end: int, now: float, frame: int,
                  positions: PositionHistory, home: Point | None = None,
                  left_unseen: bool = False, since: float = -math.inf) -> set[int]:
    """Judge the items that were passed while no bridge ran; no evidence of them will come.

    Args:
        items: on board, with their positions.
        begin: index of the item that was flown when the previous run ended.
        end: the current item that was reported since.
        now: steady time [s] at which that was received.
        frame: its number.
        positions: of the vehicle.
        home: [m] ENU, where it returns to after the last item; None: it does not, or not known.
        left_unseen: whether it has left mission mode in a gap of the positions.
        since: vehicle time [s]; what it was at before does not count.

    Returns:
        Indices of those that were flown.
    """
    claim = replace(_numbered_claim(items, begin, end, home), since=since,
                    until=positions.vehicle_time(now), frame=frame)
    judged = PassedItems(FrameLog(), positions).judge(claim, claim.items, now, left_unseen)
    return {int(item.task) for item in judged.flown}


def flown_in_gap(items: tuple[Item, ...], begin: int, end: int,
                 samples: Iterable[PositionSample], left_unseen: bool,
                 home: Point | None = None) -> set[int]:
    """Judge the items that the previous run has seen passed, by the positions it has stored.

    Args:
        items: on board, with their positions.
        begin: index of the first item.
        end: index after the last item.
        samples: those positions, in order; only a gap between them is evidence.
        left_unseen: whether it has left mission mode in that gap.
        home: see `flown_between`.

    Returns:
        Indices of those that were flown.
    """
    positions, claim = PositionHistory(), _numbered_claim(items, begin, end, home)
    for sample in samples:
        positions.path.add(sample)
    placed = tuple(item for item in claim.items if item.position is not None)
    flown = PassedItems(FrameLog(), positions).flown_unseen(placed, claim, left_unseen)
    return {int(item.task) for item in placed} if flown else set()


def _numbered_claim(items: tuple[Item, ...], begin: int, end: int, home: Point | None) -> Claim:
    """A claim about the items of a mission that was read, each with its index as its task."""
    passed = tuple(replace(items[n], task=f'{n}') for n in range(begin, end)
                   if not items[n].is_action)
    route = tuple(item for item in (*passed, *items[end:]) if item.position is not None)
    return Claim(passed, route, -math.inf, math.inf, -math.inf, 0, None, None,
                 skips=leg_count(passed) > 1, in_flight=True, home=home)
