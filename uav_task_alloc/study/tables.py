# SPDX-License-Identifier: Apache-2.0
"""The tables of the study from its results; machine-dependent times are in tables of their own."""
from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import fmean, median
from typing import Any

from uav_task_alloc.atomic_files import replacing
from uav_task_alloc.study import experiments
from uav_task_alloc.study.experiments import Experiments

ResultRow = dict[str, Any]  # cells by column
TablePair = tuple[list[ResultRow], list[ResultRow]]  # the same on each machine, and CPU seconds
_PERCENTS = 5, 1  # above the best: the targets of the columns "within" and "iterations to"


def write_csv(path: Path, rows: Sequence[ResultRow]) -> None:
    """Write a CSV file with a header line, numbers to six digits.

    Args:
        path: of the file.
        rows: values by column; all with the same columns.

    Raises:
        OSError: the file cannot be written.
    """
    with replacing(path) as file, file.open('w', newline='') as stream:
        out = csv.writer(stream, lineterminator='\n')
        out.writerow(rows[0] if rows else [])
        out.writerows([cell_text(value) for value in row.values()] for row in rows)


def markdown(rows: Sequence[ResultRow]) -> str:
    """Return rows as a Markdown table, numbers to four digits.

    Args:
        rows: values by column; all with the same columns.

    Returns:
        `no results yet` for no rows.
    """
    if not rows:
        return 'no results yet'
    return markdown_rows(list(rows[0]), [[cell_text(value, 4) for value in row.values()]
                                         for row in rows])


def markdown_rows(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table of texts."""
    return '\n'.join(f'| {" | ".join(row)} |' for row in (head, ['---'] * len(head), *rows))


def cell_text(value: Any, digits: int = 6) -> str:
    """The text of a cell; empty for NaN and the infinities."""
    if isinstance(value, float):
        return f'{value:.{digits}g}' if math.isfinite(value) else ''
    return str(value)


def sizes_table(settings: Experiments, results: Mapping[str, Any]) -> TablePair:
    """Return fit, iterations to 5 and 1 % and success, by size and solver.

    Args:
        settings: of the study.
        results: by job name; an instance counts once all its jobs have one.

    Returns:
        Rows of quality, and rows of times, which depend on the machine.
    """
    jobs = experiments.size_jobs(settings)
    groups: dict[tuple[int, int, str], list[tuple[Any, float]]] = {}  # (result, best fit)
    for (uavs, tasks, instance, solver), job in jobs.items():
        names = [jobs[key].name for key in jobs if key[:3] == (uavs, tasks, instance)]
        if solver and all(name in results for name in names):
            groups.setdefault((uavs, tasks, solver), []).append(
                (results[job.name], min(results[name]['fit'] for name in names)))
    quality, timing = [], []
    for (uavs, tasks, solver), runs in groups.items():
        head = {'UAVs': uavs, 'tasks': tasks, 'solver': solver, 'instances': len(runs)}
        quality.append(head | _quality(runs))
        timing.append(head | _timing(runs))
    return quality, timing


def _quality(runs: Sequence[tuple[Any, float]]) -> ResultRow:
    row: ResultRow = {
        'fit': fmean(result['fit'] for result, _ in runs),
        'gap [%]': round(fmean(100.0 * (result['fit'] / best - 1.0)
                               for result, best in runs), 6),
        'distance [km]': 1e-3 * fmean(result['distance'] for result, _ in runs),
        'beyond range [m]': fmean(result['penalty'] for result, _ in runs)}
    for percent in _PERCENTS:
        row[f'within {percent} % [% of instances]'] = 100.0 * fmean(
            time_to_target(result, best, percent)[0] < math.inf for result, best in runs)
    for percent in _PERCENTS:
        row[f'iterations to {percent} %'] = _median(
            time_to_target(result, best, percent)[0] for result, best in runs)
    return row | {'iterations': round(fmean(result['iterations'] for result, _ in runs))}


def _timing(runs: Sequence[tuple[Any, float]]) -> ResultRow:
    row: ResultRow = {f'to {percent} % [s]': _median(
        time_to_target(result, best, percent)[1] for result, best in runs)
        for percent in _PERCENTS}
    return row | {'in all [s]': fmean(result['seconds'] for result, _ in runs)}


def time_to_target(result: Mapping[str, Any], best: float,
                   percent: float) -> tuple[float, float]:
    """Iteration and CPU seconds at which a run first was within `percent` of the best fit.

    Both are inf where it never was.
    """
    target = best * (1.0 + percent / 100.0)
    reached = ((step, seconds) for step, seconds, fit in result['steps'] if fit <= target)
    return next(reached, (math.inf, math.inf))


def _median(values: Iterable[float]) -> float:
    """Over all runs; inf where half of them never reached the target."""
    return float(median(values))


def events_table(settings: Experiments, results: Mapping[str, Any]) -> TablePair:
    """Compare warm with cold starts by size and kind of instance.

    Args:
        settings: of the study.
        results: by job name; those still missing are skipped.

    Returns:
        Rows of quality, and rows of times, which depend on the machine.
    """
    quality, timing = [], []
    for (uavs, tasks, kind), job in experiments.event_jobs(settings).items():
        rows = results.get(job.name)
        if not rows:
            continue
        head = {'UAVs': uavs, 'tasks': tasks, 'starts': kind, 'events': len(rows)}
        quality.append(head | {
            f'{start} gap, {name} [%]': aggregate(row[f'{start}_gap'] for row in rows)
            for start in ('warm', 'cold')
            for name, aggregate in (('median', median), ('worst', max))} | {
            'warm as good or better [% of events]': 100.0 * fmean(
                row['warm_gap'] <= row['cold_gap'] for row in rows)})
        timing.append(head | {
            f'{start}, {name} [ms]': 1e3 * median(row[f'{start}_{key}'] for row in rows)
            for start in ('warm', 'cold') for name, key in (('first plan', 'first_s'),
                                                            ('whole', 's'))})
    return quality, timing
