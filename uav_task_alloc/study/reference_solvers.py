# SPDX-License-Identifier: Apache-2.0
"""Adapters to PyVRP and OR-Tools: the same instances, and the routes they find in CPU time."""
from __future__ import annotations

import importlib.util
import math
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.model import Uav
from uav_task_alloc.study.evaluator import RoutesByUav
from uav_task_alloc.study.instances import Instance

_LONGEST_LEG = 1e6  # integer length of the longest leg: both solvers compute in integers
_UNLIMITED = 2 ** 40  # integer length
_WALL_TIME_FACTOR = 20.0  # wall time limit of OR-Tools over its CPU time
Incumbents = list[tuple[float, RoutesByUav]]  # CPU [s] and routes, one for each improvement


@dataclass(frozen=True, slots=True)
class IntegerModel:
    """An instance in integer lengths.

    Nodes: the start of each vehicle type; the end of each (one for all, at length 0 from every
    node, where routes are open); the tasks.
    """

    vehicle_types: Sequence[Sequence[Uav]]  # UAVs with the same start, home and range
    ends: Sequence[int]  # end node by vehicle type
    first_task: int  # node
    unit: float  # integer length of a metre
    lengths: NDArray[np.int64]  # (nodes, nodes), rounded up so that no range is exceeded in [m]
    prizes: Sequence[int]  # cost of leaving a task out; empty: all tasks must be served

    def max_length(self, vehicle_type: int) -> int:
        """Range of a UAV of this type as an integer length."""
        metres = self.vehicle_types[vehicle_type][0].range
        return int(self.unit * metres) if metres < math.inf else _UNLIMITED


def integer_model(instance: Instance) -> IntegerModel:
    """Convert an instance without zones to integer lengths. O((UAVs + tasks)^2)."""
    types: dict[object, list[Uav]] = {}
    for uav in instance.uavs:
        types.setdefault((uav.position, uav.home, uav.range), []).append(uav)
    vehicle_types = list(types.values())
    samples = [uavs[0] for uavs in vehicle_types]
    starts = [uav.position for uav in samples]
    returns = instance.route_end == 'home'
    homes = [uav.home or uav.position for uav in samples] if returns else starts[:1]
    points = np.array([*starts, *homes, *(task.position for task in instance.tasks)])
    metres = np.sqrt(((points[:, None] - points[None]) ** 2).sum(axis=2))
    first_end = len(vehicle_types)
    if not returns:
        metres[:, first_end] = metres[first_end, :] = 0.0
    unit = _LONGEST_LEG / max(float(metres.max()), 1e-9)
    lengths: NDArray[np.int64] = np.ceil(unit * metres - 1e-6).astype(np.int64)
    prizes: list[int] = []
    if instance.collects:  # a unit of value outweighs the length of all routes
        total = math.ceil(unit * sum(uav.range for uav in instance.uavs)) + 1
        prizes = [round(task.value * total) for task in instance.tasks]
    ends = [first_end + i if returns else first_end for i in range(len(vehicle_types))]
    return IntegerModel(vehicle_types, ends, first_end + len(homes), unit, lengths, prizes)


def pyvrp(instance: Instance, seconds: float) -> Incumbents:
    """Solve an instance with PyVRP.

    Args:
        instance: without zones.
        seconds: [s] of CPU time from when its model is built.

    Returns:
        The feasible routes of each improvement.
    """
    library, search = import_module('pyvrp'), import_module('pyvrp.solve')
    model = integer_model(instance)
    data = library.ProblemData(
        [library.Location(0, 0) for _ in model.lengths],
        [library.Client(model.first_task + i, prize=model.prizes[i] if model.prizes else 0,
                        required=not model.prizes) for i in range(len(instance.tasks))],
        [library.Depot(node) for node in range(model.first_task)],
        [library.VehicleType(len(uavs), start_depot=k, end_depot=model.ends[k],
                             max_distance=model.max_length(k))
         for k, uavs in enumerate(model.vehicle_types)],
        [model.lengths], [np.zeros_like(model.lengths)])
    callbacks = PyvrpCallbacks(seconds, time.thread_time())
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # prizes that outweigh the penalty of excess length
        library.solve(data, stop=callbacks.is_over, seed=0, collect_stats=False, display=False,
                      params=search.SolveParams(
                          ils=library.IteratedLocalSearchParams(callbacks=callbacks)))
    return [(when, _pyvrp_routes(model, instance, best)) for when, best in callbacks.better]


