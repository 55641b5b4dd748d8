# SPDX-License-Identifier: Apache-2.0
"""`plan`: check arguments, build the problem, repair or construct, run a solver, convert."""
from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from uav_task_alloc.errors import InvalidValue, UnknownName
from uav_task_alloc.geometry.detour import find_detour
from uav_task_alloc.kernel_cache import FIRST_WORK, NO_WORK, NOTICE, SEARCH_WORK, ZONES_WORK
from uav_task_alloc.model import Leg, Plan, Task, ThreatZone, Uav
from uav_task_alloc.objective import Objective, Weights, check_objective, needs_time
from uav_task_alloc.separation.rule import Separation
from uav_task_alloc.solver.answer import to_plan
from uav_task_alloc.solver.check import (
    check_locked,
    check_options,
    check_reversed,
    check_separation,
    check_types,
    check_unique,
)
from uav_task_alloc.solver.insertion import place_all
from uav_task_alloc.solver.path_preparation import SEARCH_LIMIT, PathPreparation
from uav_task_alloc.solver.problem import Limits, Problem, Rules, make_problem
from uav_task_alloc.solver.reasons import load_reasons
from uav_task_alloc.solver.recombine import load_recombination
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.registry import SOLVERS
from uav_task_alloc.solver.savings import offer_first
from uav_task_alloc.solver.search import trim_to_range
from uav_task_alloc.solver.separated import separated_plan
from uav_task_alloc.solver.tables import fresh_tables, to_learnt
from uav_task_alloc.solver.timed.solve import solve_timed
from uav_task_alloc.solver.warm import WarmState, repair


def plan(uavs: Iterable[Uav], tasks: Iterable[Task], zones: Iterable[ThreatZone] = (), *,
         budget: float = 0.1, seed: int = 0, solver: str = 'chain_q',
         warm: Plan | WarmState | None = None, route_end: str = 'hold', hard_range: bool = True,
         locked: Mapping[str, Sequence[str]] | None = None, weights: Weights | None = None,
         clearance: float = 0.0, altitude_min: float = -math.inf,
         altitude_max: float = math.inf, threads: int = 1,
         objective: Objective | str = 'distance', trips: int = 1,
         separation: Separation | None = None, reversed: Iterable[str] | None = None,
         stop: Callable[[], bool] | None = None, max_iterations: int | None = None,
         on_iteration: Callable[[int, float], None] | None = None,
         clock: Callable[[], float] = time.perf_counter) -> Plan:
    """Assign tasks to UAVs and order them: the best plan found within the budget.

    Every task that can be served is served; where ranges do not suffice, the most value is, then
    on the shortest routes. The first call in a process loads or compiles the solver's kernels
    before its budget begins. The same seed and `max_iterations` on one thread give the same plan.

    Args:
        uavs: the fleet, ids unique.
        tasks: ids unique.
        zones: threat zones that every leg stays outside of.
        budget: [s] of solving, in [0, 86400].
        seed: of the random numbers.
        solver: a name in SOLVERS.
        warm: an earlier plan, or its state, to start from; the result is not worse.
        route_end: 'hold' at the last task, or 'home'.
        hard_range: False: ranges may be exceeded at the penalty of eq 2.12.
        locked: by UAV id the first tasks of its route, which stay as they are.
        weights: coefficients of eq 2.12; None: those of the paper.
        clearance: [m] kept from zones beyond their margins.
        altitude_min: [m] lowest detour point.
        altitude_max: [m] highest detour point.
        threads: in [1, 64]; only chain_q uses more than one.
        objective: what is minimised: a name in OBJECTIVES or an Objective.
        trips: of a UAV at most; with more than 1 it may visit its base for a new battery and load.
        separation: what keeps the UAVs apart; None, or horizontal 0: nothing does.
        reversed: ids of the locked tasks with a path that are flown from their last point; None:
            those that are in `warm`.
        stop: polled between iterations; True ends the solve with the best plan so far.
        max_iterations: ends the solve as well; None: no limit. Each solver defines its iteration.
        on_iteration: called with (iterations so far, fit of the best) after each or a few
            iterations.
        clock: [s], monotonic.

    Returns:
        Routes, legs, the reasons of unassigned tasks, and the sums of eq 2.12.

    Raises:
        InvalidValue: an argument is out of range, or an id is used twice.
        UnknownName: there is no such solver.
    """
    _check_solver(solver)
    budget = check_options(budget, seed, route_end, threads, max_iterations, trips)
    check_types(hard_range, weights, stop=stop, on_iteration=on_iteration, clock=clock)
    if not isinstance(warm, (Plan, WarmState, type(None))):
        raise InvalidValue('warm', type(warm).__name__, 'a Plan, its state or None')
    fleet, work = check_unique('uav', uavs, Uav), check_unique('task', tasks, Task)
    limits = Limits(check_unique('zone', zones, ThreatZone), clearance, altitude_min,
                    altitude_max)
    rules = Rules(route_end == 'home', hard_range, weights or Weights(),
                  check_objective(objective), trips)
    if needs_time(fleet, work, rules.objective, trips):
        _check_takes_time(solver)
    held = check_locked(locked, fleet, work)
    run = functools.partial(_solve, fleet, limits=limits, rules=rules, solver=solver, seed=seed,
                            threads=threads, stop=stop, max_iterations=max_iterations,
                            on_iteration=on_iteration, clock=clock,
                            reversed=check_reversed(reversed, held, WarmState.of(warm).reversed))
    if separation is None or not check_separation(separation).on:
        return run(work, held, warm=warm, budget=budget)
    return separated_plan(lambda some, start, seconds: run(some, held, warm=start, budget=seconds),
                          fleet, work, held, limits, rules, separation, warm, budget, clock)


