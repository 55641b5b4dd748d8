# SPDX-License-Identifier: Apache-2.0
"""The figures of the study as SVG and PNG, what they show as CSV beside them."""
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

from uav_task_alloc.plots import COLOURS, draw_plan_3d
from uav_task_alloc.plots.plan import way_of
from uav_task_alloc.solver.chain_q import COLD_START
from uav_task_alloc.solver.registry import SOLVERS
from uav_task_alloc.study import experiments as program, tables, trials
from uav_task_alloc.study.campaign import Job
from uav_task_alloc.study.experiments import Experiments
from uav_task_alloc.study.gap_plot import plain_log

_LINES = '-', '--', '-.', ':', (0, (5, 1, 1, 1, 1, 1))  # told apart without colours, too
POINTS = 120  # of a mean curve
WIDE, NARROW = 150, 36  # [letters] lines of settings, below a figure and beside it
_Key = TypeVar('_Key')
Curve = list[tuple[float, float]]  # (iteration or [s], mean fit)


def draw_figures(asked: Experiments, results: Mapping[str, Any], out: Path) -> None:
    """Draw what there are results for."""
    coefficient = _there(program.coefficient_jobs(asked), results)
    convergence = _there(program.convergence_jobs(asked), results)
    allocation = _there(program.allocation_jobs(asked), results)
    with mpl.rc_context({'svg.hashsalt': 'uav_task_alloc'}):  # the same ids each time
        if coefficient:
            _coefficient(asked, coefficient, out / 'figure1_coefficient')
        if convergence:
            _convergence(asked, convergence, out / 'figure2_convergence')
        if allocation:
            _allocation(asked, allocation, out / 'figure3_allocation')


def _there(jobs: Mapping[_Key, Job], results: Mapping[str, Any]) -> dict[_Key, Any]:
    return {key: results[job.name] for key, job in jobs.items() if job.name in results}


def _coefficient(asked: Experiments, found: Mapping[tuple[float, int], Any], out: Path) -> None:
    """Figure 1: fit over generations for each k, and what it comes to."""
    figure = Figure(figsize=(11.0, 5.4), layout='constrained')
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    ks = sorted({k for k, _ in found})
    curves = {k: mean_curve([run for key, run in found.items() if key[0] == k], 0) for k in ks}
    for i, k in enumerate(ks):
        left.plot(*zip(*curves[k], strict=True), color=COLOURS[i], ls=_LINES[i % len(_LINES)],
                  label=f'k = {k:g}')
    left.set(xscale='log', xlabel='generations', ylabel='mean best fit (eq 2.12)')
    left.legend(frameon=False)
    ends = [[run['fit'] for key, run in found.items() if key[0] == k] for k in ks]
    spreads = [stdev(end) if len(end) > 1 else 0.0 for end in ends]
    right.errorbar(ks, [fmean(end) for end in ends], spreads, fmt='o', color=COLOURS[0],
                   capsize=4)
    right.set(xscale='log', xlabel='reward coefficient k',
              ylabel='final fit: mean and standard deviation')
    runs = len({run for _, run in found})
    _finish(figure, out, 'Objective under different reward coefficients k', [
        scene_text(asked), f'paper_chain_q, {runs} runs each, the same seeds for every k',
        settings_text('paper_chain_q', 'k')])
    tables.write_csv(out.with_suffix('.csv'), [{'k': k, 'generation': x, 'mean fit': y}
                                           for k in ks for x, y in curves[k]])


