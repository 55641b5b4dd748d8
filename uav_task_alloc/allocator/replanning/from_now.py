# SPDX-License-Identifier: Apache-2.0
"""A problem whose tasks have times of the ROS clock as one in seconds from now, for the solver."""
from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from uav_task_alloc.allocator.replan_records import ReplanProblem
from uav_task_alloc.model import Task, Uav
from uav_task_alloc.model.task import LONGEST_SERVICE
from uav_task_alloc.objective import OBJECTIVES, Objective
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.separation.rule import Separation


def objective_of(params: AllocatorParams) -> Objective:
    """Return what plans minimise.

    Args:
        params: with the name of an objective, or its prices.

    Returns:
        The prices of `objective_weights` where they are given.
    """
    return Objective(*params.objective_weights) if params.objective_weights else OBJECTIVES[
        params.objective]


def separation_of(params: AllocatorParams) -> Separation:
    """Return the rule that keeps UAVs apart.

    Args:
        params: with its distances.

    Returns:
        Not on where `separation.horizontal` is 0.
    """
    return Separation(params.separation__horizontal, params.separation__vertical,
                      params.separation__time)


def is_timed(task: Task) -> bool:
    """Whether a task has a window, a release or a payload.

    Args:
        task: with times of the ROS clock, or from now.

    Returns:
        False for a task that only its place describes.
    """
    return (task.latest < math.inf or task.earliest > -math.inf or task.release > 0.0
            or task.payload > 0.0)


def counts_time(uavs: Iterable[Uav], tasks: Iterable[Task], objective: Objective,
                trips: int) -> bool:
    """Return whether times change which plan is best; if not, the solver gets none.

    Args:
        uavs: the fleet.
        tasks: all.
        objective: what is minimised.
        trips: of a UAV.

    Returns:
        False for a problem of distances alone.
    """
    return (trips > 1 or not objective.is_shortest or any(map(is_timed, tasks))
            or any(task.path for task in tasks)
            or any(uav.endurance < math.inf for uav in uavs))


def from_now(problem: ReplanProblem) -> ReplanProblem:
    """Return the problem with its times in seconds from `problem.stamp`.

    Args:
        problem: with tasks in times of the ROS clock.

    Returns:
        The problem itself where times change nothing.
    """
    if not counts_time(problem.uavs, problem.tasks, problem.objective, problem.trips):
        return problem
    return replace(problem, tasks=tuple(
        _from(task, problem.stamp, problem.since.get(task.id, problem.stamp), problem.stop_time)
        for task in problem.tasks))


def _from(task: Task, stamp: float, since: float, stop_time: float) -> Task:
    """A task whose service takes the time of braking and accelerating, too."""
    return replace(task, earliest=task.earliest - stamp, latest=task.latest - stamp,
                   release=max(0.0, task.release - stamp), announced=min(0.0, since - stamp),
                   service_time=min(LONGEST_SERVICE, task.service_time + stop_time))
