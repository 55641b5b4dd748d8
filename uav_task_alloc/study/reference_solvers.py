# SPDX-License-Identifier: Apache-2.0
"""The same instances for PyVRP and OR-Tools, and the routes they find in CPU time."""
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

COUNTS = 1e6  # both count in integers: the longest leg is so many
_UNLIMITED = 2 ** 40
WAITING = 20.0  # times the CPU seconds that OR-Tools may take by the wall
Found = list[tuple[float, RoutesByUav]]  # CPU [s] and routes, whenever better ones were found


@dataclass(frozen=True, slots=True)
class Model:
    """Nodes: a start a crew, their ends (one that costs nothing where routes stay open), tasks."""

    crews: Sequence[Sequence[Uav]]  # UAVs that are alike
    ends: Sequence[int]  # node by crew
    tasks: int  # first node
    unit: float  # counts a metre
    ways: NDArray[np.int64]  # rounded up, so that what is within range here is so there
    prizes: Sequence[int]  # what leaving a task out costs; empty: none may be

    def reach(self, crew: int) -> int:
        """Range of a UAV of this crew."""
        metres = self.crews[crew][0].range
        return int(self.unit * metres) if metres < math.inf else _UNLIMITED


def model(instance: Instance) -> Model:
    """The instance in integers."""
    alike: dict[object, list[Uav]] = {}
    for uav in instance.uavs:
        alike.setdefault((uav.position, uav.home, uav.range), []).append(uav)
    crews = list(alike.values())
    starts = [crew[0].position for crew in crews]
    returns = instance.route_end == 'home'
    homes = [crew[0].home or crew[0].position for crew in crews] if returns else starts[:1]
    points = np.array([*starts, *homes, *(task.position for task in instance.tasks)])
    metres = np.sqrt(((points[:, None] - points[None]) ** 2).sum(axis=2))
    first = len(crews)
    if not returns:
        metres[:, first] = metres[first, :] = 0.0
    unit = COUNTS / max(float(metres.max()), 1e-9)
    ways: NDArray[np.int64] = np.ceil(unit * metres - 1e-6).astype(np.int64)
    prizes: list[int] = []
    if instance.collects:  # a unit of value outweighs all the way that there can be
        way = math.ceil(unit * sum(uav.range for uav in instance.uavs)) + 1
        prizes = [round(task.value * way) for task in instance.tasks]
    ends = [first + i if returns else first for i in range(len(crews))]
    return Model(crews, ends, first + len(homes), unit, ways, prizes)


def pyvrp(instance: Instance, seconds: float) -> Found:
    """What PyVRP finds within `seconds` of CPU time, which begins with the model at hand."""
    rival, search = import_module('pyvrp'), import_module('pyvrp.solve')
    m = model(instance)
    data = rival.ProblemData(
        [rival.Location(0, 0) for _ in m.ways],
        [rival.Client(m.tasks + i, prize=m.prizes[i] if m.prizes else 0, required=not m.prizes)
         for i in range(len(instance.tasks))],
        [rival.Depot(node) for node in range(m.tasks)],
        [rival.VehicleType(len(crew), start_depot=c, end_depot=m.ends[c],
                           max_distance=m.reach(c)) for c, crew in enumerate(m.crews)],
        [m.ways], [np.zeros_like(m.ways)])
    watch = Watch(seconds, time.thread_time())
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # of prizes that outweigh the price of excess
        rival.solve(data, stop=watch.over, seed=0, collect_stats=False, display=False,
                    params=search.SolveParams(
                        ils=rival.IteratedLocalSearchParams(callbacks=watch)))
    return [(when, _pyvrp_routes(m, instance, best)) for when, best in watch.better]


