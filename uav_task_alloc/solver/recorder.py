# SPDX-License-Identifier: Apache-2.0
"""The recorder: the best routes so far, the history of their fit, and the end of the budget."""
from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from uav_task_alloc.objective import fit
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import (
    DISTANCE,
    EXCESS,
    VALUE,
    Routes,
    copy_into,
    empty_routes,
    is_better,
)


@dataclass(slots=True)
class Progress:
    """How much of its budget a solve has used, and how the cost of its best plan fell.

    Arguments of methods:
        iterations: of the solver, since the last call.
    """

    clock: Callable[[], float]  # [s]
    began: float  # [s] on that clock
    budget: float  # [s]
    max_iterations: int | None = None  # None: no limit
    stop: Callable[[], bool] | None = None  # True ends the solve; None: nothing does
    threads: int = 1  # that search
    warm: bool = False  # the first best is a repaired earlier plan
    on_iteration: Callable[[int, float], None] | None = None  # (iterations so far, best fit)
    iterations: int = 0  # of all threads
    # (seconds since `began`, fit) of each best
    history: list[tuple[float, float]] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)  # of all that threads share

    def elapsed(self) -> float:
        """Seconds since the solve began."""
        return self.clock() - self.began

    def spent(self) -> float:
        """Share of the budget used, or of the iterations where those are limited: 0..1."""
        if self.max_iterations is not None:
            return min(1.0, self.iterations / self.max_iterations) if self.max_iterations else 1.0
        return min(1.0, self.elapsed() / self.budget) if self.budget > 0.0 else 1.0

    def over(self) -> bool:
        """Whether the solver must end: stopped, or out of time or iterations."""
        if self.stop is not None and self.stop():
            return True
        return self.spent() >= 1.0 or self.elapsed() >= self.budget

    def count(self, iterations: int = 1) -> None:
        """Count iterations of the solver, after their routes were offered; calls on_iteration."""
        with self.lock:
            self.iterations += iterations
            if self.on_iteration is not None:
                self.on_iteration(self.iterations, self.history[-1][1] if self.history
                                  else math.inf)


@dataclass(slots=True, kw_only=True)
class Recorder(Progress):
    """Receives the routes that solvers find; thread-safe.

    Arguments of methods:
        routes: of a solver; are copied.
    """

    problem: Problem  # that is solved
    locked_sums: tuple[float, float] = (0.0, 0.0)  # length [m] and value of the locked tasks
    best: Routes = field(init=False)  # routes; once one was offered

    def __post_init__(self) -> None:
        self.best = empty_routes(self.problem.arrays)

    def offer(self, routes: Routes) -> bool:
        """Copy the routes if they are better than the best; returns whether they are."""
        with self.lock:
            if self.history and not is_better(self.problem.arrays, routes, self.best):
                return False
            copy_into(routes, self.best)
            self._append_history()
        return True

    def copy_best_to(self, routes: Routes) -> None:
        """Overwrite routes with the best, if that is better."""
        with self.lock:
            if is_better(self.problem.arrays, self.best, routes):
                copy_into(self.best, routes)

    def _append_history(self) -> None:
        """Append the fit of the new best to the history."""
        sums = self.best.sums
        value = float(sums[VALUE]) + self.locked_sums[1]
        self.history.append((self.elapsed(), fit(
            float(sums[DISTANCE]) + self.locked_sums[0], value, float(sums[EXCESS]),
            self.problem.rules.weights)))
