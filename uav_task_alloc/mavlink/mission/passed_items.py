# SPDX-License-Identifier: Apache-2.0
"""Items passed as MISSION_CURRENT says, without a REACHED: were they flown, or left out?

That the current item has moved on is a claim: it completes what it passes only where the vehicle
was, by its own positions.
"""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from uav_task_alloc.mavlink.mission.flown_path import CLOSE, Visit
from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.mavlink.mission.position_history import LOOSE_RADIUS, PositionHistory
from uav_task_alloc.mavlink.transport.frame_log import FrameLog

FRAMES_AFTER = 10  # beyond the MISSION_CURRENT that moved on: REACHED may come after it


@dataclass(frozen=True, slots=True)
class Claim:
    """Items that the vehicle has passed, as MISSION_CURRENT says, without a REACHED."""

    items: tuple[Item, ...]
    route: tuple[Item, ...]  # from the first of them on, to the end of the mission
    since: float  # [s] of the vehicle's clock
    until: float  # the same: then it was past them
    deadline: float  # [s] after which nothing more is expected
    epoch: int
    frames: tuple[int, int] | None  # in which a REACHED would have come; None: not known
    frame: int | None  # that told the item after them
    skips: bool  # over more than one item: somebody has set the current one
    in_flight: bool  # it was flying, so what was not seen may have been flown


class _Judged(NamedTuple):
    """Items of one claim that need not be waited for any more."""

    flown: tuple[Item, ...]
    left: tuple[Item, ...]  # passed over


class PassedItems:
    """The claims that nothing has shown yet to be true or not."""

    def __init__(self, frames: FrameLog, positions: PositionHistory) -> None:
        self._frames, self._positions = frames, positions
        self._claims: list[Claim] = []

    @property
    def claims(self) -> tuple[Claim, ...]:
        """Those that are open, in order."""
        return tuple(self._claims)

    def add(self, claim: Claim) -> None:
        """One that `judge` is to be asked about."""
        self._claims.append(claim)

    def clear(self) -> None:
        """Nothing is known of what is on board."""
        self._claims.clear()

    def judge(self, claim: Claim, items: tuple[Item, ...], now: float) -> _Judged:
        """What became of items of a claim, which is dropped once all of them are judged.

        Args:
            claim: one that is open.
            items: those of it that are not completed.
            now: [s].
        """
        if self._silent(claim):
            self._claims.remove(claim)
            return _Judged((), items)
        if items and claim.frames is not None and now < claim.deadline:
            return _Judged((), ())  # REACHED may still come, or all that came without it
        verdicts = {item.task: self._verdict(item, claim) for item in items}
        seen = tuple(i for i in items if verdicts[i.task] is Visit.YES)
        rest = tuple(i for i in items if verdicts[i.task] is not Visit.YES)
        if rest and now < claim.deadline:
            return _Judged(seen, ())
        self._claims.remove(claim)
        unseen = self._settle(rest, verdicts, claim)
        return _Judged(seen + unseen, tuple(i for i in rest if i not in unseen))

    def _settle(self, rest: tuple[Item, ...], verdicts: dict[str, Visit],
                claim: Claim) -> tuple[Item, ...]:
        """Nothing more will come: what it can have flown unseen it has flown, else it was left."""
        blind = tuple(
            i for i in rest if verdicts[i.task] is Visit.UNOBSERVED and i.position is not None)
        return blind if blind and self._flown_unseen(blind, claim) else ()

    def _flown_unseen(self, blind: tuple[Item, ...], claim: Claim) -> bool:
        """Wherever it was seen again: on the way from one of the items after them to the next."""
        at = [n for n, item in enumerate(claim.route) if any(item is one for one in blind)]
        if not at:
            return False
        for end in range(at[-1] + 1, len(claim.route) + 1):
            flown = claim.route[at[0]:end]
            then = claim.route[end].position if end < len(claim.route) else None
            if self._positions.path.could_have_flown(
                    [item.position for item in flown if item.position is not None], then,
                    math.fsum(item.params[0] for item in flown), claim.since):
                return True
        return False

    def _silent(self, claim: Claim) -> bool:
        """Every frame has come in which the vehicle would have told REACHED, and it did not."""
        if claim.frames is None:
            return False
        first, last = claim.frames[0], claim.frames[1] + FRAMES_AFTER
        return self._frames.newest >= last and self._frames.whole(first, last)

    def _verdict(self, item: Item, claim: Claim) -> Visit:
        if item.position is None:
            return Visit.NO
        return self._positions.path.visited(
            item.position, item.radius, item.params[0], claim.since, self._until(claim),
            0.0 if claim.skips else CLOSE)

    def _until(self, claim: Claim) -> float:
        """[s] of the vehicle's clock at which it was past them, by the order of its frames."""
        if claim.frame is None:
            return claim.until
        # what it came by after somebody had set the current item is nothing
        return self._positions.sent_before(claim.frame, claim.until, earliest=claim.skips)


def flown_nearby(items: tuple[Item, ...], flown: Item) -> tuple[Item, ...]:
    """Of items passed in a moment only what was flown, and what is beside it, may be completed."""
    place = flown.position
    return tuple(i for i in items if flown.completes and place is not None
                 and i.position is not None and math.dist(i.position, place) < LOOSE_RADIUS)
