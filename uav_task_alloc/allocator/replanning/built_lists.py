# SPDX-License-Identifier: Apache-2.0
"""A plan as task lists for the world as it is now, and the lists in force as a plan."""
from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from uav_task_alloc.allocator.list_records import LaterTrips, UavList
from uav_task_alloc.allocator.replanning.from_now import separation_of
from uav_task_alloc.allocator.replanning.plan_acceptance import TaskIdsByUav, repaired_routes
from uav_task_alloc.allocator.replanning.task_lists import LegKey, build_task_list, planned_legs
from uav_task_alloc.allocator.replanning.trips import present_trips
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.safe_paths import SafePaths
from uav_task_alloc.allocator.state.tasks import TaskRegistry
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Leg, Plan, Point, Task
from uav_task_alloc.objective import fit


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


def _present_routes(world: World, chosen: Plan) -> TaskIdsByUav:
    routes = {uav_id: tasks for uav_id, tasks in chosen.routes.items() if world.usable(uav_id)}
    kept = world.ordered.kept()
    return repaired_routes(routes, {**world.locked_tasks(), **kept}, world.can_fly)


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
