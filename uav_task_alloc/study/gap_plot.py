# SPDX-License-Identifier: Apache-2.0
"""Plot of the mean gap over CPU time, a panel for each group of instances."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from uav_task_alloc.plots import uav_colour
from uav_task_alloc.study.gaps import InstanceRuns, MeanGaps, groups, mean_gaps

_MARKERS = 'osD^vP*X'
_COLUMNS = 4  # panels side by side


def draw_gaps(runs: Mapping[str, InstanceRuns], out: Path) -> None:
    """Draw a line for each solver with a marker for each budget.

    A marker is hollow where not every instance was solved.

    Args:
        runs: by instance name.
        out: the file; its suffix selects the format.

    Raises:
        OSError: the file cannot be written.
    """
    names = groups(runs)
    rows = max(1, math.ceil(len(names) / _COLUMNS))
    columns = max(1, min(_COLUMNS, len(names)))
    figure = Figure(figsize=(1.0 + 3.2 * columns, 1.2 + 2.8 * rows), layout='constrained')
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    solvers = list(dict.fromkeys(name for run in runs.values() for name in run.found))
    for axes, group in zip(panels, names, strict=False):
        _draw_panel(axes, mean_gaps(runs, group), solvers)
        axes.set_title(group)
    for axes in panels[len(names):]:
        axes.set_visible(False)
    figure.suptitle('Gap to the best known; hollow: not all instances solved', x=0.01,
                    ha='left', fontweight='bold')
    if solvers:
        figure.legend(*panels[0].get_legend_handles_labels(), loc='outside lower center',
                      ncols=len(solvers), frameon=False)
    figure.savefig(out, dpi=120)


def _draw_panel(axes: Axes, means: MeanGaps, solvers: Sequence[str]) -> None:
    for i, name in enumerate(solvers):
        points = [(_budget(column), mean.gap, mean.solved == mean.instances)
                  for column, mean in means.items()
                  if column.rpartition('@')[0] == name and mean.gap is not None]
        style: dict[str, Any] = {'color': uav_colour(i), 'ms': 8, 'mew': 1.6}
        marker = _MARKERS[i % len(_MARKERS)]
        axes.plot([point[0] for point in points], [point[1] for point in points], marker + '-',
                  label=name, fillstyle='none', **style)
        for budget, gap, all_solved in points:
            if all_solved:
                axes.plot(budget, gap, marker, **style)
    axes.set(xscale='log', xlabel='CPU time [s]', ylabel='mean gap [%]')
    axes.set_xticks(sorted({_budget(column) for column in means}))
    plain_log(axes.xaxis)
    axes.set_ylim(bottom=0.0)
    axes.grid(color='#e8e8e8', lw=0.7)


def _budget(column: str) -> float:
    """[s] of a column 'solver@budget'."""
    return float(column.rpartition('@')[2])


def plain_log(axis: Any) -> None:
    """Label the ticks of a logarithmic axis with plain numbers."""
    axis.set_major_formatter('{x:g}')
    axis.set_minor_formatter(NullFormatter())
