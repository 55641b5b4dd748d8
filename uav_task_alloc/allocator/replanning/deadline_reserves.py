# SPDX-License-Identifier: Apache-2.0
"""New tasks that a plan has in time and the prediction has late are planned again with a reserve.

The solver counts mean speeds and mean stops; the prediction also wind, detour points and the
stops of each UAV.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from uav_task_alloc.allocator.list_records import ListStop
from uav_task_alloc.allocator.replan_records import ReplanProblem
from uav_task_alloc.allocator.replanning.trips import present_trips
from uav_task_alloc.allocator.state.stop_times import timed_stops
from uav_task_alloc.model import Leg, Plan, Task

_TOO_LATE = 0.25  # [s] after its latest that is no rounding
_ROUNDING = 0.1  # [s] by which a reserve is longer than the difference of the times
_ROUNDS = 4  # of plans with reserves at most
_SHARE = 0.25  # of the budget, after which there is no further one


@dataclass(frozen=True, slots=True)
class _LateStart:
    """A new task that a plan has in time, and the prediction late; times are [s] from now."""

    start: float  # predicted
    uav: str
    by: float  # [s] later than in the plan
    latest: float
    alone: bool  # also where the UAV flies it first


def plan_in_time(problem: ReplanProblem, tasks: Sequence[Task],
                 solve: Callable[[Sequence[Task], Plan | None], Plan]
                 ) -> tuple[Plan, Sequence[Task]]:
    """Solve, and again with reserves while new tasks are late by the prediction.

    Args:
        problem: with times of the ROS clock.
        tasks: of the problem, with times from now.
        solve: returns a plan of tasks; its second argument is the plan before, or None.

    Returns:
        The last plan, and the tasks that it was made for. After four more plans, or a quarter
        of the budget more, new tasks may still be late.
    """
    found, new, known = solve(tasks, None), _new_tasks(problem), dict[str, _LateStart]()
    ends = found.solve_time + _SHARE * problem.budget
    for _ in range(_ROUNDS if new else 0):
        late = _late_starts(problem, found, new) if found.solve_time < ends else {}
        if not late:
            break
        known.update(late)
        tasks = tuple(_with_reserve(problem, task, late[task.id]) if task.id in late else task
                      for task in tasks)
        again = solve(tasks, found)
        found = replace(again, iterations=found.iterations + again.iterations,
                        solve_time=found.solve_time + again.solve_time)
    reasons = {name: _reason(why, known[name])
               for name, why in found.unassigned.items() if name in known}
    return replace(found, unassigned={**found.unassigned, **reasons}) if reasons else found, tasks


def _new_tasks(problem: ReplanProblem) -> dict[str, Task]:
    """Tasks with a deadline that are in no list in force, and not locked, by id."""
    if math.isfinite(problem.objective.lateness):
        return {}
    held = {*chain(*problem.published.routes.values(), *problem.locked.values())}
    return {task.id: task for task in problem.tasks
            if task.latest < math.inf and task.id not in held}


def _with_reserve(problem: ReplanProblem, task: Task, late: _LateStart) -> Task:
    """A task that the plan has in time only where the prediction has, too, on that UAV."""
    if not late.alone:
        latest = min(task.latest, late.latest - late.by - _ROUNDING)
        return replace(task, latest=max(task.earliest, latest))
    allowed = task.allowed_uavs
    if allowed is None:
        allowed = frozenset(uav.id for uav in problem.uavs)
    return replace(task, allowed_uavs=allowed - {late.uav})


def _reason(reason: str, late: _LateStart) -> str:
    """Why a task is left out: a reason of the solver whose numbers do not have the reserve."""
    if not late.alone and 'arriv' not in reason:
        return reason
    return f'latest {late.latest:.0f} s; the earliest arrival is {late.start:.0f} s ({late.uav})'


def _late_starts(problem: ReplanProblem, found: Plan,
                 new: Mapping[str, Task]) -> dict[str, _LateStart]:
    """The new tasks of a plan that are late by the prediction, by id."""
    starts, late = found.timetable().starts, dict[str, _LateStart]()
    tasks = {task.id: task for task in problem.tasks}
    present, _ = present_trips(found, problem.later_only)
    for uav_id, route in present.routes.items():
        flight = problem.flights.get(uav_id)
        if flight is None or new.keys().isdisjoint(route):
            continue
        stops = [ListStop(tasks[task_id], leg, 0.0, reversed=task_id in found.reversed)
                 for task_id, leg in zip(route, present.legs[uav_id], strict=False)]
        for stop in timed_stops(stops, flight):
            name, latest = stop.task.id, stop.task.latest - problem.stamp
            if name in new and name in starts and stop.start > latest + _TOO_LATE:
                first, = timed_stops((replace(stop, leg=Leg((), 0.0)),), flight)
                late[name] = _LateStart(stop.start, uav_id, stop.start - starts[name], latest,
                                        first.start > latest + _TOO_LATE)
    return late
