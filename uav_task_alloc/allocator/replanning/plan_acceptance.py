# SPDX-License-Identifier: Apache-2.0
"""Which changes of a new plan are accepted: those better by the margin, and still valid."""
from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from itertools import chain
from typing import Any, NamedTuple

from uav_task_alloc.allocator.replan_records import ReplanAnswer, ReplanProblem
from uav_task_alloc.model import Plan
from uav_task_alloc.objective import response_time
from uav_task_alloc.timetable import Timetable

TaskIdsByUav = dict[str, tuple[str, ...]]
# fields of Timetable by task id, and by UAV id
_OF_TASKS, _OF_UAVS = ('arrivals', 'starts', 'late'), ('trips', 'departures', 'ends')


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
    costs = _CombinedCosts(answer)
    accepted, first, more = set[str](), costs.of(()), False
    cost = first
    for group in exchange_groups(repaired.routes, best.routes, repaired.reversed ^ best.reversed):
        value, now = costs.added_value(group), costs.of(accepted | group)
        before = costs.of((), group)
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


class UavCost(NamedTuple):
    """What the route of a UAV adds to the cost of a plan."""

    metres: float  # with a penalty for what exceeds its range
    end: float  # [s] of the route; -inf: it has no task
    responses: list[float]  # value * start [s] of each task
    late: list[float]  # [s] of each task that is late


class _CombinedCosts:
    """Costs of the objective of the repaired plan with some UAVs as in the best one.

    Each is found by what single routes add: there may be as many groups as UAVs.
    """

    def __init__(self, answer: ReplanAnswer) -> None:
        self._answer, problem = answer, answer.problem
        self._value = {task.id: task.value for task in problem.tasks}
        self._total = math.fsum(self._value.values())
        self._before, self._after = (_uav_costs(problem, plan)
                                     for plan in (answer.repaired, answer.best))

    def added_value(self, group: Collection[str]) -> float:
        """Value that the best plan serves more with a group of UAVs than the repaired one."""
        # fsum: the same tasks have the same sum in any order
        before, after = (math.fsum(self._value[task] for uav_id in group
                                   for task in plan.routes[uav_id])
                         for plan in (self._answer.repaired, self._answer.best))
        return after - before

    def of(self, changed: Collection[str], only: Collection[str] | None = None) -> float:
        """Return the cost with the changed UAVs as in the best plan; only: UAVs that count."""
        return cost_of_routes(self._answer.problem, [
            (self._after if uav_id in changed else self._before)[uav_id]
            for uav_id in self._before if only is None or uav_id in only], self._total)


def _uav_costs(problem: ReplanProblem, plan: Plan,
               only: Collection[str] | None = None) -> dict[str, UavCost]:
    """What each UAV adds to the cost of a plan, in the order of the problem."""
    paths = {task.id: task.path_length for task in problem.tasks}
    value = {task.id: task.value for task in problem.tasks}
    times = Timetable() if problem.objective.is_shortest else plan.timetable()
    starts, late = times.starts, times.late
    return {uav.id: UavCost(
        _length_with_penalty(plan, uav.id, uav.range, paths), times.ends.get(uav.id, -math.inf),
        [value[task] * starts[task] for task in plan.routes.get(uav.id, ()) if task in starts],
        [late[task] for task in plan.routes.get(uav.id, ()) if task in late])
        for uav in problem.uavs if only is None or uav.id in only}


def cost_of_routes(problem: ReplanProblem, costs: Collection[UavCost], total: float) -> float:
    """Return the cost of the objective of routes, in which tasks wait from now on.

    Args:
        problem: with the objective.
        costs: of the UAVs.
        total: value of all tasks.
    """
    prices, metres = problem.objective, sum(each.metres for each in costs)
    if prices.is_shortest:
        return prices.cost(metres)
    waits = math.fsum(chain.from_iterable(each.responses for each in costs))
    ends = [each.end for each in costs if each.end > -math.inf]
    return prices.cost(metres, max(ends, default=0.0), waits / total if total > 0.0 else 0.0,
                       math.fsum(chain.from_iterable(each.late for each in costs)))


def plan_cost(problem: ReplanProblem, plan: Plan, only: Collection[str] | None = None) -> float:
    """Return the cost of the objective of a plan, in which tasks wait from now on.

    Args:
        problem: from now.
        plan: of the problem.
        only: ids of the UAVs that count; None: all.

    Returns:
        The cost, with a penalty for what exceeds ranges.
    """
    return cost_of_routes(problem, _uav_costs(problem, plan, only).values(),
                          math.fsum(task.value for task in problem.tasks))


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
    merged: dict[str, dict[str, Any]] = {name: {} for name in (*_OF_TASKS, *_OF_UAVS)}
    for plan in (answer.repaired, answer.best):
        times = plan.timetable()
        for uav_id, row in plan.routes.items():
            if (uav_id in changed) != (plan is answer.best):
                continue
            for names, keys in ((_OF_TASKS, row), (_OF_UAVS, (uav_id,))):
                for name in names:
                    known = getattr(times, name)
                    merged[name].update((key, known[key]) for key in keys if key in known)
    return Timetable(**merged, response=response_time(answer.problem.tasks, merged['starts']))


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
