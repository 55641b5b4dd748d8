# SPDX-License-Identifier: Apache-2.0
"""The default solver, chain_q: bee colonies, one a thread, improve the recorder's best plan."""
from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any, Protocol

from uav_task_alloc.solver.colony import Colony, ColonyParams, Cooling
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.ruin import MAX_STRING
from uav_task_alloc.solver.savings import offer_first
from uav_task_alloc.solver.selection import leave_many

COLD_START = ColonyParams(heats=True)
# where not all tasks may be served: the choice of tasks, more than their order
_HOT = 260.0, 60.0, 60.0, 60.0, 260.0, 60.0, 60.0, 60.0
COLD_SELECTION = ColonyParams(
    coolings=(*(Cooling(0.109 * i, each, 1.3) for i, each in enumerate(_HOT)),
              Cooling(0.87, 10.0, 1.3), Cooling(0.95, 1.3, 0.3)),
    heats=True, skipped=0.3, by_value=0.3, selects=True)
SHORT_START = ColonyParams()  # where there are few rounds
MANY_ROUNDS = 25.0  # a task; with fewer high temperatures do not pay
ROUNDS_A_SECOND = 1e5  # of a search, about
# where ranges run out: exceeding one soon costs more than leaving a task out, so that the search
# passes from plans beyond range to plans within range and back, often enough in a short budget
WARM_START = ColonyParams(coolings=(Cooling(0.0, 0.3, 0.02), Cooling(0.45, 3.0, 0.02),
                                    Cooling(0.92, 0.02, 0.02)), most_penalty=1e4, cost_growth=3.0,
                          least_rounds=10.0, string_floor=float(MAX_STRING))
_ROUND_TIME = 0.005  # [s] of one flight: the clock is read between flights
FIXED_ROUNDS = 100  # rounds of a flight where iterations are limited
EXCHANGES = 20  # how often in a budget a colony takes over the recorder's best


def solve(recorder: Recorder, seed: int, learnt: object = None,
          params: ColonyParams | None = None) -> object:
    """Improve the recorder's best until the budget ends. An iteration: one ruin and recreate.

    Args:
        recorder: holds the problem, the best routes and the budget.
        seed: of the random numbers; thread i uses seed + 7919 i.
        learnt: what an earlier call returned, or None.
        params: of the colonies; None: COLD_START or WARM_START.

    Returns:
        The Q tables, for the next warm start.
    """
    problem = recorder.problem
    if not recorder.history:
        offer_first(recorder)
    if not problem.tasks or not problem.uavs or recorder.over():
        return learnt
    params = params or _params(recorder)
    colonies = [Colony(problem, recorder.best, seed + 7919 * i, params, learnt)
                for i in range(recorder.threads)]
    run_colonies(colonies, recorder)
    return colonies[0].scouts.learnt()


def _params(recorder: Recorder) -> ColonyParams:
    """Parameters for a warm start, for a choice of tasks, or for neither."""
    if recorder.warm:
        return WARM_START
    rounds = recorder.budget * ROUNDS_A_SECOND
    if recorder.max_iterations is not None:
        rounds = min(rounds, recorder.max_iterations)
    if rounds < MANY_ROUNDS * len(recorder.problem.tasks):
        return SHORT_START
    return COLD_SELECTION if leave_many(recorder.problem, recorder.best) else COLD_START


class Flies(Protocol):
    """A colony of either kind."""

    best: Any

    def fly(self, spent: float, until: float, rounds: int) -> int:
        """Run a flight; returns its rounds of search."""


def run_colonies(colonies: Sequence[Flies], recorder: Any) -> None:
    """Run each colony on a thread, the first on this one, until the recorder ends the solve.

    Args:
        colonies: at least one.
        recorder: says when the solve is over.
    """
    others = [threading.Thread(target=_run_colony, args=(each, recorder), daemon=True)
              for each in colonies[1:]]
    for thread in others:
        thread.start()
    _run_colony(colonies[0], recorder)
    for thread in others:
        thread.join()


def _run_colony(colony: Flies, recorder: Any) -> None:
    """Run flights of about _ROUND_TIME until the recorder ends the solve."""
    fixed = recorder.max_iterations is not None  # then nothing depends on the clock
    rounds, first, since = FIXED_ROUNDS if fixed else 64, recorder.spent(), recorder.elapsed()
    spent, step, exchanged = first, 0.0, first
    while not recorder.over():
        share = (spent - first) / (1.0 - first)
        flown = colony.fly(share, min(1.0, share + step), rounds)
        recorder.offer(colony.best)
        recorder.count(max(1, flown))
        if recorder.threads > 1 and spent - exchanged > 1.0 / EXCHANGES:
            exchanged = spent
            recorder.copy_best_to(colony.best)
        before, spent = spent, recorder.spent()
        now = recorder.elapsed()
        step = spent - before
        if flown and not fixed:
            target = min(_ROUND_TIME, recorder.budget - now)
            rounds = max(16, min(100_000, int(rounds * min(4.0, target / max(1e-6, now - since)))))
        since = now
