# SPDX-License-Identifier: Apache-2.0
"""Gaps to the best known score of each instance, and their table."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from uav_task_alloc.study.tables import markdown_rows

_TOLERANCE = 1e-4  # [%] gap that counts as none: rounding


@dataclass(frozen=True, slots=True)
class MeanGap:
    """The mean gap of a solver with one budget over a group of instances."""

    gap: float | None  # [%] over the instances solved; None: none was
    solved: int  # instances with a valid plan
    instances: int


MeanGaps = dict[str, MeanGap]  # by column: 'solver@budget'


@dataclass(slots=True)
class InstanceRuns:
    """The results of all solvers and budgets on one instance."""

    group: str
    collects: bool  # the score is a value, more is better; else a length, less is better
    known: float | None = None  # best published score
    missing_gap: float | None = None  # [%] of a run without a valid plan; None: it does not count
    found: dict[str, list[dict[str, Any]]] = field(default_factory=dict)  # by solver: see measure

    def best(self) -> float | None:
        """The best score of all runs and of `known`; None where there is none."""
        scores = [row['score'] for rows in self.found.values() for row in rows
                  if row['score'] is not None]
        scores += [self.known] * (self.known is not None)
        return (max if self.collects else min)(scores) if scores else None

    def gaps(self) -> dict[str, float | None]:
        """[%] worse than the best, by 'solver@budget'; None: no valid plan."""
        return {f'{name}@{row["budget"]:g}': self.gap(row['score'])
                for name, rows in self.found.items() for row in rows}

    def gap(self, score: float | None) -> float | None:
        """[%] by which a score is worse than the best; None: no valid plan."""
        best = self.best()
        if score is None:
            return self.missing_gap
        if best is None:
            return None
        if not best:
            return 0.0  # no task is within range
        return 100.0 * (1.0 - score / best if self.collects else score / best - 1.0)

    def plain(self) -> dict[str, Any]:
        """The runs and their gaps as JSON values."""
        return {'group': self.group, 'measure': 'value' if self.collects else 'length',
                'known': self.known, 'best': self.best(), 'found': self.found,
                'gap_percent': self.gaps()}


def mean_gaps(runs: Mapping[str, InstanceRuns], group: str) -> MeanGaps:
    """Mean gaps of one group of instances, by column."""
    rows = [run.gaps() for run in runs.values() if run.group == group]
    means: MeanGaps = {}
    for column in dict.fromkeys(name for row in rows for name in row):
        gaps = [row[column] for row in rows if column in row]
        solved = [gap for gap in gaps if gap is not None]
        means[column] = MeanGap(sum(solved) / len(solved) if solved else None, len(solved),
                                len(gaps))
    return means


def groups(runs: Mapping[str, InstanceRuns]) -> list[str]:
    """The groups of the instances, in order of appearance."""
    return list(dict.fromkeys(run.group for run in runs.values()))


def gap_table(runs: Mapping[str, InstanceRuns]) -> str:
    """Return mean gaps [%] as a Markdown table, a row for each group of instances.

    `1.50 (3/5)`: 3 of 5 instances were solved. The last row: on how many
    instances the best score was reached.

    Args:
        runs: by instance name.

    Returns:
        A column for each solver and budget.
    """
    rows = {group: mean_gaps(runs, group) for group in groups(runs)}
    columns = list(dict.fromkeys(name for row in rows.values() for name in row))
    return markdown_rows(
        ['instances', *columns],
        [*([group, *(_gap_cell(row.get(column)) for column in columns)]
           for group, row in rows.items()),
         ['best reached', *(_best_reached(runs, column) for column in columns)]])


def _best_reached(runs: Mapping[str, InstanceRuns], column: str) -> str:
    gaps = [run.gaps()[column] for run in runs.values() if column in run.gaps()]
    return f'{sum(gap is not None and gap < _TOLERANCE for gap in gaps)}/{len(gaps)}'


def _gap_cell(mean: MeanGap | None) -> str:
    if mean is None:
        return ''
    if mean.gap is None:
        return 'none'
    solved = '' if mean.solved == mean.instances else f' ({mean.solved}/{mean.instances})'
    return f'{mean.gap:.2f}{solved}'
