# SPDX-License-Identifier: Apache-2.0
"""The benchmark: one solver on one instance, checked by the one evaluator for all solvers."""
from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.solver.registry import SOLVERS
from uav_task_alloc.solver.solve import plan
from uav_task_alloc.study import public, reference_solvers, timed_bench
from uav_task_alloc.study.campaign import Job
from uav_task_alloc.study.evaluator import RoutesByUav, evaluate
from uav_task_alloc.study.gaps import InstanceRuns
from uav_task_alloc.study.instances import Instance, make_instance

Source = dict[str, Any]  # arguments of make_instance, or of public.parse_instance


def random_sources(kinds: Sequence[str], sizes: Sequence[str], seeds: Sequence[int],
                   slack: float) -> dict[str, Source]:
    """Return the sources of random instances.

    Args:
        kinds: 'spread' (starts anywhere) or 'base' (one start).
        sizes: UAVs x tasks, as '4x20'.
        seeds: one instance each, for each kind and size.
        slack: ranges over a fair share of a good tour.

    Returns:
        Arguments of `make_instance` by instance name.
    """
    sources = {}
    for kind, size, seed in product(kinds, sizes, seeds):
        uavs, tasks = (int(number) for number in size.split('x'))
        source: Source = {'uavs': uavs, 'tasks': tasks, 'seed': seed, 'one_base': kind == 'base',
                          'slack': slack}
        sources[make_instance(**source).name] = source
    return sources


def public_sources(folder: Path, pattern: str) -> tuple[dict[str, Source], dict[str, str]]:
    """The sources of the public instances of a folder.

    Args:
        folder: holds instance files, and the best known values where there are any.
        pattern: glob of file names.

    Returns:
        The sources, and the reasons why other files are skipped; both by file name.

    Raises:
        InvalidValue: the folder holds no such instance.
    """
    texts, skipped = public.read_folder(folder, pattern)
    if not texts:
        raise InvalidValue('--folder', str(folder), f'instances named {pattern}')
    return public.instance_sources(folder, texts), skipped


def measure(source: Mapping[str, Any], name: str, budgets: Sequence[float]) -> dict[str, Any]:
    """Run one solver or reference solver on one instance.

    A solver of this package solves from scratch for each budget. A reference solver runs once,
    for the longest budget; its best routes at each budget count.

    Args:
        source: of the instance.
        name: of SOLVERS or REFERENCE_SOLVERS.
        budgets: [s] of CPU time.

    Returns:
        JSON values: `group` of the instance, whether it `collects` value, its best `known` score
        or None, and `found`, one row for each budget.
    """
    is_public = 'text' in source
    instance = public.parse_instance(**source) if is_public else make_instance(**source)
    group = source['name'].split('.')[0].split('_')[0] if is_public else (
        instance.name.rpartition('-')[0])
    found: list[dict[str, Any]]
    if instance.has_time:
        found = timed_bench.found(instance, name, budgets)
    else:
        routes: list[RoutesByUav | None]
        if name in SOLVERS:
            routes = [_solve(instance, name, budget) for budget in budgets]
        else:
            incumbents = reference_solvers.REFERENCE_SOLVERS[name](instance, max(budgets))
            routes = [reference_solvers.best_at(incumbents, budget) for budget in budgets]
        found = [{'budget': budget} | _scored(instance, row)
                 for budget, row in zip(budgets, routes, strict=True)]
    return {'group': instance.group or group, 'collects': instance.collects,
            'has_time': instance.has_time,
            'known': instance.known if math.isfinite(instance.known) else None, 'found': found}


def _solve(instance: Instance, solver: str, budget: float) -> RoutesByUav:
    result = plan(instance.uavs, instance.tasks, solver=solver, budget=budget,
                  route_end=instance.route_end, clock=time.thread_time)
    return result.routes


def _scored(instance: Instance, routes: RoutesByUav | None) -> dict[str, Any]:
    """`score`: the value where the instance collects, else the length [m]; None: no valid plan."""
    if routes is None:
        return {'score': None, 'missing': len(instance.tasks), 'faults': []}
    result = evaluate(instance, routes)
    score = result.value if instance.collects else result.length
    return {'score': score if result.is_valid(instance.collects) else None,
            'length': result.length, 'value': result.value, 'missing': result.missing,
            'faults': list(result.faults)}


def instance_runs(jobs: Mapping[tuple[str, str], Job],
                  results: Mapping[str, Any]) -> dict[str, InstanceRuns]:
    """Group the results of `measure` by instance.

    Args:
        jobs: by (instance name, solver).
        results: by job name; those still missing are skipped.

    Returns:
        By instance name.
    """
    runs: dict[str, InstanceRuns] = {}
    for (key, solver), job in jobs.items():
        result = results.get(job.name)
        if result is not None:
            run = runs.setdefault(
                key, InstanceRuns(result['group'], result['collects'], result['known'],
                                  100.0 if result['has_time'] else None))
            run.found[solver] = result['found']
    return runs


def faults(runs: Mapping[str, InstanceRuns]) -> Iterator[str]:
    """Describe the faults of plans, which therefore do not count.

    Args:
        runs: by instance name.

    Returns:
        A line for each fault.
    """
    for key, run in runs.items():
        for solver, rows in run.found.items():
            for row in rows:
                for fault in row['faults']:
                    yield f'{key}, {solver} in {row["budget"]:g} s, not counted: {fault}'
