# SPDX-License-Identifier: Apache-2.0
"""The world as a problem, and an answer as lists: what `solver` is asked and what is taken."""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from uav_task_alloc.allocator.records import (
    ReplanAnswer,
    ReplanProblem,
    TaskRecord,
    UavList,
)
from uav_task_alloc.allocator.replanning.plan_acceptance import TaskIdsByUav, repaired_routes
from uav_task_alloc.allocator.replanning.task_lists import lay, planned_legs
from uav_task_alloc.allocator.state.fleet import may_fly
from uav_task_alloc.allocator.state.task_state_machine import TaskTransition
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.allocator.state.zone_checks import note_way_home, standing
from uav_task_alloc.model import Leg, Plan, Task, Uav
from uav_task_alloc.objective import fit
from uav_task_alloc.params import AllocatorParams


def problem(world: World, best: Plan, trigger: str, background: bool) -> ReplanProblem:
    """What a worker is to solve; the lists that are out are the incumbent."""
    params = world.params
    uavs = tuple(_uav(world, uav_id) for uav_id in world.fleet.records
                 if world.fleet.usable(uav_id))
    ids = frozenset(uav.id for uav in uavs)
    kept = _kept(world)
    tasks = tuple(_restricted(record, ids) for record in world.tasks.open()
                  if record.task.id not in kept)
    held = {uav.id: world.lists.get(uav.id).task_ids for uav in uavs}
    legs = {uav.id: tuple(stop.leg for stop in world.lists.get(uav.id).stops) for uav in uavs}
    return ReplanProblem(
        world.version, trigger, background,
        params.background_budget if background else params.solve_budget, uavs, tasks,
        tuple(world.zones.values()), world.locked(), held=replace(best, routes=held, legs=legs),
        warm=best)


def _kept(world: World) -> frozenset[str]:
    """Tasks that nobody gets: shortly after a restart those of UAVs that get no more tasks.

    They may have been flown while nobody listened, which is told again where they are listed.
    """
    if not world.cautious:
        return frozenset()
    return frozenset(task_id for uav_id, each in world.lists.lists.items()
                     if not world.fleet.usable(uav_id) for task_id in each.task_ids)


def solve_problem(plan: Callable[..., Plan], asked: ReplanProblem, params: AllocatorParams,
          stop: Callable[[], bool]) -> ReplanAnswer:
    """The lists repaired by `plan`, at once; then the best plan within the budget."""
    def call(warm: Plan, budget: float, max_iterations: int | None) -> Plan:
        return plan(asked.uavs, asked.tasks, asked.zones, budget=budget, seed=params.seed,
                    warm=warm, route_end=params.route_end, locked=asked.locked,
                    clearance=params.clearance, altitude_min=params.altitude_min,
                    altitude_max=params.altitude_max, threads=params.threads, stop=stop,
                    max_iterations=max_iterations)

    base = call(asked.held, asked.budget, 0)
    return ReplanAnswer(asked, base, call(asked.warm if asked.background else base, asked.budget,
                                    None))


def lists_of(world: World, chosen: Plan) -> tuple[dict[str, UavList], dict[str, str]]:
    """The lists of a plan in the world as it is now, and why tasks are left out."""
    routes = _routes_now(world, chosen)
    legs, ways, returns = planned_legs(chosen), world.ways(), world.params.route_end == 'home'
    lists, left = {}, dict(chosen.unassigned)
    for uav_id, task_ids in routes.items():
        tasks = [world.tasks.records[task_id].task for task_id in task_ids]
        if world.stands(uav_id, tasks):
            lists[uav_id] = world.lists.get(uav_id)
            continue
        lists[uav_id], lost = _lay(world, uav_id, tasks, returns, legs)
        left.update((task_id, f'no safe way for {uav_id}') for task_id in lost)
        world.laid[uav_id] = ways, world.fleet.records[uav_id].home
    for uav_id, held in world.lists.lists.items():
        # gone: what it does not have it cannot fly when it is back
        if uav_id not in lists and not world.cautious:
            lists[uav_id] = _without(world, uav_id, held)
    return lists, left


def _lay(world: World, uav_id: str, tasks: Sequence[Task], returns: bool,
         legs: Mapping[tuple[str, str, str], Leg]) -> tuple[UavList, list[str]]:
    """As `lay`; a way home that is not safe is noted."""
    made, lost = lay(_uav(world, uav_id), tasks, returns, legs, world.lists.get(uav_id),
                     world.ways())
    place = made.stops[-1].task.position if made.stops else (
        world.fleet.records[uav_id].report.position)
    note_way_home(world, uav_id, made.returns or not returns, place)
    return made, lost


