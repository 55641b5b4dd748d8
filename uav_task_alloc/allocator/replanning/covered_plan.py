# SPDX-License-Identifier: Apache-2.0
"""A plan whose lists leave idle UAVs where the next tasks are expected, at little more response.

What is proposed here by straight lines counts only as the solver confirms it: with its paths,
ranges and windows. Importing this module loads the compiled kernels.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from uav_task_alloc.allocator.replan_records import ReplanAnswer, ReplanProblem
from uav_task_alloc.allocator.replanning.from_now import is_timed
from uav_task_alloc.allocator.replanning.plan_acceptance import (
    TaskIdsByUav,
    accepted_plan,
    plan_cost,
)
from uav_task_alloc.anticipation.spread import ListEnd, Outlook, PlainTask, price, spread
from uav_task_alloc.model import Plan, Point, Task, Uav
from uav_task_alloc.timetable import Timetable

_MOST = 100  # UAVs, and tasks that may move: beyond it nothing is changed
_LEAST_GAIN = 1e-6  # [s]
_ROUNDING = 1e-3  # [s] later that is no change
Confirm = Callable[[Plan], Plan]


def covered_plan(answer: ReplanAnswer, margin: float, confirm: Confirm) -> Plan:
    """Return the plan to publish with cover as a part of its cost.

    Compared are the repaired plan, the accepted one, and what moves of single tasks make of each.
    None starts a task after its latest time that the accepted plan starts in time, or later.

    Args:
        answer: of the worker; its problem has an outlook.
        margin: share of the cost by which a plan must be better than the repaired one.
        confirm: takes a plan and returns the one that the solver makes of its routes.

    Returns:
        The accepted plan, or one with more cover that serves the same tasks.
    """
    accepted = accepted_plan(answer, margin)
    cover = _Cover(answer.problem, accepted)
    if not cover.counts:
        return accepted
    chosen, least = accepted, cover.cost(accepted)
    if cover.permits(answer.repaired):
        repaired = cover.cost(answer.repaired)
        if repaired * (1.0 - margin) <= least:
            chosen, least = answer.repaired, repaired * (1.0 - margin)
    tried = {_key(answer.repaired.routes), _key(accepted.routes)}
    for plan in (answer.repaired, accepted):
        routes = cover.improved(plan)
        if _key(routes) in tried:
            continue
        tried.add(_key(routes))
        new = confirm(replace(plan, routes=routes, legs={}))
        if new.routes == routes and cover.permits(new) and cover.cost(new) < least - _LEAST_GAIN:
            chosen, least = new, cover.cost(new)
    return chosen


def _key(routes: Mapping[str, tuple[str, ...]]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    return tuple(sorted(routes.items()))


@dataclass(frozen=True, slots=True)
class _Place:
    """A UAV after a part of its route: when [s], and where [m]."""

    free_in: float
    point: Point


class _Cover:
    """Plans of one problem with cover; the accepted plan says which of its tasks may move."""

    def __init__(self, problem: ReplanProblem, accepted: Plan) -> None:
        known = problem.outlook
        assert known is not None
        self._problem, self._accepted = problem, accepted
        self._outlook = Outlook(known.x, known.y, known.weight, known.value)
        self._waiting = known.waiting
        self._tasks = {task.id: task for task in problem.tasks}
        self._served = {name for row in accepted.routes.values() for name in row}
        self._starts = accepted.timetable().starts
        self._idle = sum(not row for row in accepted.routes.values())
        self._value = math.fsum(task.value for task in problem.tasks) / self._outlook.value

    @property
    def counts(self) -> bool:
        """Whether there is anything to choose, and not too much."""
        movable = sum(len(row) - len(self._problem.locked.get(uav_id, ()))
                      for uav_id, row in self._accepted.routes.items())
        return 0 < movable <= _MOST and len(self._problem.uavs) <= _MOST

    def permits(self, plan: Plan) -> bool:
        """Whether a plan serves what the accepted one does, and starts no task too late."""
        served = {name for row in plan.routes.values() for name in row}
        if served != self._served or plan.penalty > self._accepted.penalty:
            return False
        starts = plan.timetable().starts
        return all(starts.get(name, math.inf) <= max(
            self._tasks[name].latest, self._starts.get(name, -math.inf) + _ROUNDING)
            for name in served if self._tasks[name].latest < math.inf)

    def cost(self, plan: Plan) -> float:
        """The cost of a plan as a sum of waits [s], and what the next tasks will wait after it."""
        known = plan_cost(self._problem, plan) / self._problem.objective.response * self._value
        times = plan.timetable()
        ends = [self._list_end(uav, self._after(plan, times, uav, plan.routes.get(uav.id, ())))
                for uav in self._problem.uavs]
        return known + price(self._outlook, ends, self._idle)

    def improved(self, plan: Plan) -> TaskIdsByUav:
        """The routes of a plan after moves of single tasks, by straight lines."""
        times, uavs = plan.timetable(), self._problem.uavs
        ends, heads, rows = list[ListEnd](), list[tuple[str, ...]](), list[tuple[str, ...]]()
        open_to = []
        for uav in uavs:
            route = tuple(plan.routes.get(uav.id, ()))
            count = len(self._problem.locked.get(uav.id, ()))
            open_to.append(self._moves(times, uav, route[count:]))
            heads.append(route[:count] if open_to[-1] else route)
            rows.append(route[len(heads[-1]):])
            ends.append(self._list_end(uav, self._after(plan, times, uav, heads[-1])))
        names = [name for row in rows for name in row]
        index = {name: k for k, name in enumerate(names)}
        tasks = [self._tasks[name] for name in names]
        allowed = [[moves and _may_fly(uav, task) for task in tasks]
                   for uav, moves in zip(uavs, open_to, strict=True)]
        found = spread(self._outlook, ends, [
            PlainTask(task.position[0], task.position[1], task.stay, task.value)
            for task in tasks], [[index[name] for name in row] for row in rows],
            np.array(allowed, bool))
        return {uav.id: (*head, *(names[k] for k in row))
                for uav, head, row in zip(uavs, heads, found, strict=True)}

    def _moves(self, times: Timetable, uav: Uav, rest: Sequence[str]) -> bool:
        """Whether the tasks of a UAV that are not locked may change."""
        return (len(times.trips.get(uav.id, ())) <= 1 and uav.id not in self._problem.later_only
                and not any(is_timed(task) or task.path
                            for task in map(self._tasks.__getitem__, rest)))

    def _after(self, plan: Plan, times: Timetable, uav: Uav, head: Sequence[str]) -> _Place:
        """When and where a UAV is after the first tasks of its route."""
        if not head:
            return _Place(uav.available_from, uav.position)
        last = self._tasks[head[-1]]
        point = (last.turned if last.id in plan.reversed else last).end
        if len(head) == len(plan.routes[uav.id]):
            return _Place(times.ends[uav.id], point)
        return _Place(times.starts[last.id] + last.stay + last.path_length / uav.cruise_speed,
                      point)

    def _list_end(self, uav: Uav, place: _Place) -> ListEnd:
        waiting = self._waiting.get(uav.id, uav.position)
        return ListEnd(place.free_in, place.point[0], place.point[1], (waiting[0], waiting[1]),
                       uav.cruise_speed)


def _may_fly(uav: Uav, task: Task) -> bool:
    return ((task.allowed_uavs is None or uav.id in task.allowed_uavs)
            and task.required_capabilities <= uav.capabilities)
