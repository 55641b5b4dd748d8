# SPDX-License-Identifier: Apache-2.0
"""What a plan costs: the objective of the solver, and the fit of eq 2.12."""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.checks import check_number
from uav_task_alloc.errors import InvalidValue, UnknownName
from uav_task_alloc.model import Task, Uav

MAX_TRIPS = 64  # of a UAV


@dataclass(frozen=True, slots=True)
class Weights:
    """The coefficients of eq 2.12; the defaults are those of the paper.

    Raises:
        InvalidValue: a coefficient is not in [0, 1e9].
    """

    distance: float = 0.01  # [1/m] w1, times D
    value: float = 100.0  # w2, divided by R
    penalty: float = 1.0  # [1/m] w3, times P

    def __post_init__(self) -> None:
        for name in ('distance', 'value', 'penalty'):
            number = check_number(f'{name} weight', getattr(self, name), 0.0, 1e9)
            object.__setattr__(self, name, number)


def fit(distance: float, value: float, penalty: float, weights: Weights | None = None) -> float:
    """Eq 2.12; smaller is better.

    Args:
        distance: [m] of all routes, D of eq 2.1.
        value: of all served tasks, R.
        penalty: [m] beyond the ranges, P of eq 2.2.
        weights: None: those of the paper.

    Returns:
        w1 D + w2 / R + w3 P; infinite where nothing is served (R = 0).
    """
    w = weights or Weights()
    if value <= 0.0:
        return math.inf
    return w.distance * distance + w.value / value + w.penalty * penalty  # eq 2.12


def excess(uavs: Iterable[Uav], lengths: Iterable[float]) -> float:
    """Return by how much routes exceed the ranges of their UAVs: P of eq 2.2.

    Args:
        uavs: with their ranges [m].
        lengths: [m] of their routes, in the same order.

    Returns:
        [m], the sum over all UAVs.
    """
    return math.fsum(max(0.0, length - uav.range)
                     for uav, length in zip(uavs, lengths, strict=True))


@dataclass(frozen=True, slots=True)
class Objective:
    """What the solver minimises: the sum of these coefficients times their quantities.

    Attributes:
        distance: [1/m] of the length of all routes.
        finish: [1/s] of the end of the last route.
        response: [1/s] of the mean time from the announcement to the start of the service,
            weighted with the values of the tasks; tasks not served count as 0 in it.
        lateness: [1/s] of the sum of the times by which services start after `latest`; inf: none
            may.
        unserved: per value of the tasks not served; inf: every task that can be served is served,
            and where not all can, the most value is.

    Raises:
        InvalidValue: a coefficient is out of range, or all are 0.
    """

    distance: float = 1.0  # [1/m]
    finish: float = 0.0  # [1/s]
    response: float = 0.0  # [1/s]
    lateness: float = math.inf  # [1/s]
    unserved: float = math.inf  # [1/value]

    def __post_init__(self) -> None:
        for name in ('distance', 'finish', 'response'):
            number = check_number(f'objective: {name}', getattr(self, name), 0.0, 1e9)
            object.__setattr__(self, name, number)
        for name in ('lateness', 'unserved'):
            number = check_number(f'objective: {name}', getattr(self, name), 0.0)
            if 1e9 < number < math.inf:
                raise InvalidValue(f'objective: {name}', number, 'a number in [0, 1e+09], or inf')
            object.__setattr__(self, name, number)
        if not any(self.coefficients):
            raise InvalidValue('objective', self.coefficients.tolist(), 'one price that is not 0')

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """(5,) distance, finish, response, lateness, unserved, as kernels take them."""
        return np.array([self.distance, self.finish, self.response, self.lateness, self.unserved])

    @property
    def is_shortest(self) -> bool:
        """Whether it asks for no more than the shortest routes that serve all that can be."""
        return (self.distance > 0.0 and self.finish == self.response == 0.0
                and math.isinf(self.unserved))

    def cost(self, distance: float, finish: float = 0.0, response: float = 0.0,
             lateness: float = 0.0, unserved: float = 0.0) -> float:
        """The sum of the terms; an infinite coefficient counts as 0: it is a rule, not a price.

        Args:
            distance: [m] of all routes.
            finish: [s] end of the last route.
            response: [s] see `response_time`.
            lateness: [s] sum over all tasks.
            unserved: value of the tasks not served.
        """
        late = 0.0 if math.isinf(self.lateness) else self.lateness * lateness
        left = 0.0 if math.isinf(self.unserved) else self.unserved * unserved
        return (self.distance * distance + self.finish * finish + self.response * response
                + late + left)


OBJECTIVES: Mapping[str, Objective] = {  # the small distances decide between equal times
    'distance': Objective(),
    'finish': Objective(distance=1e-3, finish=1.0),
    'response': Objective(distance=1e-4, response=1.0),
    'balanced': Objective(distance=0.1, finish=1.0, response=1.0),
}


def check_objective(objective: Objective | str) -> Objective:
    """Return the objective, by name or as it is.

    Args:
        objective: an Objective, or a name of OBJECTIVES.

    Returns:
        The Objective.

    Raises:
        UnknownName: OBJECTIVES has no such name.
        InvalidValue: it is neither.
    """
    if isinstance(objective, Objective):
        return objective
    if not isinstance(objective, str):
        raise InvalidValue('objective', objective, f'an Objective, or one of the names '
                           f'{", ".join(OBJECTIVES)}')
    if objective not in OBJECTIVES:
        raise UnknownName('objective', objective, list(OBJECTIVES))
    return OBJECTIVES[objective]


def response_time(tasks: Iterable[Task], starts: Mapping[str, float], *,
                  from_now: bool = False) -> float:
    """Value-weighted mean time from the announcements to the starts of the services [s].

    Args:
        tasks: all, also those not served.
        starts: of the services [s], by id of each task served.
        from_now: count from time 0 instead, without what tasks have waited already.

    Returns:
        The sum of value * (start - announced) over the tasks served, by the value of all tasks: so
        leaving a task out does not lengthen the mean of the others.
    """
    known = list(tasks)
    total = math.fsum(task.value for task in known)
    return math.fsum(task.value * (starts[task.id] - (0.0 if from_now else task.announced))
                     for task in known if task.id in starts) / total if total > 0.0 else 0.0


def needs_time(uavs: Iterable[Uav], tasks: Iterable[Task], objective: Objective,
               trips: int) -> bool:
    """Return whether times, loads or trips can change which plan is best.

    Where nothing has a latest time, `earliest`, `release` and speeds change the times of a plan,
    but not its distance. Only the solver with times takes tasks with a path.

    Args:
        uavs: the fleet.
        tasks: all tasks.
        objective: what is minimised.
        trips: of a UAV at most.

    Returns:
        False where the shortest routes that serve all tasks are best whatever the times.
    """
    fleet = list(uavs)
    return (not objective.is_shortest
            or any(task.latest < math.inf or task.payload > 0.0 or task.path for task in tasks)
            or any(uav.endurance < math.inf or uav.available_until < math.inf for uav in fleet)
            or (trips > 1 and any(uav.turnaround < math.inf for uav in fleet)))
