# SPDX-License-Identifier: Apache-2.0
"""The tables of the study from its results; what depends on the machine stands in its own."""
from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import fmean, median
from typing import Any

from uav_task_alloc.study import experiments as program
from uav_task_alloc.study.experiments import Experiments

ResultRow = dict[str, Any]
_NEAR = 5, 1  # [%] above the best: what "time to" and "success" are told for


def write_csv(path: Path, rows: Sequence[ResultRow]) -> None:
    """A CSV file, numbers to six digits."""
    with path.open('w', newline='') as file:
        out = csv.writer(file, lineterminator='\n')
        out.writerow(rows[0] if rows else [])
        out.writerows([cell_text(value) for value in row.values()] for row in rows)


def markdown(rows: Sequence[ResultRow]) -> str:
    """The same for reading."""
    if not rows:
        return 'no results yet'
    lines = [list(rows[0]), ['---'] * len(rows[0]),
             *([cell_text(value, 4) for value in row.values()] for row in rows)]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def cell_text(value: Any, digits: int = 6) -> str:
    """A cell; nothing where there is no number."""
    if isinstance(value, float):
        return f'{value:.{digits}g}' if math.isfinite(value) else ''
    return str(value)


def sizes(
    asked: Experiments, results: Mapping[str, Any]
) -> tuple[list[ResultRow], list[ResultRow]]:
    """Fit, iterations to 5 and 1 % and success by size and solver; CPU seconds apart from it."""
    jobs = program.size_jobs(asked)
    groups: dict[tuple[int, int, str], list[tuple[Any, float]]] = {}
    for (uavs, tasks, nth, solver), job in jobs.items():
        names = [jobs[key].name for key in jobs if key[:3] == (uavs, tasks, nth)]
        if solver and all(name in results for name in names):
            groups.setdefault((uavs, tasks, solver), []).append(
                (results[job.name], min(results[name]['fit'] for name in names)))
    same, timed = [], []
    for (uavs, tasks, solver), found in groups.items():
        head = {'UAVs': uavs, 'tasks': tasks, 'solver': solver, 'instances': len(found)}
        same.append(head | _quality(found))
        timed.append(head | _timing(found))
    return same, timed


def _quality(found: Sequence[tuple[Any, float]]) -> ResultRow:
    row: ResultRow = {
        'fit': fmean(result['fit'] for result, _ in found),
        'gap [%]': round(fmean(100.0 * (result['fit'] / best - 1.0)
                               for result, best in found), 6),
        'distance [km]': 1e-3 * fmean(result['distance'] for result, _ in found),
        'beyond range [m]': fmean(result['penalty'] for result, _ in found)}
    for percent in _NEAR:
        row[f'within {percent} % [% of instances]'] = 100.0 * fmean(
            when(result, best, percent)[0] < math.inf for result, best in found)
    for percent in _NEAR:
        row[f'iterations to {percent} %'] = _median(
            when(result, best, percent)[0] for result, best in found)
    return row | {'iterations': round(fmean(result['iterations'] for result, _ in found))}


def _timing(found: Sequence[tuple[Any, float]]) -> ResultRow:
    row: ResultRow = {f'to {percent} % [s]': _median(
        when(result, best, percent)[1] for result, best in found) for percent in _NEAR}
    return row | {'in all [s]': fmean(result['seconds'] for result, _ in found)}


def when(result: Mapping[str, Any], best: float, percent: float) -> tuple[float, float]:
    """Iteration and CPU seconds at which a run was so near to the best; inf: never."""
    bound = best * (1.0 + percent / 100.0)
    near = ((step, seconds) for step, seconds, fit in result['steps'] if fit <= bound)
    return next(near, (math.inf, math.inf))


def _median(values: Iterable[float]) -> float:
    """Over all runs; inf where half of them never came there."""
    return float(median(values))


def events_table(
    asked: Experiments, results: Mapping[str, Any]
) -> tuple[list[ResultRow], list[ResultRow]]:
    """Warm against cold by size and kind; CPU seconds apart from it."""
    same, timed = [], []
    for (uavs, tasks, kind), job in program.event_jobs(asked).items():
        rows = results.get(job.name)
        if not rows:
            continue
        head = {'UAVs': uavs, 'tasks': tasks, 'starts': kind, 'events': len(rows)}
        same.append(head | {
            f'{way} gap, {name} [%]': of(row[f'{way}_gap'] for row in rows)
            for way in ('warm', 'cold') for name, of in (('median', median), ('worst', max))} | {
            'warm as good or better [% of events]': 100.0 * fmean(
                row['warm_gap'] <= row['cold_gap'] for row in rows)})
        timed.append(head | {
            f'{way}, {name} [ms]': 1e3 * median(row[f'{way}_{key}'] for row in rows)
            for way in ('warm', 'cold') for name, key in (('first plan', 'first_s'),
                                                          ('whole', 's'))})
    return same, timed
