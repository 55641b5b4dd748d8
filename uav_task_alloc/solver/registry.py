# SPDX-License-Identifier: Apache-2.0
"""The solvers by name: each improves on the recorder's best, returns a state to go on from."""
from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from uav_task_alloc.solver import chain_q
from uav_task_alloc.solver.recorder import Recorder

Solver = Callable[[Recorder, int, Any], Any]  # (recorder, seed, state of the warm plan) -> state

SOLVERS: Mapping[str, Solver] = {
    'chain_q': chain_q.solve,
}