@dataclass(slots=True)
class Watch:
    """What PyVRP calls back; keeps each better plan, to be read when all is over."""

    seconds: float  # [s] of CPU
    began: float  # [s]
    better: list[tuple[float, Any]] = field(default_factory=list)

    def over(self, cost: float) -> bool:
        """Whether its time is up."""
        return time.thread_time() - self.began >= self.seconds

    def on_best(self, best: Any) -> None:
        """It found a better plan, which may still be beyond range."""
        if best.is_feasible():
            self.better.append((time.thread_time() - self.began, best))

    def on_start(self, search: Any) -> None:
        """It has a first plan."""
        self.on_best(search.initial_solution)

    def on_iteration(self, *search: Any) -> None:
        """Nothing better."""

    on_restart = on_end = on_iteration


def _pyvrp_routes(m: Model, instance: Instance, solution: Any) -> RoutesByUav:
    free = [iter(crew) for crew in m.crews]
    return {next(free[route.vehicle_type()]).id: [
        instance.tasks[stop.idx].id for stop in route if stop.is_client()]
        for route in solution.routes()}


def ortools(instance: Instance, seconds: float) -> Found:
    """What OR-Tools' guided local search finds within `seconds` of CPU time."""
    solver = import_module('ortools.constraint_solver.pywrapcp')
    m = model(instance)
    fleet = [(c, uav) for c, crew in enumerate(m.crews) for uav in crew]
    index, routing = _routing(solver, m, [c for c, _ in fleet])
    found: Found = []
    costs: list[int] = []
    began = time.thread_time()

    def note() -> None:
        cost, spent = routing.CostVar().Max(), time.thread_time() - began
        if not costs or cost < costs[-1]:
            costs.append(cost)
            found.append((spent, {uav.id: [
                instance.tasks[node - m.tasks].id for node in _ortools_route(routing, index, v)]
                for v, (_, uav) in enumerate(fleet)}))
        if spent >= seconds:
            routing.solver().FinishCurrentSearch()

    routing.AddAtSolutionCallback(note)
    routing.SolveWithParameters(_guided(solver, WAITING * seconds))
    return found


def _routing(solver: Any, m: Model, crews: Sequence[int]) -> tuple[Any, Any]:
    """Its index and model; `crews` has the crew of each vehicle."""
    index = solver.RoutingIndexManager(len(m.ways), len(crews), list(crews),
                                       [m.ends[crew] for crew in crews])
    routing = solver.RoutingModel(index)
    transit = routing.RegisterTransitMatrix(m.ways.tolist())
    routing.SetArcCostEvaluatorOfAllVehicles(transit)
    routing.AddDimensionWithVehicleCapacity(transit, 0, [m.reach(crew) for crew in crews], True,
                                            'distance')
    for i, prize in enumerate(m.prizes):
        routing.AddDisjunction([index.NodeToIndex(m.tasks + i)], prize)
    return index, routing


def _ortools_route(routing: Any, index: Any, vehicle: int) -> list[int]:
    """Task nodes of a vehicle in the solution at hand."""
    nodes, at = [], routing.NextVar(routing.Start(vehicle)).Value()
    while not routing.IsEnd(at):
        nodes.append(index.IndexToNode(at))
        at = routing.NextVar(at).Value()
    return nodes


def _guided(solver: Any, seconds: float) -> Any:
    enums = import_module('ortools.constraint_solver.routing_enums_pb2')
    options = solver.DefaultRoutingSearchParameters()
    options.first_solution_strategy = enums.FirstSolutionStrategy.PARALLEL_CHEAPEST_INSERTION
    options.local_search_metaheuristic = enums.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    options.time_limit.FromMilliseconds(int(1000 * seconds))
    return options


REFERENCE_SOLVERS: Mapping[str, Callable[[Instance, float], Found]] = {
    'pyvrp': pyvrp,
    'ortools': ortools,
}


def installed() -> list[str]:
    """The rivals that are here to be compared with."""
    return [name for name in REFERENCE_SOLVERS if importlib.util.find_spec(name)]


def at(found: Found, seconds: float) -> RoutesByUav | None:
    """The best routes that were known after so many seconds."""
    known = [routes for when, routes in found if when <= seconds]
    return known[-1] if known else None
