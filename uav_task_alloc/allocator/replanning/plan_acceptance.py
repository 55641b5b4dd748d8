# SPDX-License-Identifier: Apache-2.0
"""Which changes of a new plan are accepted: those better by the margin, and still valid."""
from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from itertools import chain
from typing import Any

from uav_task_alloc.allocator.replan_records import ReplanAnswer, ReplanProblem
from uav_task_alloc.model import Plan
from uav_task_alloc.objective import response_time
from uav_task_alloc.timetable import Timetable

TaskIdsByUav = dict[str, tuple[str, ...]]


def accepted_plan(answer: ReplanAnswer, margin: float) -> Plan:
    """Return the repaired plan with those changes of the best plan that are worth a new list.

    A change is accepted if it serves a higher value, or the same value at a cost of the objective
    that is lower by the margin: with that of distance, on routes so much shorter. UAVs that
    exchange tasks change together. Without an event the accepted changes together must lower the
    cost of the whole plan by the margin, too. What tasks have waited already is no part of such a
    cost: else no change would be worth it where tasks wait for hours.

    Args:
        answer: of the worker.
        margin: share of a cost.

    Returns:
        The plan to publish: repaired, best, or a combination of both.
    """
    repaired, best = answer.repaired, answer.best
    if best.penalty < repaired.penalty:
        return best
    accepted, first, more = set[str](), _cost(answer, ()), False
    cost = first
    for group in exchange_groups(repaired.routes, best.routes, repaired.reversed ^ best.reversed):
        value, now = _added_value(answer, group), _cost(answer, accepted | group)
        before = _cost(answer, (), group)
        if value > 0.0 or (value == 0.0 and cost - now > max(margin * before, 1e-6)):
            accepted |= group
            cost, more = now, more or value > 0.0
    if not accepted or (answer.problem.background and not more
                        and first - cost <= margin * first):
        return repaired
    chosen = _combined(answer, accepted)
    waited = response_time(answer.problem.tasks, dict.fromkeys(
        chain(*chosen.routes.values()), 0.0))
    return replace(chosen, cost=cost + answer.problem.objective.response * waited)


def _added_value(answer: ReplanAnswer, group: Collection[str]) -> float:
    """Value that the best plan serves more with a group of UAVs than the repaired one."""
    value = {task.id: task.value for task in answer.problem.tasks}
    # fsum: the same tasks have the same sum in any order
    before, after = (math.fsum(value[task] for uav_id in group for task in plan.routes[uav_id])
                     for plan in (answer.repaired, answer.best))
    return after - before


def _cost(answer: ReplanAnswer, changed: Collection[str],
          only: Collection[str] | None = None) -> float:
    """Cost of the objective of the repaired plan with the changed UAVs as in the best one.

    only: UAVs that count; None: all.
    """
    return plan_cost(answer.problem, _combined(answer, changed), only)


def plan_cost(problem: ReplanProblem, plan: Plan, only: Collection[str] | None = None) -> float:
    """Return the cost of the objective of a plan, in which tasks wait from now on.

    Args:
        problem: from now.
        plan: of the problem.
        only: ids of the UAVs that count; None: all.

    Returns:
        The cost, with a penalty for what exceeds ranges.
    """
    prices = problem.objective
    uavs = [uav for uav in problem.uavs if only is None or uav.id in only]
    paths = {task.id: task.path_length for task in problem.tasks}
    metres = sum(_length_with_penalty(plan, uav.id, uav.range, paths) for uav in uavs)
    if prices.is_shortest:
        return prices.cost(metres)
    times, ids = plan.timetable(), {uav.id for uav in uavs}
    mine = {task for uav_id in ids for task in plan.routes.get(uav_id, ())}
    return prices.cost(
        metres, max((end for uav_id, end in times.ends.items() if uav_id in ids), default=0.0),
        response_time(problem.tasks, {task: start for task, start in times.starts.items()
                                      if task in mine}, from_now=True),
        math.fsum(late for task, late in times.late.items() if task in mine))


