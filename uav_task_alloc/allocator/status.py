# SPDX-License-Identifier: Apache-2.0
"""What people ask: where each task stands, and how the allocator is."""
from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from uav_task_alloc.allocator.records import TaskRecord, TaskState
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.allocator.state.zone_checks import NAMED, standing


@dataclass(frozen=True, slots=True)
class TaskStatus:
    """Where one task stands."""

    task_id: str
    state: TaskState
    uav: str
    reason: str
    stamp: float  # [s] of the last change


def status_of(task_id: str, known: TaskRecord | tuple[str, float]) -> TaskStatus:
    """Of an accepted task, or of one that was refused for a reason at a time [s]."""
    if isinstance(known, TaskRecord):
        return TaskStatus(task_id, known.state, known.uav, known.reason, known.stamp)
    reason, stamp = known
    return TaskStatus(task_id, TaskState.REJECTED, '', reason, stamp)


def worries(world: World, journal_trouble: str, solver_trouble: str = '') -> list[str]:
    """What an operator should look at."""
    fleet = world.fleet
    silent = sorted(uav_id for uav_id, record in fleet.records.items() if record.silent)
    stands = standing(fleet.standing())
    left = [record for record in world.tasks.open() if record.state is TaskState.UNASSIGNED]
    found = [f'journal: {journal_trouble}'] if journal_trouble else []
    found += [world.full] if world.full else []
    found += [f'solver: {solver_trouble}'] if solver_trouble else []
    found += [f'silent: {", ".join(silent[:20])}'] if silent else []
    low = sorted(uav_id for uav_id, record in fleet.records.items() if record.low)
    found += [f'battery low: {", ".join(low)}'] if low else []
    found += [f'{stands}: no tasks'] if stands else []
    found += [f'{uav_id} has no safe way home: {why}'
              for uav_id, why in sorted(world.stranded.items())
              if uav_id in fleet.records and uav_id not in silent][:NAMED]
    found += [f'{len(left)} tasks unassigned, {left[0].task.id}: {left[0].reason}'] if left else []
    if world.tasks.open() and not any(fleet.usable(uav_id) for uav_id in fleet.records):
        found.append('no UAV available')
    return found


def facts(world: World) -> dict[str, object]:
    """Numbers of UAVs, tasks and zones, and the revision in force."""
    states = Counter(record.state for record in world.tasks.records.values())
    usable = [uav_id for uav_id in world.fleet.records if world.fleet.usable(uav_id)]
    return {'UAVs heard': len(world.fleet.records), 'UAVs available': len(usable),
            'zones': len(world.zones), 'revision': world.revision,
            **{f'tasks {state.name}': states[state] for state in TaskState
               if state is not TaskState.REJECTED},
            'tasks REJECTED': len(world.tasks.rejected), 'solving': world.schedule.busy}
