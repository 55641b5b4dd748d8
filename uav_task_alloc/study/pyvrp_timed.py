# SPDX-License-Identifier: Apache-2.0
"""Adapter to PyVRP for instances with windows, loads, limited durations, prizes and trips.

It gets the same model in its best form: vehicle types, reload depots, prizes; scores that are only
collected are scaled against lengths, which is what PyVRP works well with. What its model cannot
express (finish, response, lateness, waiting of UAVs in the air) is refused.
"""
from __future__ import annotations

import math
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Point, Task, Uav
from uav_task_alloc.objective import Objective
from uav_task_alloc.study.evaluator import TripsByUav
from uav_task_alloc.study.instances import Instance
from uav_task_alloc.study.reference_solvers import PyvrpCallbacks

TimedIncumbents = list[tuple[float, TripsByUav]]  # CPU [s] and trips, one for each improvement
_UNIT = 1000.0  # integer time of a second where lengths are not cut
_SCORE_WEIGHT = 1000.0  # of a unit of score over a metre
_NEVER = 2 ** 40


@dataclass(frozen=True, slots=True)
class _IntegerInstance:
    """An instance in integer lengths, times and loads.

    Locations: starts of vehicle types, then homes of vehicle types, then tasks. Where routes are
    open, the way to every home is 0, and there are no trips.
    """

    instance: Instance
    unit: float  # integer length of a metre, and time of a second
    load_unit: float
    types: Sequence[Sequence[Uav]]  # UAVs that are the same but for their ids
    reloads: bool

    def up(self, value: float) -> int:
        """An integer that is not less, for times before which nothing may begin."""
        return math.ceil(max(value, 0.0) * self.unit - 1e-6)

    def down(self, value: float) -> int:
        """An integer that is not more, for limits."""
        return _NEVER if math.isinf(value) else math.floor(value * self.unit + 1e-6)


def pyvrp_timed(instance: Instance, seconds: float,
                initial: TripsByUav | None = None) -> TimedIncumbents:
    """Solve an instance with PyVRP.

    Args:
        instance: without zones; all UAVs at their bases, with one speed, able to serve all tasks.
        seconds: [s] of CPU time from when its model is built.
        initial: trips by UAV id to start from; None: PyVRP's own start.

    Returns:
        The feasible routes of each improvement.

    Raises:
        InvalidValue: PyVRP's model does not have what the instance needs.
    """
    library, search = import_module('pyvrp'), import_module('pyvrp.solve')
    whole = _integer(instance)
    data = _data(library, whole)
    callbacks = PyvrpCallbacks(seconds, time.thread_time())
    options = {} if initial is None else {
        'initial_solution': _initial_solution(library, data, whole, initial)}
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # prizes that outweigh the penalty of excess length
        library.solve(data, stop=callbacks.is_over, seed=0, collect_stats=False, display=False,
                      params=search.SolveParams(
                          ils=library.IteratedLocalSearchParams(callbacks=callbacks)), **options)
    return [(when, _trips(whole, best)) for when, best in callbacks.better]


def _integer(instance: Instance) -> _IntegerInstance:
    """Group UAVs that are equal. Raises InvalidValue where PyVRP has no model of the instance."""
    prices = instance.rules.objective
    for name, wrong in (
            ('zones', bool(instance.zones)),
            ('objective', prices.finish > 0.0 or prices.response > 0.0
             or prices.lateness < math.inf),
            ('cruise_speed', len({uav.cruise_speed for uav in instance.uavs}) > 1),
            ('position', not all(uav.at_base for uav in instance.uavs)),
            ('capabilities', any(task.required_capabilities or task.allowed_uavs is not None
                                 for task in instance.tasks)),
            ('release', any(task.release > 0.0 and not task.payload for task in instance.tasks))):
        if wrong:
            raise InvalidValue(f'{instance.name}: {name}', 'given', 'none of it for pyvrp')
    types: dict[object, list[Uav]] = {}
    for uav in instance.uavs:
        types.setdefault((uav.position, uav.range, uav.endurance, uav.payload_capacity,
                          uav.available_from, uav.available_until), []).append(uav)
    loads = [task.payload for task in instance.tasks] + [
        uav.payload_capacity for uav in instance.uavs]
    whole_loads = all(load == round(load) for load in loads)
    reloads = instance.trips > 1 and instance.route_end == 'home' and all(
        uav.turnaround < math.inf for uav in instance.uavs)
    return _IntegerInstance(instance, instance.grain or _UNIT, 1.0 if whole_loads else 1000.0,
                            list(types.values()), reloads)


