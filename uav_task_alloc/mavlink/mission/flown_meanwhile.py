# SPDX-License-Identifier: Apache-2.0
"""Where a vehicle goes on with a mission that it has taken, and has not flown from its start."""
from __future__ import annotations

from uav_task_alloc.mavlink.mission.diff import MissionDiff, point_at_or_before
from uav_task_alloc.mavlink.mission.item import Item, all_alike


def resumed_at(items: tuple[Item, ...], current: int | None, diff: MissionDiff) -> int:
    """Return where a vehicle goes on with a new mission that it has taken while it flew on.

    Args:
        items: that it flew until then.
        current: index of the item that it flew; None: not known.
        diff: to the new mission; its start was chosen when the upload began.

    Returns:
        The index of the same item of the same task in the new mission, where what is before it
        was flown in the meantime; else the start. It is never before the start.
    """
    old, new = _leg_end(items, current), _leg_end(diff.items, diff.start)
    if old is None or new is None or current is None:
        return diff.start
    index = new - (old - current)
    first = current - (index - diff.start)  # what would be left out was flown before
    if index <= diff.start or first < 0 or items[old].task != diff.items[new].task or (
            not all_alike(diff.items[diff.start:new + 1], items[first:old + 1])):
        return diff.start
    return max(diff.start, point_at_or_before(diff.items, index))


def _leg_end(items: tuple[Item, ...], begin: int | None) -> int | None:
    """Index of the item that completes the task under way at `begin`."""
    return None if begin is None else next(
        (n for n in range(begin, len(items)) if items[n].completes), None)


def first_task(diff: MissionDiff) -> str | None:
    """Return the first task that is completed after the start of a mission.

    Args:
        diff: to the mission.

    Returns:
        Its id; None where there is none.
    """
    return next((item.task for item in diff.items[diff.start:] if item.completes), None)
