# SPDX-License-Identifier: Apache-2.0
"""The lists of a plan as they may be published: no accepted deadline is broken, UAVs are apart."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.replan_records import ReplanAnswer, ReplanProblem
from uav_task_alloc.allocator.replanning.built_lists import BuiltLists, build_lists
from uav_task_alloc.allocator.replanning.from_now import separation_of
from uav_task_alloc.allocator.replanning.held_deadlines import held_lists
from uav_task_alloc.allocator.replanning.plan_acceptance import (
    UavCost,
    accepted_plan,
    cost_of_routes,
)
from uav_task_alloc.allocator.state.flight_pace import UavFlight
from uav_task_alloc.allocator.state.stop_times import finish_time, timed_stops
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Plan


def lists_to_publish(world: World, chosen: Plan, stamp: float) -> BuiltLists:
    """Build the lists of a plan that may be put in force; the world is not changed.

    Args:
        world: as it is now.
        chosen: plan, for this world or an earlier one.
        stamp: [s] published clock.

    Returns:
        Lists that are apart, without those that would break a deadline that is accepted.
    """
    built = build_lists(world, chosen, stamp)
    lists, why = held_lists(world, built.lists, stamp)
    return lists_apart(world, replace(built, lists=lists, left_out={**built.left_out, **why}),
                       stamp)


def lists_apart(world: World, built: BuiltLists, stamp: float) -> BuiltLists:
    """Return lists with what keeps their UAVs apart, see `with_separation`.

    Args:
        world: as it is now.
        built: lists that would be put in force.
        stamp: [s] published clock.

    Returns:
        The same lists where separation is off.
    """
    if not separation_of(world.params).on:
        return built
    from uav_task_alloc.allocator.replanning.separated_lists import (  # imports numba
        with_separation,
    )
    return with_separation(world, built, stamp)


def holding_plan(world: World, plans: Sequence[Plan], stamp: float) -> Plan:
    """Return the first plan that breaks no deadline which the lists in force keep.

    Args:
        world: as it is now.
        plans: in the order of preference.
        stamp: [s] published clock.

    Returns:
        The first of all where each breaks one: its lists are held back, see `held_lists`.
    """
    if all(math.isinf(record.task.latest) for record in world.tasks.open()):
        return plans[0]
    for each in plans:
        lists = build_lists(world, each, stamp).lists
        held, _ = held_lists(world, lists, stamp)
        if all(held[uav_id] is lists[uav_id] for uav_id in lists):
            return each
    return plans[0]


def plan_to_publish(world: World, answer: ReplanAnswer, stamp: float) -> tuple[Plan, BuiltLists]:
    """Return the plan of an answer to put in force, and its lists.

    It is better by the margin than the repaired one. Without an event it has to be so with what
    keeps its UAVs apart, too, which may cost more than it saves: if it were put in force then, the
    next search would find the one before it to be better.

    Args:
        world: as it is now.
        answer: of the worker.
        stamp: [s] published clock.

    Returns:
        The repaired plan where no other one is better.
    """
    problem, margin = answer.problem, world.params.replan_margin
    accepted = accepted_plan(answer, margin)
    plans = (accepted, answer.repaired) if answer.covered is None else (
        answer.covered, accepted, answer.repaired)
    chosen = holding_plan(world, plans, stamp)
    built = lists_to_publish(world, chosen, stamp)
    if (not problem.background or not separation_of(world.params).on
            or answer.covered is not None or built.later  # lists are no measure of these
            or chosen.routes == answer.repaired.routes or chosen.value > answer.repaired.value):
        return chosen, built
    before = lists_to_publish(world, answer.repaired, stamp)
    first, cost = (_cost_of_lists(world, problem, each, stamp) for each in (before, built))
    if first - cost > margin * first:
        return chosen, built
    return answer.repaired, before


def _cost_of_lists(world: World, problem: ReplanProblem, built: BuiltLists,
                   stamp: float) -> float:
    """The cost of the objective of lists from where their UAVs are now."""
    costs = [_uav_cost(each, flight) for uav_id, each in built.lists.items()
             if (flight := world.flights.of(uav_id, stamp)) is not None]
    return cost_of_routes(problem, costs, math.fsum(task.value for task in problem.tasks))


def _uav_cost(each: UavList, flight: UavFlight) -> UavCost:
    """What a list adds to the cost."""
    stops = timed_stops(each.stops, flight)
    if not stops:
        return UavCost(0.0, -math.inf, [], [])
    line = stops[0].line
    ahead = line if flight.on_ground else line[flight.passed(line):]
    metres = polyline_length((flight.position, *ahead)) + math.fsum(
        stop.length for stop in stops[1:])
    if each.returns and flight.home is not None:
        metres += polyline_length((stops[-1].exit, *each.end_via, flight.home))
    return UavCost(
        metres, finish_time(replace(each, stops=stops), flight),
        [stop.task.value * stop.start for stop in stops],
        [max(0.0, flight.stamp + stop.start - stop.task.latest) for stop in stops])
