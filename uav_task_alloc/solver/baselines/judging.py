# SPDX-License-Identifier: Apache-2.0
"""What the learning baselines make small: the fit of eq 2.12, tasks left out at their price."""
from __future__ import annotations

from uav_task_alloc.objective import fit
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import DISTANCE, EXCESS, LEFT_OUT, VALUE, Floats


def judged(problem: Problem, sums: Floats) -> float:
    """Eq 2.12 by the sums of routes; what is left out counts as way [m], else it would pay."""
    return fit(float(sums[DISTANCE] + sums[LEFT_OUT]), float(sums[VALUE]), float(sums[EXCESS]),
               problem.rules.weights)