@dataclass(slots=True)
class PyvrpCallbacks:
    """Callbacks of PyVRP, named as it calls them: keep improvements, stop after the budget."""

    seconds: float  # [s] of CPU
    started: float  # [s]
    better: list[tuple[float, Any]] = field(default_factory=list)  # CPU [s], solution

    def is_over(self, cost: float) -> bool:
        """Whether the budget is used up."""
        return time.thread_time() - self.started >= self.seconds

    def on_best(self, best: Any) -> None:
        """Keep an improved solution that is within all ranges."""
        if best.is_feasible():
            self.better.append((time.thread_time() - self.started, best))

    def on_start(self, search: Any) -> None:
        """Keep the initial solution."""
        self.on_best(search.initial_solution)

    def on_iteration(self, *search: Any) -> None:
        """Ignore an iteration."""

    on_restart = on_end = on_iteration


def _pyvrp_routes(model: IntegerModel, instance: Instance, solution: Any) -> RoutesByUav:
    unused = [iter(uavs) for uavs in model.vehicle_types]
    return {next(unused[route.vehicle_type()]).id: [
        instance.tasks[stop.idx].id for stop in route if stop.is_client()]
        for route in solution.routes()}


def ortools(instance: Instance, seconds: float) -> Incumbents:
    """Solve an instance with the guided local search of OR-Tools; parameters as for `pyvrp`."""
    solver = import_module('ortools.constraint_solver.pywrapcp')
    model = integer_model(instance)
    fleet = [(k, uav) for k, uavs in enumerate(model.vehicle_types) for uav in uavs]
    index, routing = _routing_model(solver, model, [k for k, _ in fleet])
    incumbents: Incumbents = []
    costs: list[int] = []
    started = time.thread_time()

    def on_solution() -> None:
        cost, elapsed = routing.CostVar().Max(), time.thread_time() - started
        if not costs or cost < costs[-1]:
            costs.append(cost)
            incumbents.append((elapsed, {uav.id: [
                instance.tasks[node - model.first_task].id
                for node in _task_nodes(routing, index, v)] for v, (_, uav) in enumerate(fleet)}))
        if elapsed >= seconds:
            routing.solver().FinishCurrentSearch()

    routing.AddAtSolutionCallback(on_solution)
    routing.SolveWithParameters(_search_parameters(solver, _WALL_TIME_FACTOR * seconds))
    return incumbents


def _routing_model(solver: Any, model: IntegerModel, types: Sequence[int]) -> tuple[Any, Any]:
    """Index manager and routing model of OR-Tools; `types`: vehicle type by vehicle."""
    index = solver.RoutingIndexManager(len(model.lengths), len(types), list(types),
                                       [model.ends[k] for k in types])
    routing = solver.RoutingModel(index)
    transit = routing.RegisterTransitMatrix(model.lengths.tolist())
    routing.SetArcCostEvaluatorOfAllVehicles(transit)
    routing.AddDimensionWithVehicleCapacity(
        transit, 0, [model.max_length(k) for k in types], True, 'distance')
    for i, prize in enumerate(model.prizes):
        routing.AddDisjunction([index.NodeToIndex(model.first_task + i)], prize)
    return index, routing


def _task_nodes(routing: Any, index: Any, vehicle: int) -> list[int]:
    """Task nodes of a vehicle in the current solution, in order."""
    nodes, at = [], routing.NextVar(routing.Start(vehicle)).Value()
    while not routing.IsEnd(at):
        nodes.append(index.IndexToNode(at))
        at = routing.NextVar(at).Value()
    return nodes


def _search_parameters(solver: Any, seconds: float) -> Any:
    enums = import_module('ortools.constraint_solver.routing_enums_pb2')
    options = solver.DefaultRoutingSearchParameters()
    options.first_solution_strategy = enums.FirstSolutionStrategy.PARALLEL_CHEAPEST_INSERTION
    options.local_search_metaheuristic = enums.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    options.time_limit.FromMilliseconds(int(1000 * seconds))
    return options


REFERENCE_SOLVERS: Mapping[str, Callable[[Instance, float], Incumbents]] = {
    'pyvrp': pyvrp,
    'ortools': ortools,
}


def installed() -> list[str]:
    """Return the reference solvers whose packages are installed.

    Returns:
        Names in REFERENCE_SOLVERS.
    """
    return [name for name in REFERENCE_SOLVERS if importlib.util.find_spec(name)]


def best_at(incumbents: Incumbents, seconds: float) -> RoutesByUav | None:
    """The last routes found within so many CPU seconds; None where there were none."""
    known = [routes for when, routes in incumbents if when <= seconds]
    return known[-1] if known else None
