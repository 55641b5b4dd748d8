# SPDX-License-Identifier: Apache-2.0
"""What of the world is not on disk, as rows of the journal."""
from __future__ import annotations

from collections.abc import Iterable

from uav_task_alloc.allocator.persistence.order_rows import mark_all_orders, order_rows
from uav_task_alloc.allocator.persistence.restore import (
    change_row,
    list_row,
    off_row,
    proposal_row,
    revision_row,
    task_row,
    work_row,
    zones_row,
)
from uav_task_alloc.allocator.replanning.learned_state import learned_row
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.journal import JournalRow


def rows(world: World, state: object, most: int | None = None) -> list[JournalRow]:
    """Return the journal rows of all that has changed since it was last written.

    Args:
        world: of the allocator.
        state: learned state of the best plan.
        most: tasks at once; None: all.

    Returns:
        Rows to write, those of work and tasks first; a row without a body deletes one.
    """
    unsaved, tasks, lists = world.unsaved(), world.task_records(), world.lists_in_force()
    works = world.works.records  # before the tasks: without its row a piece is dropped
    changed = [work_row(works[task_id]) if task_id in works else JournalRow('work', task_id, None)
               for task_id in sorted(unsaved['work'])]
    changed += [task_row(tasks[task_id]) if task_id in tasks else JournalRow('task', task_id, None)
               for task_id in sorted(unsaved['task'])[:most]]
    changed += [list_row(lists[uav_id]) if uav_id in lists else JournalRow('list', uav_id, None)
                for uav_id in sorted(unsaved['list'])]
    changed += [change_row(uav_id, world.fleet.change_from.get(uav_id))
                for uav_id in sorted(unsaved['change'])]
    seen = world.announced.seen.blocks
    changed += [JournalRow('demand', number, seen.get(number))
                for number in sorted(unsaved['demand'])]
    make = {'zones': lambda: zones_row(world.airspace.zones.values()),
            'off': lambda: off_row(world.fleet.switched_off),
            'revision': lambda: revision_row(world.revision),
            'proposal': lambda: proposal_row(world.proposal),
            'learner': lambda: learned_row(state)}
    return (changed + order_rows(world.orders)
            + [make[kind]() for kind in sorted(unsaved[''])])


def mark_all(world: World) -> None:
    """Mark the whole world as not written.

    Args:
        world: of the allocator; its sets of unsaved ids are changed.
    """
    unsaved = world.unsaved()
    unsaved['task'].update(world.task_records())
    unsaved['list'].update(world.lists_in_force())
    unsaved['change'].update(world.fleet.change_from)
    unsaved['work'].update(world.works.records)
    unsaved['demand'].update(world.announced.seen.blocks)
    mark_all_orders(world.orders)
    unsaved[''].update(('zones', 'off', 'revision', 'learner', 'proposal'))


def mark_written(world: World, written: Iterable[JournalRow] | None) -> bool:
    """Mark rows as written.

    Args:
        world: of the allocator; its sets of unsaved ids are changed.
        written: rows that are on disk; None: everything is.

    Returns:
        Whether nothing is left to write.
    """
    unsaved = world.unsaved()
    for row in written or ():
        unsaved.get(row.kind, unsaved['']).discard(row.id or row.kind)
    for ids in unsaved.values() if written is None else ():
        ids.clear()
    return not any(unsaved.values())
