# SPDX-License-Identifier: Apache-2.0
"""The recorder: the best routes so far, when they were found, and when to stop looking."""
from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from uav_task_alloc.objective import fit
from uav_task_alloc.solver import routes as of
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import DISTANCE, EXCESS, VALUE, Routes


@dataclass(slots=True)
class Recorder:
    """Solvers offer it routes and ask it whether to go on."""

    problem: Problem
    clock: Callable[[], float]  # [s]
    began: float  # [s] on that clock
    budget: float  # [s]
    max_iterations: int | None = None
    stop: Callable[[], bool] | None = None
    threads: int = 1
    warm: bool = False  # its best is an earlier plan, repaired
    held: tuple[float, float] = (0.0, 0.0)  # length [m] and value of the locked tasks
    on_iteration: Callable[[int, float], None] | None = None  # (iterations so far, best fit)
    iterations: int = 0
    history: list[tuple[float, float]] = field(default_factory=list)
    best: Routes = field(init=False)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __post_init__(self) -> None:
        self.best = of.empty_routes(self.problem.arrays)

    def elapsed(self) -> float:
        """Seconds since the solve began."""
        return self.clock() - self.began

    def spent(self) -> float:
        """Share of the budget that is used up, of iterations where those are limited: 0..1."""
        if self.max_iterations is not None:
            return min(1.0, self.iterations / self.max_iterations) if self.max_iterations else 1.0
        return min(1.0, self.elapsed() / self.budget) if self.budget > 0.0 else 1.0

    def over(self) -> bool:
        """Whether to answer now."""
        if self.stop is not None and self.stop():
            return True
        return self.spent() >= 1.0 or self.elapsed() >= self.budget

    def count(self, iterations: int = 1) -> None:
        """So many rounds of the solver's own loop were made and their finds offered."""
        with self._lock:
            self.iterations += iterations
            if self.on_iteration is not None:
                self.on_iteration(self.iterations, self.history[-1][1] if self.history
                                  else math.inf)

    def offer(self, routes: Routes) -> bool:
        """Keep routes that are better than the best; whether they are."""
        with self._lock:
            if self.history and not of.better_now(self.problem.arrays, routes, self.best):
                return False
            of.copy(routes, self.best)
            self._note()
        return True

    def teach(self, routes: Routes) -> None:
        """Make routes the recorder's best, if that is better."""
        with self._lock:
            if of.better_now(self.problem.arrays, self.best, routes):
                of.copy(self.best, routes)

    def _note(self) -> None:
        """Write down that the best has changed."""
        sums = self.best.sums
        value = float(sums[VALUE]) + self.held[1]
        self.history.append((self.elapsed(), fit(
            float(sums[DISTANCE]) + self.held[0], value, float(sums[EXCESS]),
            self.problem.rules.weights)))
