# SPDX-License-Identifier: Apache-2.0
"""A fleet that answers tasks as they arrive, as a simulation of events; policies of waiting."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.anticipation.cover import Cover
from uav_task_alloc.anticipation.intensity import Cells, Estimates, density, observe
from uav_task_alloc.anticipation.places import ROUNDS, MovePrices, Waiting, choose_places
from uav_task_alloc.anticipation.response_lists import (
    Lists,
    Tasks,
    add_task,
    end_of_list,
    improve_lists,
    take_first,
)
from uav_task_alloc.anticipation.waiting_q import Learner, learn_places
from uav_task_alloc.kernel import inner_kernel, kernel
from uav_task_alloc.solver.rng import RngState

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]
STAY, BASE, EVEN, ORACLE, ASSIGN, LEARNT, CHAINED_Q = range(7)  # from ASSIGN on: what is learnt


class FleetTimes(NamedTuple):
    """What the lists do not hold of m UAVs."""

    service_end: _Floats  # (m) [s]; nan: in no service
    flown: _Floats  # (m) [m]
    waiting: _Floats  # (m) [m] of it to waiting places
    busy: _Floats  # (m) [s] in which it had a task, up to the end of arrivals
    clock: _Floats  # (1) [s]


class WaitingPolicy(NamedTuple):
    """Where idle UAVs wait."""

    kind: int  # STAY ... CHAINED_Q; ASSIGN: it stays
    base: _Floats  # (2) [m]
    review: float  # [s] between choices without an event
    prior: float  # tasks that the uniform prior is worth
    share: float  # of its weight that an estimate hands out at each task
    prices: MovePrices  # of moves to places


class Field(NamedTuple):
    """The area, what is known of its tasks, and memory of the kernels."""

    cells: Cells  # of the area
    distance: _Floats  # (c, c) [m]
    estimates: Estimates  # learnt, from ASSIGN on
    truth: _Floats  # (k, c) probability of the next task in equal parts of the run, for ORACLE
    truth_every: float  # [s] a part
    weight: _Floats  # (c) probability of the next task by the policy: scratch
    scratch: _Floats  # (4, c)


@kernel
def simulate(tasks: Tasks, lists: Lists, fleet: FleetTimes, policy: WaitingPolicy, field: Field,
             waiting: Waiting, learner: Learner, end: float, rng: RngState) -> None:
    """Fly all tasks of a run; `tasks.started`, `fleet.flown` and `fleet.busy` are the result.

    Every task whose service has not begun may move to another list at each arrival and at the end
    of each service, also while a UAV is on its way to it. O(events (n^3 + rounds m c^2)).

    Args:
        tasks: of the run.
        lists: empty, with the positions at its begin.
        fleet: zeros, service_end nan.
        policy: where idle UAVs wait.
        field: the area of work.
        waiting: memory for the choice; place holds the positions at the begin.
        learner: the tables of CHAINED_Q.
        end: [s] of arrivals.
        rng: of CHAINED_Q.
    """
    arrived, review = 0, policy.review
    while True:
        at, u = _next_service(tasks, lists, fleet)
        arrival = tasks.announced[arrived] if arrived < tasks.x.size else math.inf
        review = review if review < end else math.inf
        now = min(at, arrival, review)
        if now == math.inf:
            break
        _advance(tasks, lists, fleet, waiting, now, end)
        if now == review:
            review += policy.review
        elif now == arrival:
            if policy.kind >= ASSIGN:
                observe(field.cells, field.estimates, policy.prior, policy.share,
                        tasks.x[arrived], tasks.y[arrived], now, field.scratch[0])
            _weigh(policy, field, lists.cover, now)
            add_task(tasks, lists, arrived)
            arrived += 1
            improve_lists(tasks, lists)
        else:
            _serve(tasks, lists, fleet, waiting, u, now)
        _weigh(policy, field, lists.cover, now)
        _wait(tasks, lists, policy, field, waiting, learner, rng)


@inner_kernel
def _next_service(tasks: Tasks, lists: Lists, fleet: FleetTimes) -> tuple[float, int]:
    """The time [s] of the next begin or end of a service, and its UAV; inf: none. O(m)"""
    at, uav = math.inf, -1
    for u in range(lists.length.size):
        t = fleet.service_end[u]
        if math.isnan(t):
            if lists.length[u] == 0:
                continue
            k = lists.task[u, 0]
            way = math.hypot(tasks.x[k] - lists.x[u], tasks.y[k] - lists.y[u])
            t = fleet.clock[0] + way / lists.speed[u]
        if t < at:
            at, uav = t, u
    return at, uav


@inner_kernel
def _advance(tasks: Tasks, lists: Lists, fleet: FleetTimes, waiting: Waiting, now: float,
             end: float) -> None:
    """Fly all UAVs up to a time, to their first task or their waiting place. O(m)"""
    past = now - fleet.clock[0]
    for u in range(lists.length.size):
        serving = not math.isnan(fleet.service_end[u])
        if serving or lists.length[u] > 0:
            fleet.busy[u] += max(0.0, min(now, end) - fleet.clock[0])
        if serving:
            lists.free_in[u] = max(0.0, fleet.service_end[u] - now)
            continue
        x, y = waiting.place[u, 0], waiting.place[u, 1]
        if lists.length[u] > 0:
            x, y = tasks.x[lists.task[u, 0]], tasks.y[lists.task[u, 0]]
        way = math.hypot(x - lists.x[u], y - lists.y[u])
        step = min(way, past * lists.speed[u])
        if way > 0.0:
            lists.x[u] += (x - lists.x[u]) * step / way
            lists.y[u] += (y - lists.y[u]) * step / way
            fleet.flown[u] += step
            fleet.waiting[u] += step if lists.length[u] == 0 else 0.0
        if lists.length[u] > 0:  # where it waits if the task moves to another list
            waiting.place[u, 0], waiting.place[u, 1] = lists.x[u], lists.y[u]
    fleet.clock[0] = now


@inner_kernel
def _serve(tasks: Tasks, lists: Lists, fleet: FleetTimes, waiting: Waiting, u: int,
           now: float) -> None:
    """Begin or end a service of UAV u, which waits where it ends. O(n^3)"""
    if math.isnan(fleet.service_end[u]):
        k = take_first(lists, u)
        tasks.started[k] = now
        lists.x[u], lists.y[u] = tasks.x[k], tasks.y[k]
        lists.free_in[u] = tasks.service[k]
        fleet.service_end[u] = now + tasks.service[k]
        waiting.place[u, 0], waiting.place[u, 1] = lists.x[u], lists.y[u]
    else:
        fleet.service_end[u] = math.nan
        lists.free_in[u] = 0.0
        improve_lists(tasks, lists)


@inner_kernel
def _weigh(policy: WaitingPolicy, field: Field, cover: Cover, now: float) -> None:
    """Set where the policy takes the next task to be, also for the cover of lists. O(e c)"""
    if policy.kind == EVEN:
        field.weight[:] = 1.0 / field.weight.size
    elif policy.kind == ORACLE:
        part = min(int(now / field.truth_every), field.truth.shape[0] - 1)
        for c in range(field.weight.size):
            field.weight[c] = field.truth[part, c]
    elif policy.kind >= ASSIGN:
        density(field.cells, field.estimates, policy.prior, now, field.weight)
    cover.weight[:] = 0.0
    across = field.cells.across
    for c in range(field.weight.size):  # a place of the cover is the middle of 2 x 2 cells
        cover.weight[c // across // 2 * (across // 2) + c % across // 2] += field.weight[c]


@inner_kernel
def _wait(tasks: Tasks, lists: Lists, policy: WaitingPolicy, field: Field, waiting: Waiting,
          learner: Learner, rng: RngState) -> None:
    """Choose where idle UAVs wait. O(rounds m c^2)"""
    for u in range(lists.length.size):
        busy = lists.length[u] > 0 or lists.free_in[u] > 0.0
        waiting.idle[u] = 0.0 if busy else 1.0
        waiting.free_in[u], waiting.x[u], waiting.y[u] = end_of_list(tasks, lists, u)
        if policy.kind == BASE and not busy:
            waiting.place[u, 0], waiting.place[u, 1] = policy.base[0], policy.base[1]
    if policy.kind == CHAINED_Q:
        learn_places(field.cells, field.weight, waiting, learner, policy.prices, rng)
    elif policy.kind >= EVEN and policy.kind != ASSIGN:
        choose_places(field.cells, field.distance, field.weight, waiting, policy.prices, ROUNDS,
                      field.scratch)
