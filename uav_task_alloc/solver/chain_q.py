# SPDX-License-Identifier: Apache-2.0
"""The product, chain_q: colonies of bees, one a thread, improve the recorder's best in time."""
from __future__ import annotations

import threading

from uav_task_alloc.solver.colony import Colony, ColonyParams
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.warm import repaired

COLD_START, WARM_START = ColonyParams(), ColonyParams(hot=0.3, cold=0.02, again=3.0)
_LONGEST = 0.005  # [s] between looks at the clock
FIXED = 100  # rounds a flight where iterations are limited
EXCHANGES = 20  # times that colonies look at each other's best


def solve(recorder: Recorder, seed: int, learnt: object = None,
          habits: ColonyParams | None = None) -> object:
    """Fly until the budget ends; returns the tables for the next warm start."""
    problem = recorder.problem
    if not recorder.history:
        recorder.offer(repaired(problem, {}))
    if not problem.tasks or not problem.uavs or recorder.over():
        return learnt
    habits = habits or (WARM_START if recorder.warm else COLD_START)
    colonies = [Colony(problem, recorder.best, seed + 7919 * i, habits, learnt)
                for i in range(recorder.threads)]
    others = [threading.Thread(target=_live, args=(each, recorder), daemon=True)
              for each in colonies[1:]]
    for thread in others:
        thread.start()
    _live(colonies[0], recorder)
    for thread in others:
        thread.join()
    return colonies[0].scouts.learnt()


def _live(colony: Colony, recorder: Recorder) -> None:
    """Rounds of bees, each about as long as the clock may stay unseen."""
    fixed = recorder.max_iterations is not None  # then nothing may depend on the clock
    rounds, first, since = FIXED if fixed else 64, recorder.spent(), recorder.elapsed()
    spent, step, met = first, 0.0, first
    while not recorder.over():
        share = (spent - first) / (1.0 - first)
        flown = colony.fly(share, min(1.0, share + step), rounds)
        recorder.offer(colony.best)
        recorder.count(max(1, flown))
        if recorder.threads > 1 and spent - met > 1.0 / EXCHANGES:
            met = spent
            recorder.teach(colony.best)
        before, spent = spent, recorder.spent()
        now = recorder.elapsed()
        step = spent - before
        if flown and not fixed:
            aim = min(_LONGEST, recorder.budget - now)
            rounds = max(16, min(100_000, int(rounds * min(4.0, aim / max(1e-6, now - since)))))
        since = now
