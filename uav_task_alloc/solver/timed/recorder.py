# SPDX-License-Identifier: Apache-2.0
"""The recorder of problems with time: the best order of nodes, and how its cost fell."""
from __future__ import annotations

from dataclasses import dataclass, field

from uav_task_alloc.solver.recorder import Progress
from uav_task_alloc.solver.timed.problem import TimedProblem
from uav_task_alloc.solver.timed.search import (
    BEST_COST,
    Incumbent,
    empty_incumbent,
    is_improvement,
)


@dataclass(slots=True, kw_only=True)
class TimedRecorder(Progress):
    """Receives the best of each colony; thread-safe. The history is that of the cost."""

    problem: TimedProblem
    best: Incumbent = field(init=False)

    def __post_init__(self) -> None:
        self.best = empty_incumbent(self.problem.arrays)

    def offer(self, found: Incumbent) -> bool:
        """Copy what a colony found if it is better than the best; returns whether it is."""
        with self.lock:
            if self.history and not self._is_better(found, self.best):
                return False
            self._copy(found, self.best)
            self.history.append((self.elapsed(), float(found.score[BEST_COST])))
        return True

    def copy_best_to(self, found: Incumbent) -> None:
        """Overwrite what a colony found with the best, if that is better."""
        with self.lock:
            if self._is_better(self.best, found):
                self._copy(self.best, found)

    def _is_better(self, one: Incumbent, other: Incumbent) -> bool:
        cost, worth = one.score.tolist()
        return bool(is_improvement(cost, worth, other.score, self.problem.prizes))

    @staticmethod
    def _copy(source: Incumbent, to: Incumbent) -> None:
        to.order[:], to.score[:] = source.order, source.score
