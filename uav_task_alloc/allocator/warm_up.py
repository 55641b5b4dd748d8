# SPDX-License-Identifier: Apache-2.0
"""Solves a small world once, so that all kernels are compiled before the first real problem."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from uav_task_alloc.allocator.core import Allocator
from uav_task_alloc.allocator.records import AnnouncementAction, UavReport
from uav_task_alloc.allocator.replanning.demand_area import load_waiting_kernels
from uav_task_alloc.allocator.replanning.planning import replan_problem, solve_problem
from uav_task_alloc.geometry.detour import find_detour
from uav_task_alloc.geometry.distances import Distances
from uav_task_alloc.geometry.search_budget import SearchBudget
from uav_task_alloc.kernel_cache import NOTICE, KernelWork
from uav_task_alloc.model import Plan, Task, ThreatZone
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.separation.conflicts import load_separation_kernels
from uav_task_alloc.solver.solve import load_kernels
from uav_task_alloc.solver.timed.solve import load_timed_kernels

_BUDGET = 0.05  # [s] of each solve
_WORK = KernelWork(51.5, 368)
_ZONES = (
    ThreatZone.hemisphere('dome', (100.0, 0.0, 0.0), 30.0),
    ThreatZone.cylinder('column', (300.0, 0.0), 30.0, 0.0, 100.0),
    ThreatZone.polygon('prism', ((180.0, -20.0), (220.0, -20.0), (200.0, 20.0)), 0.0, 100.0),
)


def compile_kernels(plan: Callable[..., Plan], params: AllocatorParams) -> int:
    """Compile all kernels by solving a world to which zones of each shape are added.

    Args:
        plan: `solver.solve.plan`, or a function like it.
        params: of the allocator.

    Returns:
        The number of lists that were planned.
    """
    with NOTICE.until_loaded('allocator', _WORK, whole=True):
        load_kernels(zones=True)
        load_timed_kernels(zones=True, few=True)  # any task may have a deadline
        load_separation_kernels()  # its parameters may change at any time
        load_waiting_kernels()  # so may `anticipate`
        return _planned(plan, params)


def _planned(plan: Callable[..., Plan], params: AllocatorParams) -> int:
    """Solve a small world; returns the number of lists."""
    params, before = replace(params, solve_budget=_BUDGET), Plan({})
    allocator = Allocator(params, now=0.0)
    allocator.set_kernels_ready()
    for zones in ((), _ZONES[:1], _ZONES):
        before = _solve(allocator, plan, zones, before)
    distances = Distances([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], _ZONES)
    distances.ensure([0], [1])
    distances.offer_path(0, 1, ())
    find_detour((100.0, 0.0, 10.0), (400.0, 0.0, 10.0), _ZONES,
                budget=SearchBudget(lambda: False))
    return len(allocator.collect().lists)


def _solve(allocator: Allocator, plan: Callable[..., Plan], zones: tuple[ThreatZone, ...],
           before: Plan) -> Plan:
    """Solve with these zones and four more tasks; returns the best plan."""
    world = allocator.world
    world.set_zones(zones, (), now=0.0)
    world.update_uav(UavReport('a', (0.0, 0.0, 20.0)), now=0.0, stamp=0.0)
    world.update_uav(UavReport('b', (0.0, 90.0, 20.0)), now=0.0, stamp=0.0)
    tasks = [Task(f't{len(zones)}_{k}', (400.0 * (k % 2), 30.0 * k, 20.0)) for k in range(4)]
    world.announce(AnnouncementAction.ADD, tasks, stamp=0.0, now=0.0)
    problem = replan_problem(world, before, 'warm-up', background=False)
    allocator.schedule.begin(0.0)
    answer = solve_problem(plan, problem, world.params, stop=lambda: False)
    allocator.adopt(answer, now=_BUDGET, stamp=0.0)
    return answer.best
