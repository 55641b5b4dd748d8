# SPDX-License-Identifier: Apache-2.0
"""The objective of the learning baselines: eq 2.12 with a cost for unassigned tasks."""
from __future__ import annotations

from uav_task_alloc.objective import fit
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.routes import DISTANCE, EXCESS, UNASSIGNED_COST, VALUE, Floats


def penalised_fit(problem: Problem, sums: Floats) -> float:
    """Eq 2.12 of Routes.sums, with the cost of unassigned tasks [m] added to the distance."""
    return fit(float(sums[DISTANCE] + sums[UNASSIGNED_COST]), float(sums[VALUE]),
               float(sums[EXCESS]), problem.rules.weights)
