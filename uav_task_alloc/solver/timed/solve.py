# SPDX-License-Identifier: Apache-2.0
"""Solves problems with time: arrays, first plan, colonies, and the plan with its times."""
from __future__ import annotations

import functools
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from itertools import chain

from uav_task_alloc.kernel_cache import (
    NO_WORK,
    NOTICE,
    TIMED_FEW_WORK,
    TIMED_FIRST_WORK,
    TIMED_LARGE_WORK,
    TIMED_SEARCH_WORK,
    TIMED_ZONES_WORK,
)
from uav_task_alloc.model import Plan, Task, ThreatZone, Uav, turned_tasks
from uav_task_alloc.solver.chain_q import run_colonies
from uav_task_alloc.solver.path_preparation import SEARCH_LIMIT, PathPreparation
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.reasons import load_reasons
from uav_task_alloc.solver.recombine import load_packing
from uav_task_alloc.solver.timed.answer import to_timed_plan
from uav_task_alloc.solver.timed.colony import (
    COLD,
    SELECTION,
    WARM,
    WARM_AND_FRESH,
    TimedColony,
    TimedParams,
)
from uav_task_alloc.solver.timed.intensify import Intensifier, may_be_large
from uav_task_alloc.solver.timed.labels import best_label, empty_labels
from uav_task_alloc.solver.timed.problem import TimedProblem, empty_timed_routes, make_timed
from uav_task_alloc.solver.timed.reasons import timed_reasons
from uav_task_alloc.solver.timed.recorder import TimedRecorder
from uav_task_alloc.solver.timed.round import empty_round
from uav_task_alloc.solver.timed.route_pool import may_combine
from uav_task_alloc.solver.timed.search import BEST_WORTH, FEW_ABSENT, Incumbent
from uav_task_alloc.solver.timed.warm import LEAST_PLACES, completed, first_plan
from uav_task_alloc.solver.warm import WarmState

SOLVER_NAME = 'chain_q'
PLACES_A_SECOND = 10_000_000  # of budget, that a first plan tries besides LEAST_PLACES
MANY_NEW = 0.05  # share of the tasks that are not in the routes of the earlier plan


def solve_timed(uavs: Sequence[Uav], tasks: Sequence[Task],
                locked: Mapping[str, tuple[Task, ...]], limits: Limits, rules: Rules,
                warm: Plan | WarmState | None = None, *, budget: float = 0.1, seed: int = 0,
                threads: int = 1, stop: Callable[[], bool] | None = None,
                max_iterations: int | None = None,
                on_iteration: Callable[[int, float], None] | None = None,
                clock: Callable[[], float] = time.perf_counter,
                params: TimedParams | None = None, reversed: Collection[str] = ()) -> Plan:
    """Solve a problem with time, as `plan` does; arguments are checked already.

    Args:
        uavs: the fleet.
        tasks: all tasks, locked ones included.
        locked: by UAV id the tasks that it serves first.
        limits: zones and altitudes.
        rules: how routes end, objective, trips.
        warm: an earlier plan, or its state, to start from.
        budget, seed, threads, stop, max_iterations, on_iteration, clock: as for `plan`.
        params: of the colonies; None: by whether there is an earlier plan.
        reversed: ids of the locked tasks that are flown from their last points.

    Returns:
        The best plan found, with its times.
    """
    load_timed_kernels(bool(limits.zones), max_iterations != 0, any(task.path for task in tasks),
                       warm is None and may_be_large(tasks, rules),
                       warm is None and may_combine(uavs, tasks, rules))
    began, before = clock(), WarmState.of(warm)
    search = PathPreparation(clock, began, budget, stop, before.flown())
    known = before.problem
    # those that are locked are turned themselves
    search.reversed = before.reversed - {task.id for row in locked.values() for task in row}
    locked = {uav_id: tuple(turned_tasks(row, reversed)) for uav_id, row in locked.items()}
    base = make_problem(uavs, tasks, locked, limits, rules, known, search, near=False)
    problem = make_timed(base, _aboard(uavs, tasks, base.locked, before), before.timed)
    recorder = TimedRecorder(clock, began, budget, max_iterations, stop, threads,
                             warm is not None, on_iteration, problem=problem)
    search.begin(1.0, SEARCH_LIMIT)
    first = _improve(recorder, seed, before, params)
    result = to_timed_plan(problem, recorder, recorder.best, SOLVER_NAME, warm is not None)
    if base.locked and rules.objective.response > 0.0:
        # how a later departure delays several locked tasks the search counts only about
        other = to_timed_plan(problem, recorder, first, SOLVER_NAME, warm is not None)
        result = min(result, other, key=lambda each: _rank(problem, each))
    search.path_budget.check()  # raises what a callback raised within a kernel
    held = {task.id for row in base.locked.values() for task in row if task.path}
    result = replace(result, reversed=result.reversed | held.intersection(reversed))
    state = WarmState(base, before.learnt, result.routes, trips=dict(result.trips),
                      reversed=result.reversed, timed=problem)
    return replace(result, state=state)