def _solve(fleet: Sequence[Uav], work: Sequence[Task], held: Mapping[str, tuple[Task, ...]], *,
           limits: Limits, rules: Rules, solver: str, warm: Plan | WarmState | None,
           budget: float, seed: int, threads: int, stop: Callable[[], bool] | None,
           max_iterations: int | None, on_iteration: Callable[[int, float], None] | None,
           clock: Callable[[], float], reversed: frozenset[str]) -> Plan:
    """Solve without separation; arguments are checked already."""
    if needs_time(fleet, work, rules.objective, rules.trips):
        return solve_timed(fleet, work, held, limits, rules, warm,
                           budget=budget, seed=seed, threads=threads, stop=stop,
                           max_iterations=max_iterations, on_iteration=on_iteration, clock=clock,
                           reversed=reversed)
    load_kernels(solver, bool(limits.zones), max_iterations != 0)
    began, before = clock(), WarmState.of(warm)
    search = PathPreparation(clock, began, budget, stop, before.flown())
    problem = make_problem(fleet, work, held, limits, rules, before.problem, search)
    recorder = Recorder(clock, began, budget, max_iterations, stop, threads, warm is not None,
                        on_iteration, problem=problem, locked_sums=_locked_sums(problem))
    if warm is not None:
        recorder.offer(repair(problem, before.routes))
    elif limits.zones:
        offer_first(recorder)
    search.begin(1.0, SEARCH_LIMIT)
    learnt = SOLVERS[solver](recorder, seed, before.learnt)
    result = to_plan(problem, recorder, solver, warm is not None)
    search.path_budget.check()  # raises what a callback raised within a kernel
    return replace(result, state=WarmState(problem, learnt, result.routes))


def _locked_sums(problem: Problem) -> tuple[float, float]:
    """Length [m] of the locked legs, and value of the locked tasks."""
    length, value = 0.0, 0.0
    for u, uav in enumerate(problem.uavs):
        length += sum(problem.distances.length(i, j) for i, j in problem.locked_legs(u))
        value += sum(task.value for task in problem.locked.get(uav.id, ()))
    return length, value


def _check_solver(solver: str) -> None:
    """Raise UnknownName where there is no such solver."""
    if not isinstance(solver, str) or solver not in SOLVERS:
        raise UnknownName('solver', solver, list(SOLVERS))


def _check_takes_time(solver: str) -> None:
    """Raise InvalidValue where a solver does not take windows, loads, trips or objectives."""
    if solver != 'chain_q':
        raise InvalidValue('solver', solver, "'chain_q' where latest times, loads, paths, "
                           'endurances, availabilities, trips or an objective other than '
                           'distance are given')


@functools.cache
def load_kernels(solver: str = 'chain_q', zones: bool = False, search: bool = True) -> None:
    """Load a solver's kernels, compile those not on disk yet; further calls do nothing.

    Args:
        solver: a name in SOLVERS.
        zones: whether to load the kernels that find paths around zones, too.
        search: False: only what a plan of no iterations needs; chain_q alone has less to load.

    Raises:
        UnknownName: there is no such solver.
    """
    _check_solver(solver)
    search = search or solver != 'chain_q'
    first = FIRST_WORK.plus(ZONES_WORK if zones else NO_WORK)
    with NOTICE.until_loaded(('chain_q', zones), first, SEARCH_WORK, search):
        _call_kernels(solver, zones, search)


def _call_kernels(solver: str, zones: bool, search: bool) -> None:
    """Solve a small world, so that each kernel is called."""
    uavs = (Uav('u', (0.0, 0.0, 0.0)), Uav('v', (9.0, 0.0, 0.0), 30.0), Uav('w', (0.0, 0.0, 0.0)))
    tasks = tuple(Task(f't{i}', (float(i), 1.0, 0.0)) for i in range(5))
    between = (*(ThreatZone.cylinder(f'z{x}', (x, 1.0), 0.3) for x in (1.5, 2.5, 4.0)),
               ThreatZone.hemisphere('dome', (3.5, 1.5, 0.0), 0.3),
               ThreatZone.polygon('prism', ((0.4, 0.9), (0.6, 0.9), (0.5, 1.1)))) if zones else ()
    paths = PathPreparation(lambda: 0.0, 0.0, 1.0, flown={'u': (('t0',), (Leg((), 0.0),))})
    problem = make_problem(uavs, tasks, {}, Limits(between), Rules(returns=True), None, paths)
    rounds = 800 if solver == 'chain_q' else 64  # until each kind of bee has had a flight
    rounds *= search
    recorder = Recorder(lambda: 0.0, 0.0, 1.0, max_iterations=rounds, problem=problem)
    SOLVERS[solver](recorder, 0, None)
    to_plan(problem, recorder, '', False)
    load_reasons(problem)
    place_all(problem.arrays, recorder.best, np.empty(0, np.int64))  # these two are only called
    if rounds:
        trim_to_range(problem.arrays, recorder.best)  # where ranges do not suffice
        load_recombination(problem.arrays, recorder.best)
        fresh_tables(problem, to_learnt(problem, fresh_tables(problem)))
    if zones:
        problem.distances.offer_path(0, len(uavs), ())
        find_detour(tasks[1].position, uavs[1].position, between, budget=paths.path_budget)
