# SPDX-License-Identifier: Apache-2.0
"""The benchmark of instances with windows, loads, limited durations, prizes or trips."""
from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.solver.problem import Limits
from uav_task_alloc.solver.registry import SOLVERS
from uav_task_alloc.solver.timed.evaluator import evaluate_routes
from uav_task_alloc.solver.timed.solve import solve_timed
from uav_task_alloc.study.evaluator import TripsByUav
from uav_task_alloc.study.instances import Instance
from uav_task_alloc.study.pyvrp_timed import pyvrp_timed

_TAKING_TIME = 'chain_q', 'pyvrp'


def found(instance: Instance, name: str, budgets: Sequence[float]) -> list[dict[str, Any]]:
    """Run one solver or reference solver on an instance with time.

    Args:
        instance: to solve.
        name: of SOLVERS or REFERENCE_SOLVERS; one that takes no times finds nothing.
        budgets: [s] of CPU time.

    Returns:
        JSON values as in `bench.measure`, one row for each budget.
    """
    if name not in _TAKING_TIME:
        kind = 'solver' if name in SOLVERS else 'reference solver'
        fault = f'{kind} {name} takes no windows, loads or trips'
        return [_row(instance, budget, None) | {'faults': [fault]} for budget in budgets]
    if name in SOLVERS:
        return [_row(instance, budget, _solve(instance, budget)) for budget in budgets]
    try:
        incumbents = pyvrp_timed(instance, max(budgets))
    except InvalidValue as error:
        return [_row(instance, budget, None) | {'faults': [str(error)]} for budget in budgets]
    best = [[trips for when, trips in incumbents if when <= budget] for budget in budgets]
    return [_row(instance, budget, known[-1] if known else None)
            for budget, known in zip(budgets, best, strict=True)]


def _solve(instance: Instance, budget: float) -> TripsByUav:
    result = solve_timed(instance.uavs, instance.tasks, {}, Limits(), instance.rules,
                         budget=budget, clock=time.thread_time)
    return result.trips


def _row(instance: Instance, budget: float, trips: TripsByUav | None) -> dict[str, Any]:
    """`score`: the value where the instance collects, else the cost; None: no valid plan."""
    row: dict[str, Any] = {'budget': budget, 'score': None, 'missing': len(instance.tasks),
                           'faults': []}
    if trips is None:
        return row
    rules = instance.rules
    result = evaluate_routes(instance.uavs, instance.tasks, rules, trips)
    missing = len(instance.tasks) - len(result.timetable.starts)
    complete = not missing or instance.collects or rules.objective.unserved < float('inf')
    if complete and not result.violations:
        row['score'] = result.value if instance.collects else result.cost
    return row | {'length': result.distance, 'value': result.value, 'missing': missing,
                  'finish': result.finish, 'faults': list(result.violations)}
