# SPDX-License-Identifier: Apache-2.0
"""Which tasks a re-plan moved, apart from what was flown meanwhile."""
from __future__ import annotations

from collections.abc import Iterable

from uav_task_alloc.allocator.list_records import UavList

_Place = tuple[str, str]  # the UAV of a task, and the task before it; '' for the first


def changed_tasks(before: Iterable[UavList], after: Iterable[UavList]) -> frozenset[str]:
    """Return the tasks that are new in a list, moved to another UAV, or follow another task.

    A task is not changed because tasks before it left the lists (flown, withdrawn, left out).

    Args:
        before: lists that were in force.
        after: lists that replace them.

    Returns:
        Ids of tasks.
    """
    new = list(after)
    listed = {task_id for each in new for task_id in each.task_ids}
    old = _places(before, listed)
    return frozenset(task_id for task_id, place in _places(new, listed).items()
                     if old.get(task_id) != place)


def _places(lists: Iterable[UavList], listed: set[str]) -> dict[str, _Place]:
    """The place of each task, as if only those of `listed` had ever been in the lists."""
    places = {}
    for each in lists:
        last = ''
        for task_id in each.task_ids:
            if task_id in listed:
                places[task_id] = (each.uav, last)
                last = task_id
    return places
