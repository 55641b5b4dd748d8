# SPDX-License-Identifier: Apache-2.0
"""The world as a problem for the solver, and how it is solved; changes nothing itself."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

from uav_task_alloc.allocator.replan_records import FleetOutlook, ReplanAnswer, ReplanProblem
from uav_task_alloc.allocator.replanning.deadline_reserves import plan_in_time
from uav_task_alloc.allocator.replanning.from_now import counts_time, from_now, objective_of
from uav_task_alloc.allocator.replanning.height_limits import (
    with_height_limits,
    with_height_reasons,
)
from uav_task_alloc.allocator.replanning.held_deadlines import (
    relaxed_tasks,
    with_deadlines_held,
    with_true_values,
)
from uav_task_alloc.allocator.replanning.plan_acceptance import TaskIdsByUav
from uav_task_alloc.allocator.replanning.trips import waiting_uavs, with_later_trips
from uav_task_alloc.allocator.state.stop_times import first_leg_delay, timed_stops, way_ahead
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Plan, Point, Task, Uav
from uav_task_alloc.params import AllocatorParams


def replan_problem(world: World, best: Plan, trigger: str, background: bool,
                   stamp: float = 0.0, outlook: FleetOutlook | None = None) -> ReplanProblem:
    """Return the problem for the worker; the published lists are the incumbent.

    Args:
        world: is copied from.
        best: plan with which the search continues.
        trigger: what requires the plan.
        background: nothing does; a better plan is sought with `background_budget`.
        stamp: [s] published clock.
        outlook: where the next tasks are expected; None: that does not count.

    Returns:
        A copy, which the worker thread may read while the world changes.
    """
    params, uavs, tasks = world.params, tuple(map(world.uav, world.fleet.usable_ids())), \
        world.tasks_to_plan()
    objective, records = objective_of(params), world.task_records()
    stop_time, locked, too_high = 0.0, world.locked_tasks(), dict[str, str]()
    later = dict[str, Uav]()
    if counts_time(uavs, tasks, objective, params.trips):
        uavs = tuple(measured_uav(world, uav, stamp) for uav in uavs)
        tasks = _tasks_under_way(world, tasks, locked, stamp)
        later = {uav_id: uav for uav_id, uav in waiting_uavs(world, stamp).items()
                 if not world.usable(uav_id)}
        uavs += tuple(later.values())
        uavs, tasks, too_high = with_height_limits(world, uavs, tasks, locked, stamp)
        stop_time = world.flights.stop_time
        tasks = relaxed_tasks(world, tasks, (uav.id for uav in uavs), stamp)
    published = {uav.id: world.list_of(uav.id) for uav in uavs}
    under_way = ways_under_way(world)
    tasks = tuple(replace(task, position=way[0], path=way, reversible=False)
                  if (way := under_way.get(task.id)) else task for task in tasks)
    routes = {uav_id: each.task_ids for uav_id, each in published.items()}
    legs = {uav_id: tuple(stop.leg for stop in each.stops) for uav_id, each in published.items()}
    return ReplanProblem(
        world.version, trigger, background,
        params.background_budget if background else params.solve_budget, uavs,
        tasks, world.airspace.no_fly_zones(), locked,
        published=with_later_trips(replace(best, routes=routes, legs=legs, reversed=frozenset(
            stop.task.id for each in published.values() for stop in each.stops
            if stop.reversed and stop.task.id not in under_way)), world),
        warm=replace(best, reversed=best.reversed - under_way.keys()),
        objective=objective, trips=params.trips, stamp=stamp, stop_time=stop_time,
        since={task.id: records[task.id].since for task in tasks}, outlook=outlook,
        too_high=too_high, later_only=frozenset(later), flights={
            uav.id: replace(flight, served=0.0) for uav in uavs if uav.id not in later
            and (flight := world.flights.of(uav.id, stamp))})


def _tasks_under_way(world: World, tasks: Iterable[Task], locked: TaskIdsByUav,
                     stamp: float) -> tuple[Task, ...]:
    """Tasks, of those that are served at points only the rest of the service."""
    rests = dict[str, float]()
    for uav_id, ids in locked.items():
        stops, flight = world.list_of(uav_id).stops, world.flights.of(uav_id, stamp)
        if flight and stops and ids[:1] == (flight.serving,) == (stops[0].task.id,):
            first = timed_stops(stops[:1], flight)[0]
            rests[flight.serving] = max(0.0, first.task.stay - first.served)
    return tuple(replace(task, service_time=rests[task.id], actions=())
                 if task.id in rests and not task.path else task for task in tasks)


def ways_under_way(world: World) -> dict[str, tuple[Point, ...]]:
    """Return what is left to fly of the paths under way, in the direction of flight.

    Args:
        world: with the lists in force.

    Returns:
        [m] ENU by task id; the whole path where a UAV is on the leg to it.
    """
    rests = {}
    for uav_id, record in world.uav_records().items():
        stops = world.list_of(uav_id).stops
        first = stops[0] if stops else None
        if first is None or not first.task.path or world.fleet.active.get(
                uav_id) != first.task.id:
            continue
        place, way = record.report.position, first.way
        ahead = way_ahead(place, first)
        if ahead and math.dist(place, ahead[-1]) > 0.0:
            way = place, *ahead
        rests[first.task.id] = way
    return rests


def measured_uav(world: World, uav: Uav, stamp: float) -> Uav:
    """Return a UAV for a problem with times.

    Args:
        world: with the flights measured.
        uav: as planned.
        stamp: [s] published clock.

    Returns:
        With the speed that was measured, available from when its first leg would begin at that
        speed; on the ground near its home it is at its home.
    """
    record, flight = world.uav_record(uav.id), world.flights.of(uav.id, stamp)
    assert record is not None  # it is of the fleet
    assert flight is not None
    at_home = world.flights.at_home_since(uav.id) is not None
    speed = _list_speed(world, uav)
    return replace(uav, cruise_speed=speed,
                   available_from=first_leg_delay(world.list_of(uav.id).stops, flight, speed),
                   position=record.home if at_home else uav.position,
                   aboard=None if at_home or uav.at_base else frozenset(
                       stop.task.id for stop in world.list_of(uav.id).stops
                       if stop.task.payload > 0.0))


def _list_speed(world: World, uav: Uav) -> float:
    """Mean ground speed on the legs of the list in force, else in all directions [m/s]."""
    pace, points = world.flights.pace(uav.id), [uav.position]
    for stop in world.list_of(uav.id).stops:
        points += stop.line
    metres = math.fsum(math.dist(a[:2], b[:2]) for a, b in pairwise(points))
    level = replace(pace, climb=math.inf, descent=math.inf)
    return metres / level.seconds(points) if metres > 0.0 else pace.mean_speed


def solve_problem(plan: Callable[..., Plan], problem: ReplanProblem, params: AllocatorParams,
                  stop: Callable[[], bool]) -> ReplanAnswer:
    """Repair the published lists by insertion, then search for the best plan within the budget.

    Args:
        plan: `solver.solve.plan`, or a function like it.
        problem: see `replan_problem`.
        params: of the allocator.
        stop: polled; the search ends early when it returns true.

    Returns:
        Both plans; the best is the repaired one where nothing better was found. With an outlook,
        also the plan to publish.
    """
    given, problem = problem, from_now(problem)
    repaired, tasks = plan_in_time(given, problem.tasks, lambda tasks, _: _solved(
        plan, problem, params, stop, problem.published, 0, tasks))
    problem = replace(problem, tasks=tuple(tasks))
    first = problem.warm if problem.background else repaired
    best, tasks = plan_in_time(
        given, with_deadlines_held(problem, repaired), lambda tasks, before: _solved(
            plan, problem, params, stop, before or first, 0 if before else None, tasks))
    if tasks is not problem.tasks:
        best = with_true_values(best, problem.tasks)
    answer = ReplanAnswer(problem, repaired, best)
    if problem.outlook is None or stop():
        return answer
    from uav_task_alloc.allocator.replanning.covered_plan import covered_plan  # imports numba
    return replace(answer, covered=covered_plan(answer, params.replan_margin, lambda warm: _solved(
        plan, problem, params, stop, warm, 0, problem.tasks)))


def repaired_plan(plan: Callable[..., Plan], problem: ReplanProblem, params: AllocatorParams,
                  stop: Callable[[], bool]) -> Plan:
    """Return the published lists, repaired by insertion, without a search.

    Args:
        plan, problem, params, stop: as of `solve_problem`.
    """
    given, problem = problem, from_now(problem)
    return plan_in_time(given, problem.tasks, lambda tasks, _: _solved(
        plan, problem, params, stop, problem.published, 0, tasks))[0]


def _solved(plan: Callable[..., Plan], problem: ReplanProblem, params: AllocatorParams,
            stop: Callable[[], bool], warm: Plan, max_iterations: int | None,
            tasks: Sequence[Task]) -> Plan:
    found = plan(problem.uavs, tasks, problem.zones, budget=problem.budget,
                 seed=params.seed, warm=warm, route_end=params.route_end,
                 locked=problem.locked, clearance=params.clearance,
                 altitude_min=params.altitude_min, altitude_max=params.altitude_max,
                 threads=params.threads, objective=problem.objective, stop=stop,
                 trips=problem.trips, max_iterations=max_iterations)
    return with_height_reasons(found, problem.too_high, tasks)
