# SPDX-License-Identifier: Apache-2.0
"""The events of a scenario, grouped by time."""
from __future__ import annotations

from dataclasses import dataclass, replace

from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.scenario.values import Scenario, TimedOrder
from uav_task_alloc.work.pieces import Work


@dataclass(frozen=True, slots=True)
class Moment:
    """The events at one time, in the order of the fields."""

    at: float  # [s] of the scenario
    zones: tuple[ThreatZone, ...] | None = None  # all zones in force; None: unchanged
    tasks: tuple[Task, ...] = ()  # announced
    works: tuple[Work, ...] = ()  # the same with their kinds and geometry
    cancels: tuple[Task, ...] = ()  # withdrawn
    deaths: tuple[str, ...] = ()  # ids of lost UAVs
    orders: tuple[TimedOrder, ...] = ()  # given by an operator


def timeline(scenario: Scenario) -> tuple[Moment, ...]:
    """Group the events of a scenario by time.

    Args:
        scenario: with the random arrivals drawn.

    Returns:
        In order of time; the first is at 0 and has the zones of the start.
    """
    changes = scenario.zone_changes()
    deaths = {uav.id: uav.dies_at for uav in scenario.uavs if uav.dies_at is not None}
    by_id = {timed.task.id: timed.task for timed in scenario.tasks}
    times = {*changes, *deaths.values(), *(timed.at for timed in scenario.tasks),
             *(cancel.at for cancel in scenario.cancels), *(each.at for each in scenario.orders)}
    return tuple(Moment(
        at,
        scenario.zones_at(at) if at in changes else None,
        tuple(timed.task for timed in scenario.tasks if timed.at == at),
        tuple(timed.whole for timed in scenario.tasks if timed.at == at),
        tuple(by_id[cancel.task] for cancel in scenario.cancels if cancel.at == at),
        tuple(uav for uav, dies_at in deaths.items() if dies_at == at),
        tuple(order for order in scenario.orders if order.at == at),
    ) for at in sorted(times))


def from_zero(task: Task, zero: float) -> Task:
    """Return a task of a scenario with its times on another clock.

    Args:
        task: with times in scenario seconds.
        zero: time of that clock at the start of the scenario [s].

    Returns:
        The same task where it has no times.
    """
    release = task.release + zero if task.release > 0.0 else 0.0
    return replace(task, earliest=task.earliest + zero, latest=task.latest + zero,
                   release=release)
