# SPDX-License-Identifier: Apache-2.0
"""Accepted deadlines are held: no plan breaks one that the lists in force still keep."""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.replan_records import ReplanProblem
from uav_task_alloc.allocator.replanning.plan_acceptance import exchange_groups
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Plan, Task

_LEAST, _SHARE = 2.0, 0.05  # [s], and share of the time until then, that a prediction may err
_ROUNDING = 0.5  # [s] later that is no change
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
    if not any(map(_has_deadlines, map(world.list_of, new))):
        return dict(new), {}
    old = lists_from_now(world, new, stamp)
    kept = {name: (uav_id, start) for uav_id, each in old.items()
            for name, start in promised_starts(each, stamp).items() if world.tasks.is_open(name)}
    after = {stop.task.id: stamp + stop.start for each in new.values() for stop in each.stops}
    must_change = cache(world.must_change)  # asked for each task
    broken = [name for name, (uav_id, start) in kept.items()
              if after.get(name, math.inf) > start + _ROUNDING
              and after.get(name, math.inf) > _latest(old[uav_id], name)
              and not must_change(uav_id)]
    lists, reasons = dict(new), dict[str, str]()
    for group in exchange_groups(_routes(old), _routes(new)) if broken else ():
        names = sorted(name for name in broken if kept[name][0] in group)
        back = {uav_id for uav_id in group if world.usable(uav_id)}
        if not names or any(old[uav_id].stops and must_change(uav_id) for uav_id in back):
            continue
        for uav_id in back:
            reasons.update((name, _REASON.format(names[0])) for name in new[uav_id].task_ids)
            lists[uav_id] = world.list_of(uav_id)
    listed = {name for each in lists.values() for name in each.task_ids}
    return lists, {name: why for name, why in reasons.items() if name not in listed}


def lists_from_now(world: World, uav_ids: Iterable[str], stamp: float) -> dict[str, UavList]:
    """Return lists in force with times from now.

    Args:
        world: with the lists.
        uav_ids: of UAVs, known or not.
        stamp: [s] published clock.

    Returns:
        Lists by UAV.
    """
    return {uav_id: world.lists.restamped(uav_id, stamp, world.flights.of(uav_id, stamp))
            for uav_id in uav_ids}


def promised_starts(each: UavList, stamp: float) -> dict[str, float]:
    """Return when a list starts the tasks whose deadlines it keeps, or may still keep.

    Args:
        each: with times from now.
        stamp: [s] published clock.

    Returns:
        [s] of the ROS clock by task id; a deadline may be kept while it is missed by no more than
        a prediction can be wrong.
    """
    return {stop.task.id: stamp + stop.start for stop in each.stops if stop.task.latest < math.inf
            and stamp + stop.start <= stop.task.latest + max(_LEAST, _SHARE * stop.start)}


def relaxed_tasks(world: World, tasks: Iterable[Task], uav_ids: Iterable[str],
                  stamp: float) -> tuple[Task, ...]:
    """Return tasks for the solver, whose speeds are means over all directions.

    Args:
        world: with the lists in force.
        tasks: open, in times of the ROS clock.
        uav_ids: of the UAVs that are planned for.
        stamp: [s] published clock.

    Returns:
        The same tasks; one that its list may still keep is late only after that list's start.
    """
    with_deadlines = [uav_id for uav_id in uav_ids if _has_deadlines(world.list_of(uav_id))]
    starts = {name: start for each in lists_from_now(world, with_deadlines, stamp).values()
              for name, start in promised_starts(each, stamp).items()}
    return tuple(replace(task, latest=starts[task.id] + _ROUNDING)
                 if starts.get(task.id, -math.inf) + _ROUNDING > task.latest else task
                 for task in tasks)


def _has_deadlines(each: UavList) -> bool:
    return any(stop.task.latest < math.inf for stop in each.stops)


def _latest(each: UavList, name: str) -> float:
    return next(stop.task.latest for stop in each.stops if stop.task.id == name)


def _routes(lists: Mapping[str, UavList]) -> dict[str, tuple[str, ...]]:
    return {uav_id: each.task_ids for uav_id, each in lists.items()}


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
