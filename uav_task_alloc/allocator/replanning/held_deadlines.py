# SPDX-License-Identifier: Apache-2.0
"""Accepted deadlines are held: no plan breaks one that the lists in force still keep."""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from uav_task_alloc.allocator.records import ReplanProblem, UavList
from uav_task_alloc.allocator.replanning.plan_acceptance import exchange_groups
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Plan, Task

_REASON = 'left out: it would break the deadline of {} that is accepted'


def held_lists(world: World, new: Mapping[str, UavList],
               stamp: float) -> tuple[dict[str, UavList], dict[str, str]]:
    """Return the lists that may be put in force.

    Args:
        world: with the lists in force.
        new: lists of a plan, by UAV, with times from now.
        stamp: [s] published clock.

    Returns:
        The new lists, but the old ones of UAVs that exchange a task whose deadline the old ones
        keep from where the UAVs are now, and the new ones do not; and reasons of the tasks that
        are in no list for that, by task id. A list that cannot or may not be flown any more keeps
        no deadline.
    """
    old = {uav_id: world.lists.restamped(uav_id, stamp, world.flights.of(uav_id, stamp))
           for uav_id in new}
    kept = {name: uav_id for uav_id, each in old.items() if not world.must_change(uav_id)
            for name in _in_time(each, world, stamp)}
    after = {name for each in new.values() for name in _in_time(each, world, stamp)}
    broken = kept.keys() - after
    lists, reasons = dict(new), dict[str, str]()
    if not broken:
        return lists, reasons
    for group in exchange_groups({uav_id: each.task_ids for uav_id, each in old.items()},
                                 {uav_id: each.task_ids for uav_id, each in new.items()}):
        names = sorted(name for name in broken if kept[name] in group)
        if not names or any(map(world.must_change, group & kept_uavs(kept, names))):
            continue
        for uav_id in group:
            reasons.update((name, _REASON.format(names[0])) for name in new[uav_id].task_ids)
            lists[uav_id] = world.list_of(uav_id)
    listed = {name for each in lists.values() for name in each.task_ids}
    return lists, {name: why for name, why in reasons.items() if name not in listed}


def kept_uavs(kept: Mapping[str, str], names: Iterable[str]) -> frozenset[str]:
    """The UAVs that keep these tasks."""
    return frozenset(kept[name] for name in names)


def _in_time(each: UavList, world: World, stamp: float) -> list[str]:
    """Tasks of a list with a deadline that it keeps."""
    return [stop.task.id for stop in each.stops
            if stop.task.latest < math.inf and stamp + stop.start <= stop.task.latest
            and world.tasks.is_open(stop.task.id)]


def with_deadlines_held(problem: ReplanProblem, repaired: Plan) -> tuple[Task, ...]:
    """Return the tasks for a search that must not drop an accepted deadline for more value.

    Args:
        problem: from now.
        repaired: the lists in force, repaired.

    Returns:
        The tasks of the problem; where tasks are left out, or may be, those with a deadline that
        `repaired` keeps are worth more than all others together.
    """
    if not repaired.unassigned and math.isinf(problem.objective.unserved):
        return problem.tasks
    listed = {name for row in problem.published.routes.values() for name in row}
    late = repaired.timetable().late
    held = {task.id for task in problem.tasks if task.latest < math.inf and task.id in listed
            and task.id not in repaired.unassigned and task.id not in late}
    if not held:
        return problem.tasks
    more = math.fsum(task.value for task in problem.tasks)
    return tuple(replace(task, value=task.value + more) if task.id in held else task
                 for task in problem.tasks)


def with_true_values(plan: Plan, tasks: Sequence[Task]) -> Plan:
    """Return a plan of such a search with the value of its tasks."""
    served = {name for row in plan.routes.values() for name in row}
    return replace(plan, value=math.fsum(task.value for task in tasks if task.id in served))
