# SPDX-License-Identifier: Apache-2.0
"""What an order would cost: the world is solved with it and compared with the lists in force.

The plan in force is never touched, and nothing of it is shared with the thread that solves.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from uav_task_alloc.allocator.order_records import Order
from uav_task_alloc.allocator.replan_records import ReplanProblem
from uav_task_alloc.allocator.replanning.plan_acceptance import accepted_plan
from uav_task_alloc.allocator.replanning.planning import (
    repaired_plan,
    replan_problem,
    solve_problem,
)
from uav_task_alloc.allocator.state.ordered_tasks import TaskSequence
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Plan
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.piece_ids import split_piece

_REPAIRS = 3.0  # times that lists are repaired and legs are searched for: before, with it, search
_LEAST = 0.2  # share of the budget that a search gets at least


@dataclass(frozen=True, slots=True)
class OrderChange:
    """Orders that come into force, and such that end, by one act of an operator."""

    action: str  # what is done, in words
    add: tuple[Order, ...] = ()  # without their numbers
    remove: tuple[Order, ...] = ()  # in force


@dataclass(frozen=True, slots=True)
class WhatIfProblem:
    """The world as it is, and as it would be, for the thread that solves."""

    before: ReplanProblem  # with the orders in force
    after: ReplanProblem  # with the change
    sequences: Mapping[str, TaskSequence]  # with the change: ordered tasks by UAV


@dataclass(frozen=True, slots=True)
class WhatIfAnswer:
    """What a change would cost: the plan that would follow against the lists in force."""

    after: Plan  # with the change
    distance: float  # [m] that all routes get longer
    finish: float  # [s] that the last route ends later
    late: tuple[str, ...]  # tasks that get late, or with a deadline into no route
    left_out: Mapping[str, str] = field(default_factory=dict)  # more of them: reason by task id


def what_if_problem(world: World, change: OrderChange, stamp: float) -> WhatIfProblem:
    """Return the problem of a change of orders; the world is as before afterwards.

    Args:
        world: is copied from.
        change: on trial.
        stamp: [s] clock of the node.

    Returns:
        A copy, which another thread may read while the world changes.
    """
    fresh = Plan({})  # its state would be shared with the thread of the solver
    before = replan_problem(world, fresh, 'dry run', background=False, stamp=stamp)
    with world.orders.trial(change.add, (order.id for order in change.remove)):
        after = replan_problem(world, fresh, 'dry run', background=False, stamp=stamp)
        sequences = world.ordered.sequences(world.params.route_end == 'home')
    return WhatIfProblem(before, after, sequences)


def solve_what_if(plan: Callable[..., Plan], problem: WhatIfProblem, params: AllocatorParams,
                  stop: Callable[[], bool], clock: Callable[[], float]) -> WhatIfAnswer:
    """Solve the problem of a change of orders within the budget of a re-plan.

    What it takes to repair the lists, without the change and with it, is part of the budget.

    Args:
        plan: `solver.solve.plan`, or a function like it.
        problem: see `what_if_problem`.
        params: of the allocator.
        stop: polled; the search ends early when it returns true.
        clock: [s], monotonic.

    Returns:
        What it costs, against the lists in force.
    """
    began = clock()
    before = repaired_plan(plan, problem.before, params, stop)
    rest = problem.after.budget - _REPAIRS * (clock() - began)
    after = accepted_plan(solve_problem(plan, replace(
        problem.after, budget=max(rest, _LEAST * problem.after.budget)), params, stop),
        params.replan_margin)
    times, then = before.timetable(), after.timetable()
    # a deadline that is missed is in `late`, or its task in no route
    timed = {task.id for task in problem.after.tasks if task.latest < math.inf}
    left_out = {task_id: why for task_id, why in after.unassigned.items()
                if task_id not in before.unassigned}
    late = sorted((set(then.late) - set(times.late)) | (timed & set(left_out)))
    return WhatIfAnswer(after, after.distance - before.distance,
                        _last(then.ends) - _last(times.ends), tuple(late), left_out)


def _last(ends: Mapping[str, float]) -> float:
    return max(ends.values(), default=0.0)


def broken_order(change: OrderChange, problem: WhatIfProblem, answer: WhatIfAnswer) -> str:
    """Return why the plan with a change does not keep an order that it adds.

    Args:
        change: that was on trial.
        problem: that was solved.
        answer: of the solve.

    Returns:
        Empty where it keeps all of them.
    """
    for order in change.add:
        sequence = problem.sequences.get(order.uav)
        if sequence is not None and sequence.left_out and (
                set(order.tasks) & set(sequence.left_out)):
            return sequence.why
        ordered = [task.id for task in problem.after.tasks
                   if split_piece(task.id)[0] in order.tasks]
        if why := _not_flown(order.uav, ordered, answer.after):
            return why
    return ''


def _not_flown(uav_id: str, tasks: Sequence[str], plan: Plan) -> str:
    """Why tasks that only one UAV may fly are not in its route."""
    for task_id in tasks:
        if task_id not in plan.routes.get(uav_id, ()):
            why = plan.unassigned.get(task_id, 'no plan with it was found')
            return f'{uav_id} cannot fly {task_id}: {why}'
    return ''
