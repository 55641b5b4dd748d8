# SPDX-License-Identifier: Apache-2.0
"""How long a dry run takes: from the request of an operator to its answer, without ROS.

    python benchmarks/dry_run.py [--tasks 200] [--uavs 10] [--zones 5] [--runs 20]

The allocator has a plan in force for random tasks; each run asks what it costs to pin a random
task to a random UAV. Wall time, so the machine should be idle; solve_budget is the default.
"""
from __future__ import annotations

import argparse
import random
import statistics
import time

from uav_task_alloc import ThreatZone, plan
from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.operator_desk import OperatorDesk, OrderTrial
from uav_task_alloc.allocator.order_requests import OrderAction, OrderRequest
from uav_task_alloc.allocator.records import AnnouncementAction, UavReport
from uav_task_alloc.allocator.replanning.planning import solve_problem
from uav_task_alloc.allocator.replanning.what_if import solve_what_if
from uav_task_alloc.model import Task
from uav_task_alloc.params import AllocatorParams

SIDE = 5000.0  # [m]


def planned(rng: random.Random, tasks: int, uavs: int, zones: int) -> Allocator:
    """An allocator with a plan in force."""
    core = Allocator(AllocatorParams(), 0.0)
    core.set_kernels_ready()
    world = core.world
    world.set_zones([ThreatZone.cylinder(f'z{n}', (rng.uniform(0.2, 0.8) * SIDE,
                                                   rng.uniform(0.2, 0.8) * SIDE), 200.0)
                     for n in range(zones)], (), 0.0)
    for n in range(uavs):
        spot = (SIDE / uavs * n, 0.0, 50.0)
        world.update_uav(UavReport(f'u{n}', spot, home=spot, range=60_000.0), 0.0, 0.0)
    world.announce(AnnouncementAction.ADD, [
        Task(f't{n}', (rng.uniform(0.0, SIDE), rng.uniform(0.0, SIDE), 60.0))
        for n in range(tasks)], 0.0, 0.0)
    for now in (1.0, 2.0):
        problem = core.due(now, now)
        if problem is not None:
            core.adopt(solve_problem(plan, problem, world.params, lambda: False), now, now)
            world.request_replan('again', now)
    return core


def dry_run(core: Allocator, rng: random.Random, now: float) -> tuple[float, float, str]:
    """Time, CPU time [s] and answer of one request."""
    desk, world, began = OperatorDesk(core), core.world, time.perf_counter()
    cpu = time.process_time()
    tasks = sorted(record.task.id for record in world.tasks.open())
    answer = desk.open(OrderRequest(
        OrderAction.PIN, rng.choice(sorted(world.uav_records())), (rng.choice(tasks),),
        dry_run=True), now, now)
    if isinstance(answer, OrderTrial):
        answer = desk.close(answer, solve_what_if(plan, answer.problem, world.params,
                                                  lambda: False, time.perf_counter), now, now)
    return time.perf_counter() - began, time.process_time() - cpu, answer.message


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    for name, default in (('tasks', 200), ('uavs', 10), ('zones', 5), ('runs', 20)):
        parser.add_argument(f'--{name}', type=int, default=default)
    args = parser.parse_args()
    rng = random.Random(1)
    core = planned(rng, args.tasks, args.uavs, args.zones)
    dry_run(core, rng, 3.0)  # loads kernels
    took = [dry_run(core, rng, 3.0) for _ in range(args.runs)]
    times, cpu = (sorted(1e3 * each[n] for each in took) for n in (0, 1))
    print(f'{args.tasks} tasks, {args.uavs} UAVs, {args.zones} zones, solve_budget '
          f'{1e3 * core.world.params.solve_budget:.0f} ms: median '
          f'{statistics.median(times):.0f} ms, worst {times[-1]:.0f} ms; CPU time '
          f'{statistics.median(cpu):.0f} ms, worst {cpu[-1]:.0f} ms; {took[-1][-1]}')


if __name__ == '__main__':
    main()
