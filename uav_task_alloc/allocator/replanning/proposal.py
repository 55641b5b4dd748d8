# SPDX-License-Identifier: Apache-2.0
"""Which lists of a plan need the approval of an operator, and which go out at once."""
from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

from uav_task_alloc.allocator.list_records import LaterTrips
from uav_task_alloc.allocator.records import Proposal
from uav_task_alloc.allocator.replanning.built_lists import BuiltLists
from uav_task_alloc.allocator.replanning.lists_to_publish import lists_to_publish
from uav_task_alloc.allocator.replanning.plan_acceptance import TaskIdsByUav, exchange_groups
from uav_task_alloc.allocator.replanning.proposal_changes import new_proposal, present_routes
from uav_task_alloc.allocator.replanning.trips import remaining_trips
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Plan


@dataclass(frozen=True, slots=True)
class SplitPlan:
    """A plan, divided by what needs the approval of an operator."""

    built: BuiltLists  # that go out at once
    at_once: str  # why some of them need no approval; '' where none is of that kind
    proposal: Proposal | None  # the rest, without its revision; None where there is none
    waiting: frozenset[str] = frozenset()  # tasks that only the proposal has in a list


def split_plan(world: World, chosen: Plan, built: BuiltLists, trigger: str,
               stamp: float) -> SplitPlan:
    """Divide a plan by what needs the approval of an operator.

    Never held up are lists that cannot be flown on as they are (a zone, a lost UAV, a battery, an
    order), those of UAVs that get tasks by an order, and those that exchange tasks with them.
    With `approval: replan` the first tasks of UAVs without any need none either.

    Args:
        world: as it is now.
        chosen: plan, for this world or an earlier one.
        built: its lists, see `lists_to_publish`.
        trigger: what required it.
        stamp: [s] clock of the node.

    Returns:
        Lists to publish, and a proposal.
    """
    if world.params.approval == 'none':
        return SplitPlan(built, '', None)
    before = present_routes(world, world.lists_in_force())
    after = {uav_id: each.task_ids for uav_id, each in built.lists.items()}
    held, reasons = set[str](), dict[str, str]()
    for group in exchange_groups(_open_routes(world, after), after):
        why = next(filter(None, (_why_at_once(world, uav_id, before, after)
                                 for uav_id in sorted(group))), '')
        first = not any(before.get(uav_id) for uav_id in group)
        if all(world.lists.is_void(built.lists[uav_id]) for uav_id in group):
            continue
        if why:
            reasons.update(dict.fromkeys(sorted(group), why))
        elif not (first and world.params.approval == 'replan'):
            held |= group
    text = '; '.join(f'{uav_id}: {why}' for uav_id, why in reasons.items())
    if not held:
        return SplitPlan(built, text, None)
    routes = {**after, **{uav_id: before.get(uav_id, ()) for uav_id in held}}
    proposal = new_proposal(world, chosen, built, held, trigger, stamp)
    now = lists_to_publish(world, _plan_at_once(world, chosen, built, proposal, routes), stamp)
    waiting = set(_tasks_of(proposal)) - {
        task_id for task_ids in before.values() for task_id in task_ids}
    return SplitPlan(now, text, proposal, frozenset(waiting))


def _open_routes(world: World, uav_ids: Iterable[str]) -> TaskIdsByUav:
    """The open tasks of lists in force, also those that their UAVs may not fly any more."""
    return {uav_id: tuple(filter(world.tasks.is_open, world.list_of(uav_id).task_ids))
            for uav_id in uav_ids}


def _why_at_once(world: World, uav_id: str, before: TaskIdsByUav, after: TaskIdsByUav) -> str:
    """Why a UAV may not wait for another list; '' if it may."""
    gained = {*after[uav_id]}.difference(before.get(uav_id, ()))
    ordered = any(world.orders.owner(task_id) == uav_id for task_id in gained)
    return world.validity.why_change(uav_id) or ('an order' if ordered else '')


def _tasks_of(proposal: Proposal) -> Iterator[str]:
    """The tasks of its lists, and of the later trips of their UAVs."""
    for each in proposal.lists:
        yield from each.task_ids
    for trips in proposal.later.values():
        yield from chain(*trips)


def _plan_at_once(world: World, chosen: Plan, built: BuiltLists, proposal: Proposal,
                  routes: TaskIdsByUav) -> Plan:
    """A plan in which the UAVs of a proposal keep their lists and their later trips.

    routes: of the lists that go out at once, and those in force of the UAVs that wait.
    """
    held = [world.list_of(each.uav) for each in proposal.lists]
    mine = {task_id for each in held for task_id in each.task_ids}
    later = _later_at_once(world, built, proposal, routes)
    trips = {uav_id: (task_ids if world.usable(uav_id) else (), *later.get(uav_id, ()))
             for uav_id, task_ids in routes.items()}
    first = {**chosen.routes, **{uav_id: rows[0] for uav_id, rows in chosen.trips.items()}}
    return replace(
        chosen, routes=routes, timetable=lambda: replace(chosen.timetable(), trips=trips),
        legs={uav_id: legs for uav_id, legs in chosen.legs.items()
              if first.get(uav_id) == routes.get(uav_id)},
        reversed=(chosen.reversed - mine) | {
            stop.task.id for each in held for stop in each.stops if stop.reversed})


def _later_at_once(world: World, built: BuiltLists, proposal: Proposal,
                   routes: TaskIdsByUav) -> LaterTrips:
    """The later trips with such a plan: those in force first; no task is planned twice."""
    waits = {each.uav: each.task_ids for each in proposal.lists}
    kept = {uav_id: world.later.get(uav_id, ()) for uav_id in waits}
    others = {uav_id: trips for uav_id, trips in built.later.items() if uav_id not in waits}
    return remaining_trips(world, kept | others, chain(*routes.values(), *waits.values()))
