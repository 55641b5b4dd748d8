# SPDX-License-Identifier: Apache-2.0
"""What has to change on board for a new list: nothing, the current item, the tail, or all."""
from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
from enum import Enum

from uav_task_alloc.mavlink.mission.items import Item, all_alike


class DiffKind(Enum):
    """Means of bringing a new list on board, the cheapest first."""

    KEEP = 'keep'
    JUMP = 'jump'  # set the current item
    APPEND = 'append'  # nothing changes but the end
    REPLACE = 'replace'  # a whole new mission


@dataclass(frozen=True, slots=True)
class MissionDiff:
    """The whole mission to have on board, and the item to fly now."""

    kind: DiffKind  # how the mission on board changes
    items: tuple[Item, ...]  # by seq
    start: int  # seq


class LatestDiff:
    """Compares as `diff_missions`; called again with the same, it returns the same."""

    def __init__(self) -> None:
        self._latest: tuple[tuple[Item, ...], tuple[Item, ...], object, MissionDiff] | None = None

    def of(self, held: tuple[Item, ...], current: int | None, wanted: tuple[Item, ...],
           done: frozenset[str]) -> MissionDiff:
        """See `diff_missions`.

        Args:
            held: items on board, without home.
            current: index of the item being flown; None: none is.
            wanted: items of the list, beginning with the leg to its first task.
            done: ids of completed tasks.
        """
        latest, others = self._latest, (current, done)
        # not by ==: items that compare equal may be for other tasks
        if latest is not None and latest[0] is held and latest[1] is wanted and (
                latest[2] == others):
            return latest[3]
        diff = diff_missions(held, current, wanted, done=done)
        self._latest = held, wanted, others, diff
        return diff


def diff_missions(held: tuple[Item, ...], current: int | None, wanted: tuple[Item, ...], *,
                  done: Container[str] = (), append: bool = True) -> MissionDiff:
    """Compare the items on board with the wanted ones; O(n) for n items.

    Detour points of the first leg that have been flown are not flown again; the others are, even
    where the vehicle is past them, as they lead around a zone. No jump skips a task that is not
    `done`, nor an item that may stand for one (after a restart of the bridge items carry no task).

    Args:
        held: items on board, without home.
        current: index of the item being flown; None: none is.
        wanted: items of the new list, beginning with the leg to its first task.
        done: ids of completed tasks.
        append: whether the autopilot takes a longer list without restarting the current item.

    Returns:
        The change with the fewest side effects on the flight.

    Raises:
        ValueError: `wanted` is empty.
    """
    if not wanted:
        raise ValueError('wanted items = (): expected at least one')
    if current is not None:
        passed = _passed(held, current, wanted)
        rest = held[current:]
        if passed is not None and rest and all_alike(wanted[passed:], rest):
            return MissionDiff(DiffKind.KEEP, held[:current] + wanted[passed:], current)
    start = len(held) - len(wanted)
    if start >= 0 and all_alike(wanted, held[start:]) and not any(
            _may_be_open(item, done) for item in held[current or 0:start]):
        return MissionDiff(DiffKind.JUMP, held[:start] + wanted, start)
    if current is not None and rest and passed is not None:
        ahead = wanted[passed:]
        if append and len(ahead) > len(rest) and all_alike(ahead[:len(rest)], rest):
            return MissionDiff(DiffKind.APPEND, held[:current] + ahead, current)
        return MissionDiff(DiffKind.REPLACE, wanted, point_at_or_before(wanted, passed))
    return MissionDiff(DiffKind.REPLACE, wanted, 0)


def point_at_or_before(items: tuple[Item, ...], index: int) -> int:
    """Return the index of the point from which an action is carried out.

    Args:
        items: of a mission; it does not begin with an action.
        index: of any item.

    Returns:
        `index` itself where that is no action.
    """
    while index > 0 and index < len(items) and items[index].is_action:
        index -= 1
    return index


def _may_be_open(item: Item, done: Container[str]) -> bool:
    if item.is_action:
        return False
    return item.task not in done if item.completes else item.position is None


def _passed(held: tuple[Item, ...], current: int, wanted: tuple[Item, ...]) -> int | None:
    """Number of detour points of the first leg already passed; None where it is not flown."""
    leg = next((n for n, item in enumerate(wanted) if item.completes or not item.task),
               len(wanted) - 1)
    for count in range(min(leg, current), -1, -1):
        if all_alike(wanted[:count + 1], held[current - count:current + 1]):
            return count
    return None
