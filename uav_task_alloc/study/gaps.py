# SPDX-License-Identifier: Apache-2.0
"""Gaps to the best that is known of each instance, and their table."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

_SAME = 1e-4  # [%] from the best that is but rounding
Means = dict[str, tuple[float | None, int, int]]  # 'solver@budget' -> mean gap [%], of, asked


@dataclass(slots=True)
class InstanceRuns:
    """One instance: what each solver had after each budget."""

    group: str
    collects: bool  # the score is a value, the more the better; else a length
    known: float | None = None  # best published score
    found: dict[str, list[dict[str, Any]]] = field(default_factory=dict)

    def best(self) -> float | None:
        """The best score that anybody has, published ones included."""
        scores = [each['score'] for row in self.found.values() for each in row
                  if each['score'] is not None]
        scores += [self.known] * (self.known is not None)
        return (max if self.collects else min)(scores) if scores else None

    def gaps(self) -> dict[str, float | None]:
        """Percent worse than the best, by 'solver@budget'; None: no answer."""
        return {f'{name}@{each["budget"]:g}': self.gap(each['score'])
                for name, row in self.found.items() for each in row}

    def gap(self, score: float | None) -> float | None:
        """Percent worse than the best."""
        best = self.best()
        if score is None or best is None:
            return None
        if not best:
            return 0.0  # nothing is within reach
        return 100.0 * (1.0 - score / best if self.collects else score / best - 1.0)

    def plain(self) -> dict[str, Any]:
        """For JSON."""
        return {'group': self.group, 'measure': 'value' if self.collects else 'length',
                'known': self.known, 'best': self.best(), 'found': self.found,
                'gap_percent': self.gaps()}


def means(runs: Mapping[str, InstanceRuns], group: str) -> Means:
    """Mean gap of a group by column, over the instances with an answer, and how many those are."""
    rows = [run.gaps() for run in runs.values() if run.group == group]
    made: Means = {}
    for column in dict.fromkeys(name for row in rows for name in row):
        gaps = [row[column] for row in rows if column in row]
        there = [gap for gap in gaps if gap is not None]
        made[column] = (sum(there) / len(there) if there else None, len(there), len(gaps))
    return made


def groups(runs: Mapping[str, InstanceRuns]) -> list[str]:
    """In the order in which they come."""
    return list(dict.fromkeys(run.group for run in runs.values()))


def gap_table(runs: Mapping[str, InstanceRuns]) -> str:
    """Mean gap [%] to the best of each instance by group, and how many were answered.

    The last row: on how many instances the best was reached.
    """
    rows = {group: means(runs, group) for group in groups(runs)}
    columns = list(dict.fromkeys(name for row in rows.values() for name in row))
    lines = [['instances', *columns], ['---'] * (len(columns) + 1)]
    lines += [[group, *(_cell(row.get(column)) for column in columns)]
              for group, row in rows.items()]
    lines.append(['best reached', *(_reached(runs, column) for column in columns)])
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def _reached(runs: Mapping[str, InstanceRuns], column: str) -> str:
    gaps = [run.gaps()[column] for run in runs.values() if column in run.gaps()]
    return f'{sum(gap is not None and gap < _SAME for gap in gaps)}/{len(gaps)}'


def _cell(mean: Sequence[Any] | None) -> str:
    if mean is None:
        return ''
    gap, there, asked = mean
    if gap is None:
        return 'none'
    return f'{gap:.2f}' if there == asked else f'{gap:.2f} ({there}/{asked})'
