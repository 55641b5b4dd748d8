# SPDX-License-Identifier: Apache-2.0
"""To what height each UAV may be planned: its climb and landing come out of its endurance.

The endurance of a UAV counts the climb to the highest task that it may get, and the way down from
there. A task that is too high for it, or for the list that it has, is not planned for it, so that
the height of one task takes nothing from UAVs that do not fly it.
"""
from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from uav_task_alloc.allocator.state.flights import top_of
from uav_task_alloc.allocator.state.stop_times import finish_time
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.errors import first_of
from uav_task_alloc.model import Plan, Task, Uav

_MARGIN = 0.05  # share by which the solver's times may differ from those of lists


def with_height_limits(world: World, uavs: Sequence[Uav], tasks: Sequence[Task],
                       locked: Mapping[str, tuple[str, ...]], stamp: float,
                       ) -> tuple[tuple[Uav, ...], tuple[Task, ...], dict[str, str]]:
    """Return a problem whose UAVs can end their flights, whichever of their tasks they get.

    Args:
        world: with the flights measured, and the lists in force.
        uavs: of the problem, with the endurance that they have.
        tasks: of the problem.
        locked: ids of the tasks that a plan may not take from a UAV, by UAV id.
        stamp: [s] published clock.

    Returns:
        The UAVs with the endurance that is left for their legs; the tasks, less the UAVs that
        they are too high for; and why they are, by task id.
    """
    able, refused = list[Uav](), dict[str, dict[str, str]]()
    highest_first = dict(sorted(((task.id, (top_of(task), task)) for task in tasks),
                                key=lambda each: each[1][0], reverse=True))
    for uav in uavs:
        if math.isinf(uav.endurance):
            able.append(uav)
            continue
        limit, whys = _height_limit(world, uav, highest_first,
                                    locked.get(uav.id, ()), stamp)
        able.append(world.flights.spendable(uav, limit))
        for task, why in whys:  # what takes too long in any case has a reason of the solver
            if _fits(world, able[-1], task, 1.0 + _MARGIN):
                refused.setdefault(task.id, {})[uav.id] = why
    everyone = frozenset(uav.id for uav in uavs)
    less = tuple(task if task.id not in refused else replace(task, allowed_uavs=(
        everyone if task.allowed_uavs is None else task.allowed_uavs) - refused[task.id].keys())
                 for task in tasks)
    return tuple(able), less, {
        task_id: f'too high: {first_of(whys.values(), separator="; ")}'
        for task_id, whys in refused.items()}


def with_height_reasons(plan: Plan, too_high: Mapping[str, str], tasks: Sequence[Task]) -> Plan:
    """Return a plan that says of the tasks that it leaves out for which UAVs they are too high.

    Args:
        plan: of a problem with height limits.
        too_high: reasons of these limits, by task id.
        tasks: of the problem.
    """
    nobody = {task.id for task in tasks if task.allowed_uavs == frozenset()}
    reasons = {task_id: too_high[task_id] if task_id in nobody else f'{why}; {too_high[task_id]}'
               for task_id, why in plan.unassigned.items() if task_id in too_high}
    return replace(plan, unassigned={**plan.unassigned, **reasons}) if reasons else plan


def _height_limit(world: World, uav: Uav, tasks: Mapping[str, tuple[float, Task]],
                  locked: Collection[str], stamp: float) -> tuple[float, list[tuple[Task, str]]]:
    """The height [m] of the highest task that a UAV may get; the higher ones, and why not.

    tasks: with their heights [m], by id, the highest first.
    """
    own = {stop.task.id: top_of(stop.task) for stop in world.list_of(uav.id).stops}
    own.update(dict.fromkeys(locked, math.inf))
    # a listed task that was moved up is judged as a new one
    present = ((tasks[task_id], top) for task_id, top in own.items() if task_id in tasks)
    limit = max((top for (top, task), before in present if top <= before
                 and _may_get(uav, task)), default=-math.inf)
    whys, needed = list[tuple[Task, str]](), math.nan
    for top, task in tasks.values():
        if top <= limit:
            break
        if not _may_get(uav, task):
            continue
        needed = _needed(world, uav, stamp) if math.isnan(needed) else needed
        why = _why_too_high(world, uav, task, needed)
        if not why:
            return top, whys
        whys.append((task, why))
    return limit, whys


def _needed(world: World, uav: Uav, stamp: float) -> float:
    """The time in the air [s] that the list in force of a UAV still takes."""
    flight = world.flights.of(uav.id, stamp)
    return 0.0 if flight is None else finish_time(
        world.lists.restamped(uav.id, stamp, flight), flight)


def _may_get(uav: Uav, task: Task) -> bool:
    return (task.allowed_uavs is None or uav.id in task.allowed_uavs) and (
        task.required_capabilities <= uav.capabilities)


def _why_too_high(world: World, uav: Uav, task: Task, needed: float) -> str:
    """Why a UAV cannot fly a task, or no more what its list needs [s]; '': it can."""
    limited = world.flights.spendable(uav, top_of(task))
    if not _fits(world, limited, task):
        return (f'{uav.id} needs {_seconds_alone(world, uav, task):.0f} s in the air and has '
                f'{limited.endurance:.0f} s')
    if needed > 0.0 and (1.0 + _MARGIN) * needed > limited.endurance:
        return (f'the list of {uav.id} needs {needed:.0f} s in the air and it would have '
                f'{limited.endurance:.0f} s')
    return ''


def _fits(world: World, uav: Uav, task: Task, share: float = 1.0) -> bool:
    """Whether a UAV can fly a task alone, now or from its base, with a share of its endurance."""
    if _seconds_alone(world, uav, task) <= share * uav.endurance:
        return True
    if world.params.trips <= 1 or uav.full_endurance is None:
        return False
    rested = replace(uav, position=uav.base)
    return _seconds_alone(world, rested, task) <= share * uav.full_endurance


def _seconds_alone(world: World, uav: Uav, task: Task) -> float:
    """The least time in the air [s] for one task, with the straight way home where it returns."""
    from uav_task_alloc.geometry.flight_time import (  # imports numba
        flight_time,
        service_seconds,
    )
    home = (uav.base,) if world.params.route_end == 'home' else ()
    ways = [(task.position, task.end), (task.end, task.position)]
    return service_seconds(uav, task) + world.flights.stop_time + min(
        flight_time(uav, (uav.position, begin)) + flight_time(uav, (end, *home))
        for begin, end in (ways if task.reversible else ways[:1]))
