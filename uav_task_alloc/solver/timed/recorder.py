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
from uav_task_alloc.solver.timed.ways import TURN_BIT


@dataclass(slots=True, kw_only=True)
class TimedRecorder(Progress):
    """Receives the best of each colony; thread-safe.

    What is best the objective decides, so the fit in the history may rise.
    """

    problem: TimedProblem
    best: Incumbent = field(init=False)
    locked_sums: tuple[float, float] = field(init=False)  # length [m] and value of locked tasks
    lacking: dict[int, float] = field(init=False)  # see _lacking
    # indices of tasks that the first plan tried beside their neighbours only, and left out
    untried: frozenset[int] = frozenset()

    def __post_init__(self) -> None:
        self.locked_sums, self.lacking = _locked_sums(self.problem), _lacking(self.problem)
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
        score, (length, value) = self.best.score, self.locked_sums
        excess = sum(by for u, by in self.lacking.items() if self._is_used(u))
        return fit(float(score[BEST_METRES]) + length, float(score[BEST_WORTH]) + value,
                   float(score[BEST_EXCESS]) + excess, self.problem.base.rules.weights)

    def _is_used(self, u: int) -> bool:
        """Whether UAV u has a task in the best."""
        base, ends = self.problem.base, self.problem.arrays.ends
        node = int(self.best.order[u] & ~TURN_BIT)
        while node > ends + u and node != u:  # visits of its base
            node = int(self.best.order[node] & ~TURN_BIT)
        return bool(base.locked.get(base.uavs[u].id)) or (node < ends and node != u)

    @staticmethod
    def _copy(source: Incumbent, to: Incumbent) -> None:
        to.order[:], to.score[:] = source.order, source.score


def _locked_sums(problem: TimedProblem) -> tuple[float, float]:
    """Length [m] and value of the locked tasks."""
    base = problem.base
    length = value = 0.0
    for u, uav in enumerate(base.uavs):
        held = base.locked.get(uav.id, ())
        value += sum(task.value for task in held)
        length += sum(task.path_length for task in held)
        length += sum(base.distances.length(i, j) for i, j in base.locked_legs(u))
    return length, value


def _lacking(problem: TimedProblem) -> dict[int, float]:
    """Metres that UAVs lack before their first task that is not locked, by index of those that do.

    For locked tasks and the way home after them, or a wait in the air until they are available.
    The search counts excess beyond that. A UAV without tasks does not fly.
    """
    begin, lacking = problem.arrays.begin, {}
    for u, uav in enumerate(problem.base.uavs):
        home, seconds = float(begin[u, at.EMPTY_LENGTH]), float(begin[u, at.EMPTY_TIME])
        beyond = max(0.0, float(begin[u, at.IN_AIR]) + seconds - uav.endurance)
        by = max(0.0, home - float(problem.base.arrays.range_left[u])) + (
            beyond * uav.cruise_speed if beyond > 0.0 else 0.0)
        if by > 0.0:
            lacking[u] = by
    return lacking
