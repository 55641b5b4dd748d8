# SPDX-License-Identifier: Apache-2.0
"""The figures of the study as SVG and PNG, and their data as CSV."""
from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, TypeVar, get_args, get_type_hints

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from uav_task_alloc.atomic_files import replacing
from uav_task_alloc.model.route_stops import route_points
from uav_task_alloc.plots import draw_plan_3d, uav_colour
from uav_task_alloc.solver.chain_q import COLD_START
from uav_task_alloc.solver.registry import SOLVERS
from uav_task_alloc.study import experiments, tables, trials
from uav_task_alloc.study.campaign import Job
from uav_task_alloc.study.experiments import Experiments
from uav_task_alloc.study.gap_plot import plain_log

_LINE_STYLES = '-', '--', '-.', ':', (0, (5, 1, 1, 1, 1, 1))  # distinct without colour
_CURVE_POINTS = 120
_WIDTH_BELOW, _WIDTH_BESIDE = 150, 36  # [characters] of the settings below and beside a figure
_Key = TypeVar('_Key')
Curve = list[tuple[float, float]]  # (iteration or [s], mean fit)


def draw_figures(settings: Experiments, results: Mapping[str, Any], out: Path) -> None:
    """Draw the figures that have results.

    Args:
        settings: of the study.
        results: by job name.
        out: folder that exists.

    Raises:
        OSError: a file cannot be written.
    """
    coefficient = _results_of(experiments.coefficient_jobs(settings), results)
    convergence = _results_of(experiments.convergence_jobs(settings), results)
    allocation = _results_of(experiments.allocation_jobs(settings), results)
    with mpl.rc_context({'svg.hashsalt': 'uav_task_alloc'}):  # reproducible ids
        if coefficient:
            _coefficient(settings, coefficient, out / 'figure1_coefficient')
        if convergence:
            _convergence(settings, convergence, out / 'figure2_convergence')
        if allocation:
            _allocation(settings, allocation, out / 'figure3_allocation')


def _results_of(jobs: Mapping[_Key, Job], results: Mapping[str, Any]) -> dict[_Key, Any]:
    return {key: results[job.name] for key, job in jobs.items() if job.name in results}


def _coefficient(settings: Experiments, results: Mapping[tuple[float, int], Any],
                 out: Path) -> None:
    """Figure 1: fit over generations for each k, and the final fit over k."""
    figure = Figure(figsize=(11.0, 5.4), layout='constrained')
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    ks = sorted({k for k, _ in results})
    curves = {k: mean_curve([run for key, run in results.items() if key[0] == k], 0) for k in ks}
    for i, k in enumerate(ks):
        left.plot(*zip(*curves[k], strict=True), color=uav_colour(i), label=f'k = {k:g}',
                  ls=_LINE_STYLES[i % len(_LINE_STYLES)])
    left.set(xscale='log', xlabel='generations', ylabel='mean best fit (eq 2.12)')
    left.legend(frameon=False)
    ends = [[run['fit'] for key, run in results.items() if key[0] == k] for k in ks]
    spreads = [stdev(end) if len(end) > 1 else 0.0 for end in ends]
    right.errorbar(ks, [fmean(end) for end in ends], spreads, fmt='o', color=uav_colour(0),
                   capsize=4)
    right.set(xscale='log', xlabel='reward coefficient k',
              ylabel='final fit: mean and standard deviation')
    runs = len({run for _, run in results})
    _finish(figure, out, 'Objective under different reward coefficients k', [
        scene_text(settings), f'paper_chain_q, {runs} runs each, the same seeds for every k',
        settings_text('paper_chain_q', 'k')])
    tables.write_csv(out.with_suffix('.csv'), [{'k': k, 'generation': x, 'mean fit': y}
                                           for k in ks for x, y in curves[k]])


