# SPDX-License-Identifier: Apache-2.0
"""A small world solved once, so that every kernel is compiled before a real one comes."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from uav_task_alloc.allocator.core import Allocator
from uav_task_alloc.allocator.records import AnnouncementAction, UavReport
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.geometry.detour import find_detour
from uav_task_alloc.geometry.distances import Distances
from uav_task_alloc.geometry.search_budget import SearchBudget
from uav_task_alloc.model import Plan, Task, ThreatZone
from uav_task_alloc.params import AllocatorParams

BUDGET = 0.05  # [s] of each solve
ZONES = (
    ThreatZone.hemisphere('dome', (100.0, 0.0, 0.0), 30.0),
    ThreatZone.cylinder('column', (300.0, 0.0), 30.0, 0.0, 100.0),
    ThreatZone.polygon('prism', ((180.0, -20.0), (220.0, -20.0), (200.0, 20.0)), 0.0, 100.0),
)


def warm_up(plan: Callable[..., Plan], params: AllocatorParams) -> int:
    """Solve a world into which zones of each shape come; the number of lists that came out."""
    params, before = replace(params, solve_budget=BUDGET), Plan({})
    allocator = Allocator(params, now=0.0)
    allocator.wake()
    for zones in ((), ZONES[:1], ZONES):
        allocator.world.set_zones(zones, (), now=0.0)
        allocator.world.hear(UavReport('a', (0.0, 0.0, 20.0)), now=0.0, stamp=0.0)
        allocator.world.hear(UavReport('b', (0.0, 90.0, 20.0)), now=0.0, stamp=0.0)
        tasks = [Task(f't{len(zones)}_{k}', (400.0 * (k % 2), 30.0 * k, 20.0))
                 for k in range(4)]
        allocator.world.announce(AnnouncementAction.ADD, tasks, stamp=0.0, now=0.0)
        asked = planning.problem(allocator.world, before, 'rehearsal', background=False)
        began = allocator.world.schedule.begin(0.0)
        assert began
        answer = planning.solve_problem(plan, asked, params, stop=lambda: False)
        allocator.adopt(answer, now=BUDGET, stamp=0.0)
        before = answer.fresh
    ways = Distances([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], ZONES)
    ways.ensure([0], [1])
    ways.offer_path(0, 1, ())
    find_detour((100.0, 0.0, 10.0), (400.0, 0.0, 10.0), ZONES, budget=SearchBudget(lambda: False))
    return len(allocator.collect().lists)
