# SPDX-License-Identifier: Apache-2.0
"""The solvers by name; each improves the recorder's best and returns a state for warm starts."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.solver import chain_q
from uav_task_alloc.solver.baselines import (
    auction,
    bee_colony,
    cbba,
    ga,
    nearest,
    paper_chain_q,
    q_learning,
)
from uav_task_alloc.solver.recorder import Recorder

Solver = Callable[[Recorder, int, object], object]  # (recorder, seed, learnt) -> learnt

SOLVERS: dict[str, Solver] = {  # extensible: SOLVERS['mine'] = solve
    'chain_q': chain_q.solve,
    'paper_chain_q': paper_chain_q.solve,
    'q_learning': q_learning.solve,
    'abc': bee_colony.solve,
    'ga': ga.solve,
    'nearest': nearest.solve,
    'auction': auction.solve,
    'cbba': cbba.solve,
}