def _convergence(settings: Experiments, results: Mapping[tuple[str, int], Any], out: Path) -> None:
    """Figure 2: mean fit over iterations and over CPU seconds."""
    figure = Figure(figsize=(12.0, 6.4), layout='constrained')
    axes = figure.subplots(1, 2, sharey=True)
    solvers = [name for name in experiments.ITERATIVE if any(key[0] == name for key in results)]
    runs = {name: [run for key, run in results.items() if key[0] == name] for name in solvers}
    for column, suffix, unit in ((0, '_iterations', 'iteration'), (1, '_timing', 'CPU [s]')):
        curves = {name: mean_curve(runs[name], column) for name in solvers}
        for i, (name, curve) in enumerate(curves.items()):
            axes[column].plot(*zip(*curve, strict=True), color=uav_colour(i), ls=_LINE_STYLES[i],
                              label=name)
        tables.write_csv(out.with_name(f'figure2{suffix}.csv'), [
            {'solver': name, unit: x, 'mean fit': y} for name in solvers
            for x, y in curves[name]])
    axes[0].set(xscale='log', yscale='log', ylabel='mean best fit (eq 2.12)',
                xlabel='iterations: generations, episodes (q_learning), rounds (chain_q)')
    axes[1].set(xscale='log', xlabel='CPU time [s]')
    axes[1].legend(frameon=False)
    _finish(figure, out, 'Mean convergence', [
        scene_text(settings), f'{min(map(len, runs.values()))} runs each; an iteration is not the '
        'same work for each solver, CPU time is', *map(settings_text, solvers)])


def _allocation(settings: Experiments, results: Mapping[str, Any], out: Path) -> None:
    """Figure 3: the routes in three dimensions, a figure for each solver."""
    instance = trials.instance_of(settings.figure_scene())
    known = {task.id: task for task in instance.tasks}
    for solver, result in results.items():
        plan, name = trials.plan_from_result(result), out.with_name(f'{out.name}_{solver}')
        note = '\n'.join(_wrapped([
            f'fit {plan.fit:.4g}, {plan.penalty:.0f} m beyond range', scene_text(settings),
            settings_text(solver)], _WIDTH_BESIDE))
        for suffix in ('.svg', '.png'):
            draw_plan_3d(instance.uavs, instance.tasks, instance.zones, plan,
                         name.with_suffix(suffix), note)
        tables.write_csv(name.with_suffix('.csv'), [
            {'UAV': uav.id, 'point': n, 'east [m]': x, 'north [m]': y, 'up [m]': z}
            for uav in instance.uavs
            for n, (x, y, z) in enumerate(route_points(uav, plan, known))])


def mean_curve(runs: Sequence[Mapping[str, Any]], column: int) -> Curve:
    """Mean fit over iterations or CPU seconds, from where all runs have a plan.

    Args:
        runs: results of trials.converge.
        column: 0: iterations; 1: CPU seconds.
    """
    steps = [np.array(run['steps']) for run in runs if run['steps']]
    if not steps:
        return []
    last = max(run['iterations' if column == 0 else 'seconds'] for run in runs)
    first = max(each[0, column] for each in steps)
    grid = np.geomspace(max(first, 1e-6), max(last, first), _CURVE_POINTS)
    if column == 0:
        grid = np.unique(np.round(grid))
    rows = [each[np.searchsorted(each[:, column], grid, side='right') - 1, 2] for each in steps]
    return [(float(x), float(y)) for x, y in zip(grid, np.mean(rows, axis=0), strict=True)]


def scene_text(settings: Experiments) -> str:
    """The settings of the figures' instance as text."""
    uavs, tasks, domes = settings.scene
    return (f'{uavs} UAVs, {tasks} tasks, {domes} domes in 10 x 10 km, seed {settings.seed}; '
            'ranges 1.5 fair shares of a good tour, soft (1 per metre beyond); routes end at '
            'the last task')


def settings_text(solver: str, *omitted: str) -> str:
    """The settings of a solver as a line, but those `omitted`."""
    params = COLD_START if solver == 'chain_q' else get_args(
        get_type_hints(SOLVERS[solver])['settings'])[0]()
    return f'{solver}: ' + ', '.join(f'{name} {value}' for name, value in asdict(params).items()
                                     if name not in omitted)


def _wrapped(notes: Iterable[str], width: int) -> list[str]:
    return [line for note in notes for line in textwrap.wrap(note, width)]


def _finish(figure: Figure, out: Path, title: str, notes: Iterable[str]) -> None:
    """Add title and settings, save as SVG and PNG."""
    figure.suptitle(title, fontweight='bold', x=0.01, ha='left')
    figure.supxlabel('\n'.join(_wrapped(notes, _WIDTH_BELOW)), fontsize=8, x=0.01, ha='left',
                     color='#444444')
    for axes in figure.axes:
        axes.grid(color='#e8e8e8', lw=0.7)
        for axis in (axes.xaxis, axes.yaxis):
            if axis.get_scale() == 'log':
                plain_log(axis)
    for suffix, options in (('.svg', {'metadata': {'Date': None}}), ('.png', {'dpi': 120})):
        with replacing(out.with_suffix(suffix)) as file:
            figure.savefig(file, **options)
