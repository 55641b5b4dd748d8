# SPDX-License-Identifier: Apache-2.0
"""A plan whose UAVs are apart: flights of a plan, their resolution, and the plan with it.

What heights and waits do not resolve gets another UAV by another solve in which one of the two may
not serve the task, and is left out in the end.
"""
from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from uav_task_alloc.geometry.flight_time import flight_time, service_seconds
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.model import Plan, Task, Uav, turned_tasks
from uav_task_alloc.objective import fit
from uav_task_alloc.separation.conflicts import load_separation_kernels
from uav_task_alloc.separation.flight_legs import Flight, FlightLeg
from uav_task_alloc.separation.leg_changes import TransitLimits
from uav_task_alloc.separation.resolution import Resolution, resolve
from uav_task_alloc.separation.rule import Conflict, Separation
from uav_task_alloc.separation.volumes import flight_volumes, meeting_place
from uav_task_alloc.solver.problem import Limits, Rules
from uav_task_alloc.solver.timed.separated_trips import SeparatedTrips
from uav_task_alloc.solver.warm import WarmState
from uav_task_alloc.timetable import Timetable

_ROUNDS = 3  # solves in which a task may get another UAV
_RESOLVE_SHARE, _AGAIN_SHARE = 0.25, 0.1  # of the budget: for resolutions, for each such solve
_LEAST = 0.5  # [s] that resolutions may take, whatever the budget
_ALONE = 'left out: {} cannot be kept apart from {} on it'
# of tasks, what it starts from, and the budget [s]
Solve = Callable[[Sequence[Task], Plan | WarmState | None, float], Plan]


def separated_plan(solve: Solve, uavs: Sequence[Uav], tasks: Sequence[Task],
                   locked: Mapping[str, tuple[Task, ...]], limits: Limits, rules: Rules,
                   rule: Separation, warm: Plan | WarmState | None, budget: float,
                   clock: Callable[[], float] = time.perf_counter) -> Plan:
    """Solve, and change what is not apart.

    Args:
        solve: returns the plan of some tasks.
        uavs: the fleet.
        tasks: all tasks, locked ones included.
        locked: by UAV id the tasks that it serves first.
        limits: zones and altitudes.
        rules: how routes end, and the objective.
        rule: that is on.
        warm: what the first solve starts from.
        budget: [s] of all of it.
        clock: [s], monotonic.

    Returns:
        The plan with `conflicts`; legs have the transit heights, times the waits.
    """
    load_separation_kernels()
    result = solve(tasks, warm, (1.0 - _RESOLVE_SHARE) * budget)
    until = clock() + max(budget, _LEAST)
    transit = TransitLimits(limits.altitude_min, limits.altitude_max, lambda points: path_is_clear(
        points, limits.zones, limits.clearance), lambda: clock() > until)
    known, moved = {task.id: task for task in tasks}, dict[str, Conflict]()
    fixed = {task.id for held in locked.values() for task in held}
    for turn in range(_ROUNDS + 1):
        flights = flights_of_plan(result, uavs, known, rules.returns)
        trips = SeparatedTrips(result, uavs, tasks, locked, rules)
        found = resolve(flights, rule, replace(transit, is_allowed=trips.keeps_limits),
                        places=True)
        barred = _barred(found, fixed, rule)
        if not barred or turn == _ROUNDS or transit.stop():
            break
        for name, (uav_id, conflict) in barred.items():
            others = {uav.id for uav in uavs if uav.id != uav_id}
            allowed = known[name].allowed_uavs
            known[name] = replace(known[name], allowed_uavs=frozenset(
                others if allowed is None else allowed & others))
            moved[name] = conflict
            if turn == _ROUNDS - 1:
                known[name] = replace(known[name], allowed_uavs=frozenset())
        result = _after(result, solve(list(known.values()), result, _AGAIN_SHARE * budget))
    return _with_resolution(result, trips, rules, flights, found, moved)


def _after(first: Plan, again: Plan) -> Plan:
    """A plan of another solve with the time, the iterations and the start of all of them."""
    return replace(again, solve_time=first.solve_time + again.solve_time,
                   iterations=first.iterations + again.iterations,
                   warm_started=first.warm_started, history=tuple(
                       (first.solve_time + seconds, fit) for seconds, fit in again.history))


