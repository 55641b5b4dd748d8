# SPDX-License-Identifier: Apache-2.0
"""The recorder of problems with time: the best order of nodes, and the history of its fit."""
from __future__ import annotations

from dataclasses import dataclass, field

from uav_task_alloc.objective import fit
from uav_task_alloc.solver.recorder import Progress
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.problem import TimedProblem
from uav_task_alloc.solver.timed.search import (
    BEST_EXCESS,
    BEST_METRES,
    BEST_WORTH,
    Incumbent,
    empty_incumbent,
    is_improvement,
)


@dataclass(slots=True, kw_only=True)
class TimedRecorder(Progress):
    """Receives the best of each colony; thread-safe.

    What is best the objective decides, so the fit in the history may rise.
    """

    problem: TimedProblem
    best: Incumbent = field(init=False)
    locked_sums: tuple[float, float, float] = field(init=False)  # as those of _locked_sums
    # indices of tasks that the first plan tried beside their neighbours only, and left out
    untried: frozenset[int] = frozenset()

    def __post_init__(self) -> None:
        self.locked_sums = _locked_sums(self.problem)
        self.best = empty_incumbent(self.problem.arrays)

    def offer(self, found: Incumbent) -> bool:
        """Copy what a colony found if it is better than the best; returns whether it is."""
        with self.lock:
            if self.history and not self._is_better(found, self.best):
                return False
            self._copy(found, self.best)
            self.history.append((self.elapsed(), self._fit()))
        return True

    def copy_best_to(self, found: Incumbent) -> None:
        """Overwrite what a colony found with the best, if that is better."""
        with self.lock:
            if self._is_better(self.best, found):
                self._copy(self.best, found)

    def _is_better(self, one: Incumbent, other: Incumbent) -> bool:
        cost, worth, *_ = one.score.tolist()
        return bool(is_improvement(cost, worth, other.score, self.problem.prizes))

    def _fit(self) -> float:
        """Eq 2.12 of the best, with the locked tasks."""
        score, (length, value, excess) = self.best.score, self.locked_sums
        return fit(float(score[BEST_METRES]) + length, float(score[BEST_WORTH]) + value,
                   float(score[BEST_EXCESS]) + excess, self.problem.base.rules.weights)

    @staticmethod
    def _copy(source: Incumbent, to: Incumbent) -> None:
        to.order[:], to.score[:] = source.order, source.score


def _locked_sums(problem: TimedProblem) -> tuple[float, float, float]:
    """Length [m] and value of the locked tasks, and metres by which they exceed what UAVs have."""
    base, begin = problem.base, problem.arrays.begin
    length = value = excess = 0.0
    for u, uav in enumerate(base.uavs):
        held = base.locked.get(uav.id, ())
        value += sum(task.value for task in held)
        length += sum(task.path_length for task in held)
        length += sum(base.distances.length(i, j) for i, j in base.locked_legs(u))
        home, seconds = float(begin[u, at.EMPTY_LENGTH]), float(begin[u, at.EMPTY_TIME])
        excess += max(0.0, home - float(base.arrays.range_left[u]))
        excess += max(0.0, float(begin[u, at.IN_AIR]) + seconds - uav.endurance) * uav.cruise_speed
    return length, value, excess
