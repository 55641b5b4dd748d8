# SPDX-License-Identifier: Apache-2.0
"""The world as a problem for the solver, and a plan as task lists; changes nothing itself."""
from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

from uav_task_alloc.allocator.list_records import LaterTrips, UavList
from uav_task_alloc.allocator.replan_records import FleetOutlook, ReplanAnswer, ReplanProblem
from uav_task_alloc.allocator.replanning.from_now import (
    counts_time,
    from_now,
    objective_of,
    separation_of,
)
from uav_task_alloc.allocator.replanning.height_limits import (
    with_height_limits,
    with_height_reasons,
)
from uav_task_alloc.allocator.replanning.held_deadlines import (
    relaxed_tasks,
    with_deadlines_held,
    with_true_values,
)
from uav_task_alloc.allocator.replanning.plan_acceptance import TaskIdsByUav, repaired_routes
from uav_task_alloc.allocator.replanning.task_lists import LegKey, build_task_list, planned_legs
from uav_task_alloc.allocator.replanning.trips import present_trips, waiting_uavs, with_later_trips
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.safe_paths import SafePaths
from uav_task_alloc.allocator.state.stop_times import way_ahead
from uav_task_alloc.allocator.state.tasks import TaskRegistry
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Leg, Plan, Point, Task, Uav
from uav_task_alloc.objective import fit
from uav_task_alloc.params import AllocatorParams


@dataclass(slots=True)
class BuiltLists:
    """The lists of a plan, and what the world has to know of them."""

    lists: dict[str, UavList] = field(default_factory=dict)  # by UAV
    left_out: dict[str, str] = field(default_factory=dict)  # task id -> reason
    # UAV -> paths and home that its list was built for
    zones_when_built: dict[str, tuple[SafePaths, Point]] = field(default_factory=dict)
    # UAV -> whether it has a safe path home, and from where [m]
    paths_home: dict[str, tuple[bool, Point]] = field(default_factory=dict)
    later: LaterTrips = field(default_factory=dict)  # after the lists
    together: tuple[str, ...] = ()  # a sentence for each two UAVs that are not kept apart


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
    if counts_time(uavs, tasks, objective, params.trips):
        uavs = tuple(measured_uav(world, uav) for uav in uavs)
        uavs += tuple(uav for uav_id, uav in waiting_uavs(world, stamp).items()
                      if not world.usable(uav_id))
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
        too_high=too_high)


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


def backward_paths(world: World, chosen: Plan) -> frozenset[str]:
    """Return the tasks whose paths are flown from the last point: under way as in the lists.

    Args:
        world: with the lists in force.
        chosen: plan; a path under way has one direction there.

    Returns:
        Task ids.
    """
    under_way = {stops[0].task.id: stops[0].reversed
                 for uav_id, each in world.lists_in_force().items() if (stops := each.stops)
                 and world.fleet.active.get(uav_id) == stops[0].task.id}
    return frozenset(chosen.reversed - under_way.keys()) | {
        task_id for task_id, backward in under_way.items() if backward}