def _convergence(asked: Experiments, found: Mapping[tuple[str, int], Any], out: Path) -> None:
    """Figure 2: mean fit over iterations and over CPU seconds."""
    figure = Figure(figsize=(12.0, 6.4), layout='constrained')
    axes = figure.subplots(1, 2, sharey=True)
    solvers = [name for name in program.LEARNERS if any(key[0] == name for key in found)]
    by = {name: [run for key, run in found.items() if key[0] == name] for name in solvers}
    for column, suffix, unit in ((0, '_iterations', 'iteration'), (1, '_timing', 'CPU [s]')):
        curves = {name: mean_curve(by[name], column) for name in solvers}
        for i, (name, curve) in enumerate(curves.items()):
            axes[column].plot(*zip(*curve, strict=True), color=COLOURS[i], ls=_LINES[i],
                              label=name)
        tables.write_csv(out.with_name(f'figure2{suffix}.csv'), [
            {'solver': name, unit: x, 'mean fit': y} for name in solvers
            for x, y in curves[name]])
    axes[0].set(xscale='log', yscale='log', ylabel='mean best fit (eq 2.12)',
                xlabel='iterations: generations, episodes (q_learning), rounds (chain_q)')
    axes[1].set(xscale='log', xlabel='CPU time [s]')
    axes[1].legend(frameon=False)
    _finish(figure, out, 'Mean convergence', [
        scene_text(asked), f'{min(map(len, by.values()))} runs each; an iteration is not the '
        'same work for each solver, CPU time is', *map(settings_text, solvers)])


def _allocation(asked: Experiments, found: Mapping[str, Any], out: Path) -> None:
    """Figure 3: who flies where, in three dimensions; a picture a solver."""
    instance = trials.instance_of(asked.pictured())
    places = {task.id: task.position for task in instance.tasks}
    for solver, result in found.items():
        made, name = trials.allocation_trial(result), out.with_name(f'{out.name}_{solver}')
        note = '\n'.join(_wrapped([
            f'fit {made.fit:.4g}, {made.penalty:.0f} m beyond range', scene_text(asked),
            settings_text(solver)], NARROW))
        for suffix in ('.svg', '.png'):
            draw_plan_3d(instance.uavs, instance.tasks, instance.zones, made,
                         name.with_suffix(suffix), note)
        tables.write_csv(name.with_suffix('.csv'), [
            {'UAV': uav.id, 'point': n, 'east [m]': x, 'north [m]': y, 'up [m]': z}
            for uav in instance.uavs for n, (x, y, z) in enumerate(way_of(uav, made, places))])


def mean_curve(runs: Sequence[Mapping[str, Any]], column: int) -> Curve:
    """Mean fit of runs over iterations (column 0) or CPU seconds (1), from when all have one."""
    steps = [np.array(run['steps']) for run in runs if run['steps']]
    if not steps:
        return []
    last = max(run['iterations' if column == 0 else 'seconds'] for run in runs)
    first = max(each[0, column] for each in steps)
    grid = np.geomspace(max(first, 1e-6), max(last, first), POINTS)
    if column == 0:
        grid = np.unique(np.round(grid))
    rows = [each[np.searchsorted(each[:, column], grid, side='right') - 1, 2] for each in steps]
    return [(float(x), float(y)) for x, y in zip(grid, np.mean(rows, axis=0), strict=True)]


def scene_text(asked: Experiments) -> str:
    """The settings of the instance behind the figures."""
    uavs, tasks, domes = asked.scene
    return (f'{uavs} UAVs, {tasks} tasks, {domes} domes in 10 x 10 km, seed {asked.seed}; '
            'ranges 1.5 fair shares of a good tour, soft (1 a metre beyond); routes end at '
            'the last task')


def settings_text(solver: str, *but: str) -> str:
    """A solver's settings as a line."""
    made = COLD_START if solver == 'chain_q' else get_args(
        get_type_hints(SOLVERS[solver])['settings'])[0]()
    return f'{solver}: ' + ', '.join(f'{name} {value}' for name, value in asdict(made).items()
                                     if name not in but)


def _wrapped(notes: Iterable[str], width: int) -> list[str]:
    return [line for note in notes for line in textwrap.wrap(note, width)]


def _finish(figure: Figure, out: Path, title: str, notes: Iterable[str]) -> None:
    """Title above, settings below, two files."""
    figure.suptitle(title, fontweight='bold', x=0.01, ha='left')
    figure.supxlabel('\n'.join(_wrapped(notes, WIDE)), fontsize=8, x=0.01, ha='left',
                     color='#444444')
    for axes in figure.axes:
        axes.grid(color='#e8e8e8', lw=0.7)
        for axis in (axes.xaxis, axes.yaxis):
            if axis.get_scale() == 'log':
                plain_log(axis)
    figure.savefig(out.with_suffix('.svg'), metadata={'Date': None})
    figure.savefig(out.with_suffix('.png'), dpi=120)
