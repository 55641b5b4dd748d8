# SPDX-License-Identifier: Apache-2.0
"""Which tasks a plan may not take from a UAV: that it serves or flies to, and the next ones."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.allocator.state.fleet import Fleet
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.tasks import TaskRegistry


def locked_tasks(tasks: TaskRegistry, fleet: Fleet, lists: PublishedLists, committed: int,
                 hold: bool, serving: Callable[[str], str] = lambda uav_id: '',
                 ) -> dict[str, tuple[str, ...]]:
    """Return the locked tasks of each usable UAV that has any, in the order flown.

    Args:
        tasks, fleet, lists: the present state.
        committed: tasks of a UAV in flight that are locked, with the one it flies.
        hold: lock whole lists, also of UAVs that fly none of their tasks.
        serving: the task that a UAV has reached and not completed, '' for none; it is locked
            whatever `committed` is.
    """
    owners, locked = lists.owners(), dict[str, tuple[str, ...]]()
    seen: set[str] = set()
    for uav_id in fleet.usable_ids():
        active = fleet.active.get(uav_id, '')
        if active in seen or owners.get(active, uav_id) != uav_id:
            active = ''  # another UAV has it
        listed = lists.get(uav_id).task_ids
        if hold:
            ids = (*filter(None, (active,)), *(t for t in listed if t != active))
        elif active and can_fly(tasks, fleet, uav_id, active):
            after = listed[listed.index(active) + 1:] if active in listed else ()
            most = max(committed, int(serving(uav_id) == active))
            ids = (active, *(t for t in after if can_fly(tasks, fleet, uav_id, t)))[:most]
        else:
            ids = ()
        locked[uav_id] = tuple(t for t in ids if can_fly(tasks, fleet, uav_id, t))
        seen.update(locked[uav_id])
    return {uav_id: ids for uav_id, ids in locked.items() if ids}


def can_fly(tasks: TaskRegistry, fleet: Fleet, uav_id: str, task_id: str) -> bool:
    """Return whether a task is open and a known UAV may fly it."""
    record = tasks.records.get(task_id)
    return (record is not None and record.open
            and fleet.may_fly(uav_id, record.task, record.failed_on))