def _barred(found: Resolution, fixed: Iterable[str], rule: Separation
            ) -> dict[str, tuple[str, Conflict]]:
    """By id of each task that should get another UAV: its UAV, and the conflict."""
    barred: dict[str, tuple[str, Conflict]] = {}
    for each in found.left:
        ends = list[tuple[str, str]]()
        for k, n in zip(each.flights, each.legs, strict=True):
            legs = found.flights[k].legs
            # the leg itself, or the task before a return
            names = [leg.task for leg in legs[:n + 1] if leg.task and leg.task not in fixed]
            ends.append((names[-1] if names else '', found.flights[k].uav))
        if any(name in barred for name, _ in ends):
            continue
        for (name, uav_id), (other, other_uav) in (ends[::-1], ends):
            if name:
                barred[name] = uav_id, Conflict(
                    (uav_id, other_uav), (name, other), each.time, each.horizontal,
                    each.vertical, position=meeting_place(
                        flight_volumes([found.flights[k] for k in each.flights], rule), (0, 1),
                        each.legs, each.time))
                break
    return barred


def flights_of_plan(plan: Plan, uavs: Iterable[Uav], tasks: Mapping[str, Task],
                    returns: bool) -> list[Flight]:
    """Return what each UAV flies by a plan.

    Args:
        plan: with its legs.
        uavs: the fleet.
        tasks: by id.
        returns: routes end at home.

    Returns:
        In the order of the UAVs.
    """
    times = plan.timetable()
    flown = {task.id: task for task in turned_tasks(tasks.values(), plan.reversed)}
    return [_flight(uav, plan, times, flown, returns) for uav in uavs]


def _flight(uav: Uav, plan: Plan, times: Timetable, tasks: Mapping[str, Task],
            returns: bool) -> Flight:
    legs, place = list[FlightLeg](), uav.position
    rows = iter(plan.legs.get(uav.id, ()))
    trips = plan.trips_of(uav.id)
    departures = times.departures.get(uav.id, ())
    for number, row in enumerate(trips):
        on_ground = number > 0 or uav.at_base
        for k, name in enumerate(row):
            task, leg = tasks[name], next(rows)
            release = task.release
            if k == 0 and number < len(departures):
                release = max(release, departures[number])
            legs.append(FlightLeg((place, *leg.via, task.position), name,
                                  0.0 if task.path else task.stay, task.earliest, task.latest,
                                  release, takes_off=on_ground and k == 0))
            if task.path:
                legs.append(_along_path(uav, task))
            place = task.end
        leg_home = next(rows, None) if number + 1 < len(trips) or (returns and row) else None
        if leg_home is not None:
            legs.append(FlightLeg((place, *leg_home.via, uav.base), '',
                                  uav.turnaround if number + 1 < len(trips) else 0.0, lands=True))
            place = uav.base
    return Flight(uav.id, tuple(legs), uav.position, uav.cruise_speed, uav.climb_speed,
                  uav.descent_speed, uav.available_from if uav.at_base else 0.0,
                  in_air=not uav.at_base)


def _along_path(uav: Uav, task: Task) -> FlightLeg:
    """The path of a task; the stay, and what it takes longer than other legs, are at its end."""
    stay = service_seconds(uav, task) - flight_time(uav, task.path)
    return FlightLeg(task.path, '', max(0.0, stay), movable=False, may_wait=False)


def _with_resolution(plan: Plan, trips: SeparatedTrips, rules: Rules, before: Sequence[Flight],
                     found: Resolution, moved: Mapping[str, Conflict]) -> Plan:
    """The plan with changed legs and times, reasons and conflicts."""
    conflicts = (*found.conflicts, *(_moved(plan, name, each) for name, each in moved.items()))
    unassigned = {name: _ALONE.format(*moved[name].uavs) if name in moved else why
                  for name, why in plan.unassigned.items()}
    if not any(a is not b for a, b in zip(before, found.flights, strict=True)):
        return replace(plan, conflicts=conflicts, unassigned=unassigned)
    flown = trips.evaluation(found.flights)
    return replace(plan, legs={each.uav: trips.legs(each) for each in found.flights},
                   distance=flown.distance, penalty=flown.penalty, cost=flown.cost,
                   fit=fit(flown.distance, plan.value, flown.penalty, rules.weights),
                   timetable=lambda: flown.timetable, conflicts=conflicts, unassigned=unassigned)


def _moved(plan: Plan, name: str, each: Conflict) -> Conflict:
    """What became of a task that should get another UAV."""
    uav_id = next((uav for uav, row in plan.routes.items() if name in row), '')
    if not uav_id:
        return replace(each, resolution='left out', detail=f'task {name} is left out')
    return replace(each, resolution='other uav', detail=f'{uav_id} serves task {name}')
