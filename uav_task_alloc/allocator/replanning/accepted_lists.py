# SPDX-License-Identifier: Apache-2.0
"""The lists of a proposal that an operator accepts, for the world as it is by then."""
from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from itertools import chain, dropwhile, zip_longest

from uav_task_alloc.allocator.list_records import LaterTrips, UavList
from uav_task_alloc.allocator.records import Proposal
from uav_task_alloc.allocator.replanning.built_lists import (
    BuiltLists,
    backward_paths,
    build_empty_list,
    build_list,
)
from uav_task_alloc.allocator.replanning.from_now import separation_of
from uav_task_alloc.allocator.replanning.held_deadlines import held_lists
from uav_task_alloc.allocator.replanning.lists_to_publish import lists_apart
from uav_task_alloc.allocator.replanning.plan_acceptance import TaskIdsByUav
from uav_task_alloc.allocator.replanning.task_lists import legs_of_list
from uav_task_alloc.allocator.replanning.trips import remaining_trips
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Plan


def accepted_lists(world: World, proposal: Proposal, stamp: float) -> tuple[BuiltLists, str]:
    """Build the lists of a proposal as they were approved; the world is not changed.

    Tasks that have ended are left out, and a leg that a zone cuts, or of which the UAV has flown a
    part, leads from where it is. Routes, directions of paths, waits and heights stay, but where
    two UAVs would not be apart any more.

    Args:
        world: as it is now.
        proposal: that waits for approval.
        stamp: [s] published clock.

    Returns:
        Lists to put in force, and why they cannot be; '' if they can.
    """
    routes = {each.uav: tuple(stop.task.id for stop in each.stops
                              if world.tasks.is_open(stop.task.id)) for each in proposal.lists}
    built, why = BuiltLists(), _why_outdated(world, proposal, routes)
    built.later = _later_trips_then(world, proposal, routes)
    backward = backward_paths(world, plan_of_lists(world, proposal.lists))
    for each in proposal.lists:
        why = why or _build_accepted(world, built, each, routes[each.uav], backward, stamp)
    if why:
        return BuiltLists(), why
    held, reasons = held_lists(world, built.lists, stamp)
    if any(held[uav_id] is not each for uav_id, each in built.lists.items()):
        left_out = next(iter(reasons.values()), 'it would break a deadline that is accepted')
        return BuiltLists(), left_out.removeprefix('left out: ')
    return _apart_from_others(world, built, stamp), ''


def plan_of_lists(world: World, lists: Collection[UavList]) -> Plan:
    """Return the plan of the lists in force, but for those UAVs that have others.

    Args:
        world: with the lists in force.
        lists: that replace some of them.

    Returns:
        Routes, and the paths that are flown from their last points; no legs.
    """
    every = {**world.lists_in_force(), **{each.uav: each for each in lists}}
    return Plan({uav_id: each.task_ids for uav_id, each in every.items()},
                returns=world.params.route_end == 'home',
                reversed=frozenset(stop.task.id for each in every.values()
                                   for stop in each.stops if stop.reversed))


def _why_outdated(world: World, proposal: Proposal, routes: TaskIdsByUav) -> str:
    """Why the routes of a proposal are not those of the present world any more; '': they are."""
    for each in proposal.lists:
        if each.stops and not world.usable(each.uav):
            return world.fleet.why_unusable(each.uav)
        for stop in each.stops:
            if stop.task.id not in routes[each.uav]:
                continue
            if world.task_records()[stop.task.id].task != stop.task:
                return f'{stop.task.id} was changed'
            if not world.can_fly(each.uav, stop.task.id):
                return f'{each.uav} may not fly {stop.task.id} any more'
    mine = {*chain(*routes.values())}
    for uav_id, other in world.lists_in_force().items():
        taken = [] if uav_id in routes else [name for name in other.task_ids if name in mine]
        if taken:
            return f'{uav_id} has {taken[0]}'
    return _why_not_next(world, routes)


def _why_not_next(world: World, routes: TaskIdsByUav) -> str:
    """Why UAVs may not fly these routes: tasks under way, and ordered ones, come first."""
    locked = {**world.locked_tasks(), **world.ordered.kept()}
    owner = {name: uav_id for uav_id, names in locked.items() for name in names}
    for uav_id, row in routes.items():
        lead = locked.get(uav_id, ())
        for name, other in zip_longest(lead, row[:len(lead)]):
            if name != other:
                return f'{uav_id} has to fly {name} first'
        for name in row:
            if owner.get(name, uav_id) != uav_id:
                return f'{name} stays with {owner[name]}'
    return ''


def _later_trips_then(world: World, proposal: Proposal, routes: TaskIdsByUav) -> LaterTrips:
    """The later trips with a proposal, less the tasks that are in lists."""
    every = {**{uav_id: each.task_ids for uav_id, each in world.lists_in_force().items()},
             **routes}
    others = {uav_id: trips for uav_id, trips in world.later.items() if uav_id not in routes}
    return remaining_trips(world, proposal.later | others, chain(*every.values()))


def _build_accepted(world: World, built: BuiltLists, each: UavList, task_ids: tuple[str, ...],
                    backward: Collection[str], stamp: float) -> str:
    """Build an accepted list from where its UAV is; returns why that is not possible, or ''."""
    if not world.usable(each.uav):  # it has no tasks
        build_empty_list(world, built, each.uav, stamp)
        return ''
    tasks = [world.task_records()[task_id].task for task_id in task_ids]
    rest = dropwhile(lambda stop: stop.task.id not in task_ids, each.stops)
    returns = world.params.route_end == 'home' or each.uav in built.later
    unreachable: Mapping[str, str] = build_list(
        world, built, each.uav, tasks, returns, legs_of_list(each), stamp, backward,
        replace(each, stops=tuple(rest)))
    built.zones_when_built[each.uav] = world.airspace.paths(), world.uav_records()[each.uav].home
    return next((f'{task_id}: {why}' for task_id, why in unreachable.items()), '')


def _apart_from_others(world: World, built: BuiltLists, stamp: float) -> BuiltLists:
    """The lists, and those of other UAVs that have to change to be apart from them."""
    if not separation_of(world.params).on:
        return built
    every = {**world.lists_in_force(), **built.lists}
    apart = lists_apart(world, replace(built, lists=every), stamp)
    return replace(apart, lists={uav_id: each for uav_id, each in apart.lists.items()
                                 if uav_id in built.lists or each is not every[uav_id]})
