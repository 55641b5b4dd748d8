# SPDX-License-Identifier: Apache-2.0
"""What a plan makes of each open task: its UAV, or the reason why it has none."""
from __future__ import annotations

from collections.abc import Mapping

from uav_task_alloc.allocator.records import TaskRecord
from uav_task_alloc.allocator.state.fleet import Fleet, may_fly
from uav_task_alloc.allocator.state.task_state_machine import TaskStep, TaskTransition
from uav_task_alloc.allocator.state.tasks import without_failed
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.allocator.state.zone_checks import blocked_text
from uav_task_alloc.errors import first_of


def task_steps(world: World, left_out: Mapping[str, str]) -> list[TaskStep]:
    """Return an event for each open task.

    Args:
        world: as it is now.
        left_out: reason by task id, of the plan in force.

    Returns:
        LIST or START for tasks in a list, LIST for those of a later trip, else why there is no UAV
        for it.
    """
    fleet, usable = world.fleet, frozenset(world.fleet.usable_ids())
    owners, late = world.lists.owners(), world.deadlines.texts
    trips = {task_id: (uav_id, number) for uav_id, rows in world.later.items()
             for number, row in enumerate(rows, 1) for task_id in row}
    steps, left_out, absent = [], {**left_out, **world.obstructed}, _AbsentUavs(fleet, usable)
    for record in world.tasks.open():
        task_id = record.task.id
        uav_id, why = owners.get(task_id, ''), late.get(task_id, '')
        if uav_id and fleet.active.get(uav_id) == task_id:
            steps.append(TaskStep(task_id, TaskTransition.START, uav_id, why))
        elif uav_id:
            steps.append(TaskStep(task_id, TaskTransition.LIST, uav_id, why))
        elif task_id in trips:
            uav_id, number = trips[task_id]
            steps.append(TaskStep(task_id, TaskTransition.LIST, uav_id,
                                  f'after battery change {number} of {uav_id}'))
        else:
            steps.append(_unlisted(record, fleet, absent, left_out))
    return steps


class _AbsentUavs:
    """Which tasks only UAVs may fly that may not be given tasks now, and why they may not."""

    def __init__(self, fleet: Fleet, usable: frozenset[str]) -> None:
        self._fleet, self.usable = fleet, usable
        self._texts = dict[object, str]()  # by what decides who may fly a task

    def text(self, record: TaskRecord) -> str:
        """Return why those UAVs may not be given it; '' where it may be given to one, or none."""
        task = record.task
        key = task.required_capabilities, task.allowed_uavs, record.failed_on
        if key not in self._texts:
            known = self._fleet.records
            able = [uav_id for uav_id in sorted(known)
                    if may_fly(task, record.failed_on, known[uav_id].report)]
            self._texts[key] = '' if not able or not self.usable.isdisjoint(able) else (
                'those that may fly it cannot now: '
                + first_of(map(self._fleet.why_unusable, able)))
        return self._texts[key]


def _unlisted(record: TaskRecord, fleet: Fleet, absent: _AbsentUavs,
              left_out: Mapping[str, str]) -> TaskStep:
    task, known, usable = record.task, fleet.records, absent.usable
    if not known:
        return TaskStep(task.id, TaskTransition.WAIT, why='no UAV known yet')
    ordered = fleet.orders.reason(task.id)
    if task.allowed_uavs is not None and known.keys().isdisjoint(task.allowed_uavs):
        why = f'allowed for {", ".join(sorted(task.allowed_uavs))} only: not known yet'
        return TaskStep(task.id, TaskTransition.LEAVE, why=why)
    blocked = blocked_text(uav for uav in fleet.blocked_on_ground()
                           if may_fly(task, record.failed_on, uav.report))
    if not usable:
        return TaskStep(task.id, TaskTransition.LEAVE, why=_joined(
            ordered, blocked or fleet.why_none_usable()))
    others = without_failed(record, usable).allowed_uavs
    if record.failed_on and others is not None and others.isdisjoint(usable):
        why = f'failed on {", ".join(record.failed_on)}; no other UAV that may fly it is available'
    elif ordered and (state := owner_state(task.id, record, fleet)):
        why = state
    elif task.id in left_out:
        why = _joined(left_out[task.id], '' if blocked else absent.text(record))
    else:
        waits = _joined(ordered, 'waits for the next plan')
        return TaskStep(task.id, TaskTransition.WAIT, why=waits)
    return TaskStep(task.id, TaskTransition.LEAVE, why=_joined(ordered, why, blocked))


def owner_state(task_id: str, record: TaskRecord, fleet: Fleet) -> str:
    """Return why the only UAV that orders allow for a task cannot fly it now.

    Args:
        task_id: of the task.
        record: of the task.
        fleet: with the orders in force.

    Returns:
        Empty where no order names one UAV, or where it could fly.
    """
    owner = fleet.orders.owner(task_id)
    failed = f'failed on {owner}' if owner in record.failed_on else ''
    return (fleet.why_unusable(owner) or failed) if owner else ''


def _joined(*texts: str) -> str:
    return '; '.join(filter(None, texts))
