# SPDX-License-Identifier: Apache-2.0
"""What a re-plan changed, apart from what was flown meanwhile."""
from __future__ import annotations

from collections.abc import Iterable

from uav_task_alloc.allocator.records import UavList

Step = tuple[str, str]  # who flies a task, and after which other; '': first


def changed_tasks(before: Iterable[UavList], after: Iterable[UavList]) -> frozenset[str]:
    """Tasks that are new in a list, have moved to another UAV, or follow on another task.

    What left the lists (flown, withdrawn, left out) makes its followers no changed ones.
    """
    new = list(after)
    listed = {task_id for each in new for task_id in each.task_ids}
    old = _steps(before, listed)
    return frozenset(task_id for task_id, step in _steps(new, listed).items()
                     if old.get(task_id) != step)


def _steps(lists: Iterable[UavList], listed: set[str]) -> dict[str, Step]:
    """The step to each task, as if only those of `listed` had ever been there."""
    steps = {}
    for each in lists:
        last = ''
        for task_id in each.task_ids:
            if task_id in listed:
                steps[task_id] = (each.uav, last)
                last = task_id
    return steps
