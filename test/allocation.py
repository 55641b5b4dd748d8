# SPDX-License-Identifier: Apache-2.0
"""An allocator over virtual time, with a greedy replacement of the solver."""
import math
import time
from functools import partial
from itertools import pairwise

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.operator_desk import OperatorDesk, OrderTrial
from uav_task_alloc.allocator.order_requests import OrderAction, OrderRequest
from uav_task_alloc.allocator.records import (
    AnnouncementAction,
    TaskEvent,
    TaskEventKind,
    UavReport,
)
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.allocator.replanning.what_if import solve_what_if
from uav_task_alloc.allocator.state.fleet import may_fly
from uav_task_alloc.geometry.detour import detour
from uav_task_alloc.model import Leg, Plan, Task
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.work.pieces import Work


def greedy(uavs, tasks, zones=(), *, warm=None, locked=None, route_end='hold', **_):
    """Locked first, then the warm routes as they were, then each task to the nearest end."""
    place = {task.id: task for task in tasks}
    routes = {uav.id: list((locked or {}).get(uav.id, ())) for uav in uavs}
    given = {t for route in routes.values() for t in route}
    by_id = {uav.id: uav for uav in uavs}

    def can(uav, task):
        return may_fly(task, (), UavReport(uav.id, uav.position, capabilities=uav.capabilities))

    def end(uav_id):
        route = routes[uav_id]
        return place[route[-1]].end if route else by_id[uav_id].position

    for uav_id, route in (warm.routes if warm else {}).items():
        for task_id in route:
            if uav_id in routes and task_id in place and task_id not in given and can(
                    by_id[uav_id], place[task_id]):
                routes[uav_id].append(task_id)
                given.add(task_id)
    unassigned = {}
    for task in tasks:
        if task.id in given:
            continue
        able = [u for u in uavs if can(u, task)
                and math.isfinite(detour(end(u.id), task.position, zones)[0])]
        if not able:
            unassigned[task.id] = 'no UAV can'
            continue
        best = min(able, key=lambda u: math.dist(end(u.id), task.position))
        routes[best.id].append(task.id)
    return as_plan(uavs, place, zones, routes, unassigned, route_end, warm)


def as_plan(uavs, place, zones, routes, unassigned=None, route_end='hold', warm=None):
    """A Plan of these routes with legs around the zones."""
    legs = {}
    for uav in uavs:
        stops = [(uav.position,) * 2, *((place[t].position, place[t].end)
                                        for t in routes[uav.id])]
        if route_end == 'home' and len(stops) > 1:
            stops.append((uav.home or uav.position,) * 2)
        detours = [detour(a, b, zones) for (_, a), (b, _) in pairwise(stops)]
        legs[uav.id] = tuple(Leg(tuple(via), length) for length, via in detours)
    distance = sum(leg.length for route_legs in legs.values() for leg in route_legs) + sum(
        place[t].path_length for route in routes.values() for t in route)
    value = sum(place[t].value for route in routes.values() for t in route)
    return Plan({u: tuple(r) for u, r in routes.items()}, unassigned or {}, distance, value,
                fit=distance, legs=legs, returns=route_end == 'home',
                warm_started=warm is not None)


class AllocatorDriver:
    """Drives an allocator over virtual time: methods that wait move the clock.

    The budget of the real solver is CPU time, so that it finds as much on a loaded machine.
    """

    def __init__(self, saved=None, plan=greedy, terrain=None, **params):
        params.setdefault('background_budget', 0.0)
        params.setdefault('route_end', 'hold')
        params.setdefault('objective', 'distance')
        params.setdefault('list_interval', 0.0)
        if getattr(plan, '__module__', '') == 'uav_task_alloc.solver.solve':
            plan = partial(plan, clock=time.thread_time)
        self.now, self.plan, self.solves = 1000.0, plan, []
        self.core = Allocator(AllocatorParams(**params), self.now, saved, terrain)
        self.core.set_kernels_ready()
        self.world = self.core.world
        self.lists, self.history, self.notes, self.allocations = {}, [], [], []
        self.forgotten, self.levels = set(), {}  # levels of notes
        self.holds, self.proposals = {}, []

    def uav(self, uav_id, *position, **more):
        return self.world.update_uav(UavReport(uav_id, position, **more), self.now, self.now)

    def add(self, *tasks, action=AnnouncementAction.ADD):
        return self.world.announce(action, [task(t) for t in tasks], self.now, self.now)

    def cancel(self, *ids):
        return self.world.cancel(ids, self.now, self.now)

    def event(self, kind, task_id, uav_id, revision=None, reason=''):
        if revision is None:
            revision = self.world.lists.get(uav_id).revision
        return self.world.event(TaskEvent(task_id, uav_id, revision, TaskEventKind[kind], reason),
                                self.now, self.now)

    def desk(self):
        return OperatorDesk(self.core)

    def order(self, action, uav='', *tasks, **more):
        """Give an order, and solve what is to be solved for it; returns the answer."""
        desk, request = self.desk(), OrderRequest(
            OrderAction[action], uav, tasks, **{'operator': 'ann', **more})
        answer = desk.open(request, self.now, self.now)
        if isinstance(answer, OrderTrial):
            answer = desk.close(answer, solve_what_if(
                self.plan, answer.problem, self.world.params, lambda: False, lambda: 0.0),
                self.now, self.now)
        return answer

    def begin(self):
        """Let the burst settle; returns the problem that is due."""
        self.now += 1.01 * self.world.params.settle
        self.core.tick(self.now, self.now)
        problem = self.core.due(self.now, self.now)
        self.take()
        return problem

    def finish(self, problem):
        """Solve it and adopt the answer."""
        answer = planning.solve_problem(self.plan, problem, self.world.params, lambda: False)
        self.solves.append(problem.trigger)
        self.now += problem.budget
        self.core.adopt(answer, self.now, self.now)
        self.take()

    def settle(self, wait=0.0, report=True):
        """Solve until nothing is due; with `report` UAVs repeat their reports."""
        self.now += wait
        if report:
            for record in list(self.world.fleet.records.values()):
                self.world.update_uav(record.report, self.now, self.now)
        self.core.tick(self.now, self.now)
        while (problem := self.begin()) is not None:
            self.finish(problem)

    def take(self):
        out = self.core.collect()
        self.lists.update(out.lists)
        self.holds.update(out.holds)
        self.forgotten |= out.forgotten
        self.history += out.lists.values()
        self.notes += [note.text for note in out.notes]
        self.levels.update({note.text: note.level for note in out.notes})
        if out.proposal:
            self.proposals.append(out.proposal)
        if out.allocation:
            self.allocations.append(out.allocation)

    def route(self, uav_id):
        return self.lists[uav_id].task_ids

    def state(self, task_id):
        return self.world.tasks.records[task_id].state.name

    def reason(self, task_id):
        return self.world.tasks.records[task_id].reason


def task(what):
    """A task, work, or a task of an (id, x, y) triple."""
    return what if isinstance(what, (Task, Work)) else Task(
        what[0], (*map(float, what[1:3]), 50.0))
