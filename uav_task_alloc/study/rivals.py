# SPDX-License-Identifier: Apache-2.0
"""The same problem for PyVRP and OR-Tools: open routes from many starts, a range each."""
from __future__ import annotations

import importlib.util
import time
from collections.abc import Sequence
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.study.instances import Instance

UNIT = 100.0  # both count in integers: centimetres
Found = list[tuple[float, float]]  # ([s] of CPU, length [m]) whenever a better plan was found


def matrix(instance: Instance) -> NDArray[np.int64]:
    """Starts, a common end that costs nothing to fly to, tasks [cm]."""
    m = len(instance.uavs)
    points = np.array([*(u.position for u in instance.uavs), (0.0, 0.0, 0.0),
                       *(t.position for t in instance.tasks)])
    ways = np.sqrt(((points[:, None] - points[None]) ** 2).sum(axis=2))
    ways[:, m] = ways[m, :] = 0.0
    counted: NDArray[np.int64] = np.ceil(UNIT * ways).astype(np.int64)
    return counted


class CpuTime:
    """Stops PyVRP after some CPU seconds and notes when it got better."""

    def __init__(self, seconds: float) -> None:
        self.began, self.seconds = time.process_time(), seconds
        self.found: Found = []

    def __call__(self, best_cost: float) -> bool:
        """Whether to stop; the cost of an infeasible plan is beyond all bounds."""
        spent, length = time.process_time() - self.began, best_cost / UNIT
        if length < 1e12 and (not self.found or length < self.found[-1][1]):
            self.found.append((spent, length))
        return spent >= self.seconds


def pyvrp(instance: Instance, seconds: float) -> Found:
    """What PyVRP finds within `seconds` of CPU time, which begins with the model at hand."""
    rival = import_module('pyvrp')
    ways, m = matrix(instance), len(instance.uavs)
    places = [*(u.position for u in instance.uavs), (0.0, 0.0, 0.0),
              *(t.position for t in instance.tasks)]
    data = rival.ProblemData(
        [rival.Location(x, y) for x, y, _ in places],
        [rival.Client(m + 1 + i) for i in range(len(instance.tasks))],
        [rival.Depot(u) for u in range(m + 1)],
        [rival.VehicleType(1, start_depot=u, end_depot=m, max_distance=int(UNIT * uav.range))
         for u, uav in enumerate(instance.uavs)],
        [ways], [np.zeros_like(ways)])
    stop = CpuTime(seconds)
    rival.solve(data, stop=stop, seed=0, collect_stats=False, display=False)
    return stop.found


def ortools(instance: Instance, seconds: float) -> Found:
    """What OR-Tools' guided local search finds within `seconds`."""
    solver = import_module('ortools.constraint_solver.pywrapcp')
    enums = import_module('ortools.constraint_solver.routing_enums_pb2')
    ways, m = matrix(instance), len(instance.uavs)
    index = solver.RoutingIndexManager(len(ways), m, list(range(m)), [m] * m)
    routing = solver.RoutingModel(index)
    transit = routing.RegisterTransitMatrix(ways.tolist())
    routing.SetArcCostEvaluatorOfAllVehicles(transit)
    routing.AddDimensionWithVehicleCapacity(
        transit, 0, [int(UNIT * u.range) for u in instance.uavs], True, 'distance')
    found: Found = []
    began = time.process_time()

    def note() -> None:
        length = routing.CostVar().Max() / UNIT
        if not found or length < found[-1][1]:
            found.append((time.process_time() - began, length))

    routing.AddAtSolutionCallback(note)
    options = solver.DefaultRoutingSearchParameters()
    options.first_solution_strategy = enums.FirstSolutionStrategy.PARALLEL_CHEAPEST_INSERTION
    options.local_search_metaheuristic = enums.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    options.time_limit.FromMilliseconds(int(1000 * seconds))
    routing.SolveWithParameters(options)
    return found


def installed() -> list[str]:
    """The rivals that are here to be compared with."""
    return [name for name in ('pyvrp', 'ortools') if importlib.util.find_spec(name)]


def run(name: str, instance: Instance, seconds: float) -> Found:
    """What the named rival finds."""
    return {'pyvrp': pyvrp, 'ortools': ortools}[name](instance, seconds)


def at(found: Sequence[tuple[float, float]], seconds: float) -> float:
    """The length [m] of the best plan after so many seconds; inf: none."""
    return min((length for when, length in found if when <= seconds), default=float('inf'))