def measured_uav(world: World, uav: Uav) -> Uav:
    """Return a UAV for a problem with times.

    Args:
        world: with the flights measured.
        uav: as planned.

    Returns:
        With the speed that was measured; on the ground near its home it is at its home.
    """
    record = world.uav_record(uav.id)
    assert record is not None  # it is of the fleet
    at_home = world.flights.at_home_since(uav.id) is not None
    return replace(uav, cruise_speed=_list_speed(world, uav),
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
    problem = from_now(problem)
    repaired = _solved(plan, problem, params, stop, problem.published, 0, problem.tasks)
    tasks = with_deadlines_held(problem, repaired)
    best = _solved(plan, problem, params, stop,
                   problem.warm if problem.background else repaired, None, tasks)
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
    problem = from_now(problem)
    return _solved(plan, problem, params, stop, problem.published, 0, problem.tasks)


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


def build_lists(world: World, chosen: Plan, stamp: float) -> BuiltLists:
    """Build the lists of a plan for the world as it is now; the world is not changed.

    A list that is still valid is kept, also one to a waiting place of a UAV without tasks. UAVs
    that the plan does not use get an empty list, but not while tasks are held after a restart.

    Args:
        world: as it is now.
        chosen: plan, made for this world or an earlier one.
        stamp: [s] published clock.

    Returns:
        Lists by UAV, and the tasks that are in none with their reasons.
    """
    built = BuiltLists(left_out=dict(chosen.unassigned))
    if world.params.trips > 1:
        chosen, built.later = present_trips(chosen, {
            uav_id for uav_id in chosen.routes if not world.usable(uav_id)})
    legs, returns = planned_legs(chosen), world.params.route_end == 'home'
    backward = backward_paths(world, chosen)
    for uav_id, task_ids in _present_routes(world, chosen).items():
        tasks = [world.task_records()[task_id].task for task_id in task_ids]
        home = returns or uav_id in built.later
        waits = not (tasks or home) and way_to_place_is_clear(world, world.list_of(uav_id))
        if waits or world.validity.is_current(uav_id, tasks, home, backward):
            built.lists[uav_id] = world.list_of(uav_id)
            continue
        unreachable = build_list(world, built, uav_id, tasks, home, legs, stamp, backward)
        built.left_out.update(unreachable)
        built.zones_when_built[uav_id] = world.airspace.paths(), world.uav_records()[uav_id].home
    for each in world.ordered.sequences(returns).values():
        built.left_out.update(dict.fromkeys(each.left_out, each.why))
    # unknown UAVs, too: one that returns must not fly what others have
    for uav_id in world.lists_in_force():
        if uav_id not in built.lists and not world.restart_hold:
            build_empty_list(world, built, uav_id, stamp)
    return built


def way_to_place_is_clear(world: World, each: UavList) -> bool:
    """Return whether a list leads to a waiting place, and nothing is in the way.

    Args:
        world: as it is now.
        each: the list in force of a UAV.

    Returns:
        False also where the UAV is not known.
    """
    record, place = world.uav_record(each.uav), each.waiting_place
    return record is not None and place is not None and world.airspace.paths().rest_of_leg(
        record.report.position, Leg(each.end_via[:-1], 0.0), place,
        record.report.velocity) is not None


def build_list(world: World, built: BuiltLists, uav_id: str, tasks: Sequence[Task], returns: bool,
               legs: Mapping[LegKey, Leg], stamp: float, backward: Collection[str] = (),
               approved: UavList | None = None) -> dict[str, str]:
    """Build the list of a known UAV.

    Args:
        world: as it is now.
        built: gets the list.
        uav_id: of a known UAV.
        tasks: in the order of flight.
        returns: whether the list should end with a return home.
        legs: of the plan, see `planned_legs`.
        stamp: [s] published clock.
        backward: ids of the tasks whose paths are flown from the last point.
        approved: list whose legs and waits are kept; None: those of the list in force.

    Returns:
        Why it cannot reach tasks, by their ids.
    """
    uav, keep = world.uav(uav_id), approved is not None or separation_of(world.params).on
    new, unreachable = build_task_list(uav, tasks, returns, legs,
                                       approved or world.list_of(uav_id), world.airspace.paths(),
                                       world.flights.of(uav_id, stamp), keep, backward)
    end = new.stops[-1].exit if new.stops else uav.position
    built.lists[uav_id] = new
    built.paths_home[uav_id] = new.returns or not returns, end
    return unreachable


def build_empty_list(world: World, built: BuiltLists, uav_id: str, stamp: float) -> None:
    """Build an empty list, which leads home from where the UAV is now if the one before returned.

    Without a safe path home, or where it is not known where the UAV is, it ends with HOLD. With a
    low battery, for another one, or by order it returns home.

    Args:
        world: as it is now.
        built: gets the list.
        uav_id: of a UAV, known or not.
        stamp: [s] published clock.
    """
    record, published = world.uav_record(uav_id), world.list_of(uav_id)
    sent_home = record is not None and (record.low or record.awaits_battery
                                        or world.orders.returns(uav_id))
    if record is not None and (sent_home or published.returns):
        build_list(world, built, uav_id, (), True, {}, stamp)
        if record.blocked_on_ground and not sent_home:
            del built.paths_home[uav_id]
    elif published.stops:  # where a way home began, the UAV may never be
        built.lists[uav_id] = replace(published, stops=(), distance=0.0, returns=False,
                                      end_via=())
    else:
        built.lists[uav_id] = published


def _present_routes(world: World, chosen: Plan) -> TaskIdsByUav:
    routes = {uav_id: tasks for uav_id, tasks in chosen.routes.items() if world.usable(uav_id)}
    kept = world.ordered.kept()
    return repaired_routes(routes, {**world.locked_tasks(), **kept}, world.can_fly)


def plan_in_force(lists: PublishedLists, tasks: TaskRegistry, left_out: Mapping[str, str],
                  like: Plan) -> Plan:
    """Return the lists in force as a plan, with their figures; the rest is that of `like`.

    Args:
        lists: as published.
        tasks: of the lists, at least.
        left_out: reason by id of each task in no list.
        like: plan with the figures that lists do not have: penalty, history, state.

    Returns:
        Distance [m] and value are sums over the lists, fit is eq 2.12.
    """
    routes = {uav_id: each.task_ids for uav_id, each in lists.lists.items()}
    value = math.fsum(tasks.records[task_id].task.value
                      for task_ids in routes.values() for task_id in task_ids)
    distance = math.fsum(each.distance for each in lists.lists.values())
    return replace(like, routes=routes, unassigned=dict(left_out), value=value,
                   distance=distance, fit=fit(distance, value, like.penalty))