def _without(world: World, uav_id: str, held: UavList) -> UavList:
    """The empty list; one whose battery is low is sent home, the others stay as they were.

    Nobody is sent home where there is no safe way.
    """
    record, empty = world.fleet.records.get(uav_id), replace(held, stops=(), distance=0.0)
    if record is None:
        return empty
    if record.low:
        return _lay(world, uav_id, (), True, {})[0]
    position = record.report.position
    if not held.returns or world.ways().leg(position, record.home) is not None:
        return empty
    if not record.standing:
        note_way_home(world, uav_id, False, position)
    return replace(empty, returns=False, end_via=())


def must_change(world: World, uav_id: str) -> bool:
    """What the UAV was told last it cannot or may not fly, or it has nothing to do."""
    held, record = world.lists.get(uav_id), world.fleet.records.get(uav_id)
    if not held.stops or record is None or not world.fleet.usable(uav_id):
        return True
    for stop in held.stops:
        known = world.tasks.records.get(stop.task.id)
        if (known is None or not known.open or known.task != stop.task
                or not may_fly(known.task, known.failed_on, record.report)):
            return True
    ways, places = world.ways(), [stop.task.position for stop in held.stops]
    returns = world.params.route_end == 'home' and uav_id not in world.stranded
    return (held.returns != returns
            or ways.rest(record.report.position, held.stops[0].leg, places[0]) is None
            or not all(ways.clear(place, *stop.leg.via, stop.task.position)
                       for place, stop in zip(places, held.stops[1:], strict=False)))


def _routes_now(world: World, chosen: Plan) -> TaskIdsByUav:
    reports = {uav_id: known.report for uav_id, known in world.fleet.records.items()
               if world.fleet.usable(uav_id)}

    def allowed(uav_id: str, task_id: str) -> bool:
        record = world.tasks.records.get(task_id)
        return (record is not None and record.open
                and may_fly(record.task, record.failed_on, reports[uav_id]))

    usable = {uav_id: tasks for uav_id, tasks in chosen.routes.items() if uav_id in reports}
    return repaired_routes(usable, world.locked(), allowed)


def explain(world: World, left: Mapping[str, str], stamp: float) -> None:
    """The state and the reason of every open task, from the lists and what is left out."""
    owners = world.lists.owners()
    usable = frozenset(u for u in world.fleet.records if world.fleet.usable(u))
    for record in world.tasks.open():
        uav_id = owners.get(record.task.id, '')
        if uav_id:
            active = world.fleet.active.get(uav_id) == record.task.id
            world.tasks.step(
                record.task.id,
                TaskTransition.START if active else TaskTransition.LIST,
                stamp,
                uav_id,
            )
        else:
            event, why = _why_left(world, record, usable, left)
            world.tasks.step(record.task.id, event, stamp, why=why)


def _why_left(world: World, record: TaskRecord, usable: frozenset[str],
              left: Mapping[str, str]) -> tuple[TaskTransition, str]:
    heard, allowed = world.fleet.records, record.task.allowed_uavs
    if not heard:
        return TaskTransition.WAIT, 'no UAV heard yet'
    if allowed is not None and not any(uav_id in heard for uav_id in allowed):
        return TaskTransition.LEAVE, (f'allowed for {", ".join(sorted(allowed))} only: '
                                      'not heard yet')
    stands = standing(known for known in world.fleet.standing()
                      if may_fly(record.task, record.failed_on, known.report))
    if not usable:
        return TaskTransition.LEAVE, stands or 'no UAV available'
    others = _restricted(record, usable).allowed_uavs
    if record.failed_on and others is not None and others.isdisjoint(usable):
        why = f'failed on {", ".join(record.failed_on)}; no other UAV that may fly it is available'
        return TaskTransition.LEAVE, '; '.join(filter(None, (why, stands)))
    if record.task.id in left:
        return TaskTransition.LEAVE, '; '.join(filter(None, (left[record.task.id], stands)))
    return TaskTransition.WAIT, record.reason or 'waits for the next plan'


def _uav(world: World, uav_id: str) -> Uav:
    return world.fleet.uav(uav_id, world.params.default_range, world.params.default_cruise_speed)


def _restricted(record: TaskRecord, usable: frozenset[str]) -> Task:
    """The task, kept from the UAVs that failed at it."""
    if not record.failed_on:
        return record.task
    allowed = usable if record.task.allowed_uavs is None else record.task.allowed_uavs
    return replace(record.task, allowed_uavs=allowed - frozenset(record.failed_on))


def held_plan(world: World, left: Mapping[str, str], like: Plan) -> Plan:
    """The lists in force as a plan, found as `like` was; its figures are those of the lists."""
    lists = world.lists.lists
    routes = {uav_id: each.task_ids for uav_id, each in lists.items()}
    value = math.fsum(world.tasks.records[task_id].task.value
                      for task_ids in routes.values() for task_id in task_ids)
    distance = math.fsum(each.distance for each in lists.values())
    return replace(like, routes=routes, unassigned=dict(left), value=value, distance=distance,
                   fit=fit(distance, value, like.penalty))
