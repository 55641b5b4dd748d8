# SPDX-License-Identifier: Apache-2.0
"""The solvers by name: each improves on the recorder's best, returns a state to go on from."""
from __future__ import annotations

from collections.abc import Callable, Mapping

from uav_task_alloc.solver import chain_q
from uav_task_alloc.solver.baselines import auction, chain_q_paper, greedy, insertion
from uav_task_alloc.solver.recorder import Recorder

Solver = Callable[[Recorder, int, object], object]  # (recorder, seed, learnt) -> learnt

SOLVERS: Mapping[str, Solver] = {
    'chain_q': chain_q.solve,
    'chain_q_paper': chain_q_paper.solve,
    'greedy': greedy.solve,
    'auction': auction.solve,
    'insertion': insertion.solve,
}
