# SPDX-License-Identifier: Apache-2.0
"""What a re-planning solves, and its result."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from uav_task_alloc.allocator.state.flight_pace import UavFlight
from uav_task_alloc.model import Plan, Point, Task, ThreatZone, Uav
from uav_task_alloc.objective import Objective

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class ReplanProblem:
    """A snapshot of the world for the worker; the world goes on while it is solved."""

    version: int  # of the world when it was copied
    trigger: str  # what asked for the plan
    background: bool  # without an event: only what is better by the margin is published
    budget: float  # [s]
    uavs: tuple[Uav, ...]  # usable
    tasks: tuple[Task, ...]  # open
    zones: tuple[ThreatZone, ...]  # in force
    locked: Mapping[str, tuple[str, ...]]  # by UAV: first tasks of its route
    published: Plan  # the lists in force
    warm: Plan  # the best plan so far, from which the search continues
    objective: Objective = field(default_factory=Objective)  # what is minimised
    trips: int = 1  # of a UAV
    stamp: float = 0.0  # [s] of the copy, of the published clock
    since: Mapping[str, float] = field(default_factory=dict)  # [s] announcements, by task id
    stop_time: float = 0.0  # [s] that braking and accelerating cost at each task
    outlook: FleetOutlook | None = None  # None: the next tasks do not count
    too_high: Mapping[str, str] = field(default_factory=dict)  # for which UAVs; by task id
    # by UAV id: how each flies now; a service under way is in `tasks` as far as it is left
    flights: Mapping[str, UavFlight] = field(default_factory=dict)
    later_only: frozenset[str] = frozenset()  # ids of UAVs whose batteries are changed first


@dataclass(frozen=True, slots=True)
class FleetOutlook:
    """Where the next task is expected, at k places, and where UAVs without tasks wait for it."""

    x: NDArray[np.float64]  # (k) [m] east
    y: NDArray[np.float64]  # (k) [m] north
    weight: NDArray[np.float64]  # (k) probability of the task, times its value; the sum is 1
    value: float  # mean value of a task, > 0
    waiting: Mapping[str, Point]  # [m] ENU by UAV id; of others their positions


@dataclass(frozen=True, slots=True)
class ReplanAnswer:
    """Result of the worker."""

    problem: ReplanProblem  # that was solved
    repaired: Plan  # the published lists, repaired by insertion
    best: Plan  # the best plan within the budget
    covered: Plan | None = None  # the plan to publish, where the next tasks count
