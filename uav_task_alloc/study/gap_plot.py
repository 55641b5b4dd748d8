# SPDX-License-Identifier: Apache-2.0
"""Gap over CPU time, a panel a group of instances."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from uav_task_alloc.plots import COLOURS
from uav_task_alloc.study.gaps import InstanceRuns, Means, groups, means

_MARKS = 'osD^vP*X'
ACROSS = 4  # panels


def draw_gaps(runs: Mapping[str, InstanceRuns], out: Path) -> None:
    """One line a solver, one mark a budget; hollow where not every instance was answered."""
    names = groups(runs)
    down, across = max(1, math.ceil(len(names) / ACROSS)), max(1, min(ACROSS, len(names)))
    figure = Figure(figsize=(1.0 + 3.2 * across, 1.2 + 2.8 * down), layout='constrained')
    panels = figure.subplots(down, across, squeeze=False).ravel()
    solvers = list(dict.fromkeys(name for run in runs.values() for name in run.found))
    for axes, group in zip(panels, names, strict=False):
        _panel(axes, means(runs, group), solvers)
        axes.set_title(group)
    for axes in panels[len(names):]:
        axes.set_visible(False)
    figure.suptitle('Gap to the best known; hollow: not all instances answered', x=0.01,
                    ha='left', fontweight='bold')
    if solvers:
        figure.legend(*panels[0].get_legend_handles_labels(), loc='outside lower center',
                      ncols=len(solvers), frameon=False)
    figure.savefig(out, dpi=120)


def _panel(axes: Axes, found: Means, solvers: Sequence[str]) -> None:
    for i, name in enumerate(solvers):
        rows = [(float(column.rpartition('@')[2]), gap, there == asked)
                for column, (gap, there, asked) in found.items()
                if column.rpartition('@')[0] == name and gap is not None]
        style: dict[str, Any] = {'color': COLOURS[i % len(COLOURS)], 'ms': 8, 'mew': 1.6}
        mark = _MARKS[i % len(_MARKS)]
        axes.plot([row[0] for row in rows], [row[1] for row in rows], mark + '-', label=name,
                  fillstyle='none', **style)
        for budget, gap, whole in rows:
            if whole:
                axes.plot(budget, gap, mark, **style)
    axes.set(xscale='log', xlabel='CPU time [s]', ylabel='mean gap [%]')
    axes.set_xticks(sorted({float(column.rpartition('@')[2]) for column in found}))
    plain_log(axes.xaxis)
    axes.set_ylim(bottom=0.0)
    axes.grid(color='#e8e8e8', lw=0.7)


def plain_log(axis: Any) -> None:
    """Ticks of a logarithmic axis as plain numbers."""
    axis.set_major_formatter('{x:g}')
    axis.set_minor_formatter(NullFormatter())