def _data(library: Any, whole: _IntegerInstance) -> Any:
    """The instance as PyVRP's ProblemData."""
    instance, count = whole.instance, len(whole.types)
    metres = _lengths(whole)
    speed = instance.uavs[0].cruise_speed
    seconds = metres if speed == 1.0 else np.ceil(metres / speed).astype(np.int64)
    swap = 0 if math.isinf(instance.uavs[0].turnaround) else whole.up(instance.uavs[0].turnaround)
    return library.ProblemData(
        [library.Location(0, 0) for _ in metres],
        [_client(library, whole, task, 2 * count + i) for i, task in enumerate(instance.tasks)],
        [library.Depot(i, service_duration=swap) for i in range(2 * count)],
        [_vehicle_type(library, whole, k) for k in range(count)], [metres], [seconds])


def _lengths(whole: _IntegerInstance) -> NDArray[np.int64]:
    """(locations, locations) cut as the instance says, else rounded up."""
    instance = whole.instance
    starts: list[Point] = [uavs[0].position for uavs in whole.types]
    points = np.array([*starts, *starts, *(task.position for task in instance.tasks)])
    metres = np.sqrt(((points[:, None] - points[None]) ** 2).sum(axis=2))
    scaled = np.floor(metres * whole.unit) if instance.grain else np.ceil(
        metres * whole.unit - 1e-6)
    if instance.route_end != 'home':
        scaled[:, len(starts):2 * len(starts)] = 0.0
    lengths: NDArray[np.int64] = scaled.astype(np.int64)
    return lengths


def _client(library: Any, whole: _IntegerInstance, task: Task, location: int) -> Any:
    prices: Objective = whole.instance.rules.objective
    prize = 0
    if whole.instance.collects:
        prize = round(task.value * _SCORE_WEIGHT * whole.unit)
    elif prices.unserved < math.inf:
        prize = round(task.value * prices.unserved / prices.distance * whole.unit)
    return library.Client(
        location, delivery=[math.ceil(task.payload * whole.load_unit - 1e-6)],
        service_duration=whole.up(task.service_time), tw_early=whole.up(task.earliest),
        tw_late=whole.down(task.latest), release_time=whole.up(task.release), prize=prize,
        required=prize == 0)


def _vehicle_type(library: Any, whole: _IntegerInstance, k: int) -> Any:
    uav = whole.types[k][0]
    options = {'reload_depots': [len(whole.types) + k],
               'max_reloads': whole.instance.trips - 1} if whole.reloads else {}
    return library.VehicleType(
        len(whole.types[k]), [math.floor(uav.payload_capacity * whole.load_unit + 1e-6)],
        start_depot=k, end_depot=len(whole.types) + k, tw_early=whole.up(uav.available_from),
        tw_late=whole.down(uav.available_until), shift_duration=whole.down(uav.endurance),
        max_distance=whole.down(uav.range), **options)


def _trips(whole: _IntegerInstance, solution: Any) -> TripsByUav:
    """Task ids of each trip of a solution, by UAV id."""
    unused = [iter(uavs) for uavs in whole.types]
    found: dict[str, list[list[str]]] = {}
    for route in solution.routes():
        trips: list[list[str]] = [[]]
        for stop in route:
            if stop.is_client():
                trips[-1].append(whole.instance.tasks[stop.idx].id)
            elif trips[-1]:
                trips.append([])
        found[next(unused[route.vehicle_type()]).id] = [trip for trip in trips if trip]
    return found


def _initial_solution(library: Any, data: Any, whole: _IntegerInstance,
                      initial: TripsByUav) -> Any:
    """PyVRP's solution of trips; of one trip for each UAV."""
    index = {task.id: i for i, task in enumerate(whole.instance.tasks)}
    routes = []
    for k, uavs in enumerate(whole.types):
        for uav in uavs:
            row = [index[name] for trip in initial.get(uav.id, ()) for name in trip]
            if row:
                routes.append(library.Route(data, row, k))
    return library.Solution(data, routes)