def exchange_groups(before: Mapping[str, tuple[str, ...]],
                    after: Mapping[str, tuple[str, ...]],
                    turned: Collection[str] = ()) -> list[frozenset[str]]:
    """Return groups of UAVs whose routes differ; UAVs that exchange tasks are in one group.

    Args:
        before, after: task ids by UAV id.
        turned: ids of tasks with a path that are flown the other way after.
    """
    owner = {task: uav_id for uav_id, tasks in before.items() for task in tasks}
    groups: list[set[str]] = []
    for uav_id, tasks in after.items():
        if before.get(uav_id) == tasks and not any(task in turned for task in tasks):
            continue
        group = {uav_id, *(owner[task] for task in tasks if task in owner)}
        for other in [g for g in groups if g & group]:
            group |= other
            groups.remove(other)
        groups.append(group)
    return [frozenset(group) for group in groups]


def _length_with_penalty(plan: Plan, uav_id: str, limit: float,
                         paths: Mapping[str, float]) -> float:
    """Length [m], with a penalty for what exceeds a soft range limit [m].

    paths: lengths of the paths of tasks, by id.
    """
    length = sum(leg.length for leg in plan.legs.get(uav_id, ())) + sum(
        paths[task] for task in plan.routes[uav_id])
    return length + 100.0 * max(0.0, length - limit)


def _combined(answer: ReplanAnswer, changed: Collection[str]) -> Plan:
    """The best plan for the changed UAVs, the repaired one for the others."""
    repaired, best = answer.repaired, answer.best
    routes = {u: (best if u in changed else repaired).routes[u] for u in repaired.routes}
    legs = {u: (best if u in changed else repaired).legs.get(u, ()) for u in repaired.routes}
    served = {task for tasks in routes.values() for task in tasks}
    left_out = {task: why for task, why in {**repaired.unassigned, **best.unassigned}.items()
                if task not in served}
    turned = frozenset(task for u, tasks in routes.items() for task in tasks
                       if task in (best if u in changed else repaired).reversed)
    return replace(best, routes=routes, legs=legs, unassigned=left_out, reversed=turned,
                   timetable=lambda: _combined_times(answer, changed))


def _combined_times(answer: ReplanAnswer, changed: Collection[str]) -> Timetable:
    """The times of `_combined`."""
    merged, best = Timetable(), answer.best
    for plan in (answer.repaired, best):
        times = plan.timetable()
        for uav_id in plan.routes:
            if (uav_id in changed) == (plan is best):
                merged = _with_uav(merged, times, uav_id, plan.routes[uav_id])
    return replace(merged, response=response_time(answer.problem.tasks, merged.starts))


def _with_uav(merged: Timetable, times: Timetable, uav_id: str,
              tasks: Iterable[str]) -> Timetable:
    """The merged times, and those of one UAV."""
    def joined(some: Mapping[str, Any], more: Mapping[str, Any],
               keys: Iterable[str]) -> dict[str, Any]:
        return {**some, **{key: more[key] for key in keys if key in more}}

    row = list(tasks)
    return replace(
        merged, arrivals=joined(merged.arrivals, times.arrivals, row),
        starts=joined(merged.starts, times.starts, row),
        late=joined(merged.late, times.late, row),
        trips=joined(merged.trips, times.trips, [uav_id]),
        departures=joined(merged.departures, times.departures, [uav_id]),
        ends=joined(merged.ends, times.ends, [uav_id]))


def repaired_routes(routes: Mapping[str, Iterable[str]], locked: Mapping[str, tuple[str, ...]],
                    allowed: Callable[[str, str], bool]) -> TaskIdsByUav:
    """Return routes that were planned for an older world, made valid for the present one.

    Args:
        routes: task ids by UAV.
        locked: task ids by UAV that come first on it.
        allowed: (uav_id, task_id) -> whether the UAV may fly the task; else it is removed.
    """
    locked_ids = {task for tasks in locked.values() for task in tasks}
    repaired: TaskIdsByUav = {}
    for uav_id, tasks in routes.items():
        rest = (task for task in tasks if task not in locked_ids and allowed(uav_id, task))
        repaired[uav_id] = (*locked.get(uav_id, ()), *rest)
    for uav_id, tasks in locked.items():
        repaired.setdefault(uav_id, tasks)
    return repaired
