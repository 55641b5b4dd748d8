# SPDX-License-Identifier: Apache-2.0
"""Which changes of a new plan are accepted: those better by the margin, and still valid."""
from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace

from uav_task_alloc.allocator.records import ReplanAnswer
from uav_task_alloc.model import Plan

TaskIdsByUav = dict[str, tuple[str, ...]]


def accepted_plan(answer: ReplanAnswer, margin: float) -> Plan:
    """Return the repaired plan with those changes of the best plan that are worth a new list.

    A change is accepted if it serves a higher value, or the same value with routes shorter by
    the margin. UAVs that exchange tasks change together. Without an event the accepted changes
    together must shorten all routes by the margin, too.

    Args:
        answer: of the worker.
        margin: share of a length.

    Returns:
        The plan to publish: repaired, best, or a combination of both.
    """
    repaired, best = answer.repaired, answer.best
    if best.penalty < repaired.penalty:
        return best
    accepted, gained, more = set[str](), 0.0, False
    for group in exchange_groups(repaired.routes, best.routes):
        value, before, gain = _compare(answer, group)
        if value > 0.0 or (value == 0.0 and gain > max(margin * before, 1e-6)):
            accepted |= group
            gained, more = gained + gain, more or value > 0.0
    if not accepted or (answer.problem.background and not more
                        and gained <= margin * repaired.distance):
        return repaired
    return _combined(repaired, best, accepted)


def _compare(answer: ReplanAnswer, group: Collection[str]) -> tuple[float, float, float]:
    """Of a group of UAVs: the added value, the cost before [m], and the cost saved [m]."""
    value = {task.id: task.value for task in answer.problem.tasks}
    ranges = {uav.id: uav.range for uav in answer.problem.uavs}
    plans = answer.repaired, answer.best
    # fsum: the same tasks have the same sum in any order
    served = [math.fsum(value[task] for uav_id in group for task in plan.routes[uav_id])
              for plan in plans]
    before, after = (sum(_route_cost(plan, uav_id, ranges[uav_id]) for uav_id in group)
                     for plan in plans)
    return served[1] - served[0], before, before - after


def exchange_groups(before: Mapping[str, tuple[str, ...]],
                    after: Mapping[str, tuple[str, ...]]) -> list[frozenset[str]]:
    """Return groups of UAVs whose routes differ; UAVs that exchange tasks are in one group."""
    owner = {task: uav_id for uav_id, tasks in before.items() for task in tasks}
    groups: list[set[str]] = []
    for uav_id, tasks in after.items():
        if before.get(uav_id) == tasks:
            continue
        group = {uav_id, *(owner[task] for task in tasks if task in owner)}
        for other in [g for g in groups if g & group]:
            group |= other
            groups.remove(other)
        groups.append(group)
    return [frozenset(group) for group in groups]


def _route_cost(plan: Plan, uav_id: str, limit: float) -> float:
    """Length [m], with a penalty for what exceeds a soft range limit [m]."""
    length = plan.route(uav_id).distance
    return length + 100.0 * max(0.0, length - limit)


def _combined(repaired: Plan, best: Plan, changed: Collection[str]) -> Plan:
    """`best` for the changed UAVs, `repaired` for the others."""
    routes = {u: (best if u in changed else repaired).routes[u] for u in repaired.routes}
    legs = {u: (best if u in changed else repaired).legs.get(u, ()) for u in repaired.routes}
    served = {task for tasks in routes.values() for task in tasks}
    left_out = {task: why for task, why in {**repaired.unassigned, **best.unassigned}.items()
                if task not in served}
    return replace(best, routes=routes, legs=legs, unassigned=left_out)


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
