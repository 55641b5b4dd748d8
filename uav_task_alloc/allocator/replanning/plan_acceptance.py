# SPDX-License-Identifier: Apache-2.0
"""What of an answer is taken: only what is better by the margin, and still true by now."""
from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace

from uav_task_alloc.allocator.records import ReplanAnswer
from uav_task_alloc.model import Plan

TaskIdsByUav = dict[str, tuple[str, ...]]


def steady(answer: ReplanAnswer, margin: float) -> Plan:
    """The repaired lists, with each change that serves more, or shortens what it touches by the
    margin [share].

    UAVs that exchange tasks change together. Between events the whole must gain by it, too.
    """
    base, fresh = answer.base, answer.fresh
    if fresh.penalty < base.penalty:
        return fresh
    taken, gained, more = set[str](), 0.0, False
    for group in exchanges(base.routes, fresh.routes):
        value, before, gain = _compared(answer, group)
        if value > 0.0 or (value == 0.0 and gain > max(margin * before, 1e-6)):
            taken |= group
            gained, more = gained + gain, more or value > 0.0
    if not taken or (answer.problem.background and not more
                     and gained <= margin * base.distance):
        return base
    return _mixed(base, fresh, taken)


def _compared(answer: ReplanAnswer, group: Collection[str]) -> tuple[float, float, float]:
    """What these UAVs serve more, how far [m] they flew before, and by how much they gain."""
    value = {task.id: task.value for task in answer.problem.tasks}
    reach = {uav.id: uav.range for uav in answer.problem.uavs}
    base, fresh = answer.base, answer.fresh
    # fsum: the same tasks have the same sum in any order
    served = [math.fsum(value[task] for uav_id in group for task in plan.routes[uav_id])
              for plan in (base, fresh)]
    before, after = (sum(_cost(plan, uav_id, reach[uav_id]) for uav_id in group)
                     for plan in (base, fresh))
    return served[1] - served[0], before, before - after


def exchanges(before: Mapping[str, tuple[str, ...]],
              after: Mapping[str, tuple[str, ...]]) -> list[frozenset[str]]:
    """UAVs whose routes differ, together with those they exchange tasks with."""
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


def _cost(plan: Plan, uav_id: str, reach: float) -> float:
    length = plan.route(uav_id).distance
    return length + 100.0 * max(0.0, length - reach)  # the excess is dear in the soft case


def _mixed(base: Plan, fresh: Plan, changed: Collection[str]) -> Plan:
    """`fresh` for the changed UAVs, `base` for the others."""
    routes = {u: (fresh if u in changed else base).routes[u] for u in base.routes}
    legs = {u: (fresh if u in changed else base).legs.get(u, ()) for u in base.routes}
    served = {task for tasks in routes.values() for task in tasks}
    left = {task: why for task, why in {**base.unassigned, **fresh.unassigned}.items()
            if task not in served}
    return replace(fresh, routes=routes, legs=legs, unassigned=left)


def repaired_routes(routes: Mapping[str, Iterable[str]], locked: Mapping[str, tuple[str, ...]],
             allowed: Callable[[str, str], bool]) -> TaskIdsByUav:
    """Routes of an older world in the present one.

    What is being flown comes first on its UAV; what may not be flown (`allowed(uav, task)` is
    false: ended, forbidden, UAV gone) is out.
    """
    flown = {task for tasks in locked.values() for task in tasks}
    found: TaskIdsByUav = {}
    for uav_id, tasks in routes.items():
        rest = (task for task in tasks if task not in flown and allowed(uav_id, task))
        found[uav_id] = (*locked.get(uav_id, ()), *rest)
    for uav_id, tasks in locked.items():
        found.setdefault(uav_id, tasks)
    return found
