# SPDX-License-Identifier: Apache-2.0
"""What has to change on board for a new list: nothing, the current item, the tail, or all."""
from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
from enum import Enum

from uav_task_alloc.mavlink.mission.items import Item, all_alike


class DiffKind(Enum):
    """Ways to a new list, the cheapest first."""

    KEEP = 'keep'
    JUMP = 'jump'  # set the current item
    APPEND = 'append'  # nothing changes but the end
    REPLACE = 'swap'


@dataclass(frozen=True, slots=True)
class MissionDiff:
    """The whole mission to have on board, and the item to fly now."""

    kind: DiffKind
    items: tuple[Item, ...]
    start: int


def diff_missions(held: tuple[Item, ...], current: int | None, wanted: tuple[Item, ...], *,
           done: Container[str] = (), append: bool = True) -> MissionDiff:
    """From the items on board, of which `current` is flown (None: none), to the wanted ones.

    `wanted` begins with the way to its first task. Detour points of it that have been flown are
    not flown again; those that have not are, even where the vehicle is beyond: a zone is there.
    No jump leaves out a task that is not `done`, nor an item that may be one: after a restart of
    the bridge, what lies behind has been flown.
    """
    if not wanted:
        raise ValueError('wanted items = (): expected at least one')
    if current is not None:
        passed = _passed(held, current, wanted)
        rest = held[current:]
        if passed is not None and rest and all_alike(wanted[passed:], rest):
            return MissionDiff(DiffKind.KEEP, _retag(held, current, wanted[passed:]), current)
    start = len(held) - len(wanted)
    if start >= 0 and all_alike(wanted, held[start:]) and not any(
            _may_be_open(item, done) for item in held[current or 0:start]):
        return MissionDiff(DiffKind.JUMP, _retag(held, start, wanted), start)
    if current is not None and rest and passed is not None:
        ahead = wanted[passed:]
        if append and len(ahead) > len(rest) and all_alike(ahead[:len(rest)], rest):
            return MissionDiff(DiffKind.APPEND, held[:current] + ahead, current)
        return MissionDiff(DiffKind.REPLACE, wanted, passed)
    return MissionDiff(DiffKind.REPLACE, wanted, 0)


def _may_be_open(item: Item, done: Container[str]) -> bool:
    return item.task not in done if item.completes else item.position is None


def _passed(held: tuple[Item, ...], current: int, wanted: tuple[Item, ...]) -> int | None:
    """How many detour points of the first leg lie behind; None where another leg is flown."""
    leg = next((n for n, item in enumerate(wanted) if item.completes or not item.task),
               len(wanted) - 1)
    for count in range(min(leg, current), -1, -1):
        if all_alike(wanted[:count + 1], held[current - count:current + 1]):
            return count
    return None


def _retag(held: tuple[Item, ...], start: int, wanted: tuple[Item, ...]) -> tuple[Item, ...]:
    """What was read back knows no tasks: take them from the list."""
    return held[:start] + wanted