def _improve(recorder: TimedRecorder, seed: int, before: WarmState,
             params: TimedParams | None) -> Incumbent:
    """Make a first plan and improve it until the budget ends; returns the first one."""
    problem = recorder.problem
    most = LEAST_PLACES + int(PLACES_A_SECOND * recorder.budget)
    first, recorder.untried = first_plan(problem, before, most)
    recorder.offer(first)
    if not problem.base.tasks or not problem.base.uavs or recorder.over():
        return first
    begin = first_plan(problem, WarmState(), most)[0] if _many_new(problem, before) else None
    params = params or (WARM_AND_FRESH if begin else _params(problem, first, recorder.warm))
    run_colonies([TimedColony(problem, first, seed + 7919 * i, params, begin)
                  for i in range(recorder.threads)], recorder)
    recorder.offer(completed(problem, recorder.best))
    return first


def _many_new(problem: TimedProblem, before: WarmState) -> bool:
    """Whether half of the search begins at new routes, not at those of the earlier plan.

    For an early finish the tasks of a lost UAV have to be shared by all others: a search that
    begins with them in the routes of its neighbours does not always come that far.
    """
    goal = problem.base.rules.objective
    if goal.finish == 0.0 or goal.response > 0.0:
        return False
    known = {name for uav in problem.base.uavs for trip in before.trips_of(uav.id)
             for name in trip}
    new = sum(task.id not in known for task in problem.base.tasks)
    return bool(known) and new > MANY_NEW * len(problem.base.tasks)


def _params(problem: TimedProblem, first: Incumbent, warm: bool) -> TimedParams:
    """The parameters of colonies that start from these routes."""
    if warm:
        return WARM
    tasks = problem.base.tasks
    left = sum(task.value for task in tasks) - float(first.score[BEST_WORTH])
    many = left > FEW_ABSENT * sum(task.value for task in tasks)
    return SELECTION if many and not problem.prizes else COLD


def _rank(problem: TimedProblem, found: Plan) -> tuple[float, float]:
    """Smaller is better."""
    return 0.0 if problem.prizes else -found.value, found.cost


def _aboard(uavs: Sequence[Uav], tasks: Sequence[Task], locked: Mapping[str, tuple[Task, ...]],
            before: WarmState) -> dict[str, frozenset[str]]:
    """Ids of the tasks whose payload UAVs in the air have on board, by UAV id."""
    found = {}
    loaded = any(task.payload > 0.0 for task in (*tasks, *chain.from_iterable(locked.values())))
    for uav in uavs:
        if loaded and not uav.at_base:
            names = uav.aboard
            if names is None:
                held = frozenset(task.id for task in locked.get(uav.id, ()))
                names = held | frozenset(before.trips_of(uav.id)[0])
            found[uav.id] = names
    return found


@functools.cache
def load_timed_kernels(zones: bool = False, search: bool = True, paths: bool = False,
                       large: bool = False, few: bool = False) -> None:
    """Load the kernels of problems with time, compile those not on disk yet.

    Args:
        zones: whether to load the kernels that find paths around zones, too.
        search: False: only what a plan of no iterations needs.
        paths: those of problems with tasks that have a path, not of others.
        large: whether to load those that only searches of many tasks need, too.
        few: whether to load those that only searches of few UAVs need, too.
    """
    first = TIMED_FIRST_WORK.plus(TIMED_ZONES_WORK if zones else NO_WORK)
    large, few = large and search and not paths, few and search and not paths
    rest = TIMED_SEARCH_WORK.plus(TIMED_LARGE_WORK if large else NO_WORK).plus(
        TIMED_FEW_WORK if few else NO_WORK)
    with NOTICE.until_loaded(('timed', zones, paths), first, rest, search):
        _call_kernels(zones, search, paths, large, few)


def _call_kernels(zones: bool, search: bool, paths: bool, large: bool, few: bool) -> None:
    """Solve a small problem, so that each kernel is called."""
    uavs = (Uav('u', (0.0, 0.0, 0.0), turnaround=1.0), Uav('v', (9.0, 0.0, 0.0), 30.0))
    tasks = tuple(Task(f't{i}', (float(i), 1.0, 0.0), latest=99.0) for i in range(5))
    tasks += (Task('late', (9e3, 0.0, 0.0), latest=1.0),)
    if paths:
        tasks += (Task('line', (1.0, 2.0, 0.0), path=((1.0, 2.0, 0.0), (4.0, 2.0, 0.0)),
                       reversible=True),)
    limits = Limits((ThreatZone.cylinder('z', (2.5, 1.0), 0.3),) if zones else ())
    problem = make_timed(make_problem(uavs, tasks, {}, limits, Rules(trips=2), near=False), {})
    recorder = TimedRecorder(lambda: 0.0, 0.0, 1.0, max_iterations=100 * search, problem=problem)
    _improve(recorder, 0, WarmState(), None)
    to_timed_plan(problem, recorder, recorder.best, '', False)  # with the reason of the last task
    timed_reasons(problem, [0])
    load_reasons(problem.base)
    if search and not paths:
        best_label(problem.arrays, empty_timed_routes(problem.arrays), 0,
                   empty_labels(len(tasks), 1), 1.0, 1.0)
    if few:
        load_packing(problem.base.arrays)
    if large:
        search_of_many = Intensifier(problem, problem.arrays)
        routes, scratch = empty_timed_routes(problem.arrays), empty_round(problem.arrays)
        search_of_many.improve(routes, scratch, 1.0)
        search_of_many.recombine(recorder.best, routes, 0.0)
