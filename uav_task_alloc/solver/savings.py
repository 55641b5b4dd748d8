# SPDX-License-Identifier: Apache-2.0
"""First routes of UAVs that share bases: chains of tasks, joined where that saves most.

Clarke and Wright, Scheduling of Vehicles from a Central Depot to a Number of Delivery Points,
Operations Research 12 (1964). An auction opens too many routes there, as each is as near as any.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uav_task_alloc.kernel import kernel
from uav_task_alloc.solver.insertion import insert_cheapest_first
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.recombine import classes_of
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.routes import TINY, Arrays, Floats, Ints, Routes, empty_routes
from uav_task_alloc.solver.warm import repair, replay


class TaskChains(NamedTuple):
    """Routes of tasks 0..n-1 that are joined to longer ones; at first each task is one."""

    next: Ints  # task after it; -1: it is the last
    prev: Ints  # task before it; -1: it is the first
    other: Ints  # of the first task the last one, of the last the first
    length: Floats  # of the first task [m] of the route
    most: Floats  # of each task [m] that its route may have


@kernel
def join_chains(chains: TaskChains, near: Ints, savings: Floats, order: Ints) -> None:
    """Join chains within range, those that save most first. O(n k).

    Args:
        chains: which are changed.
        near: (n k) neighbours of each task in turn.
        savings: (n k) [m] of going on to that neighbour instead of beginning a route there.
        order: (n k) indices of savings, greatest first.
    """
    k = near.size // chains.next.size
    for x in order:
        if not savings[x] > 0.0:
            break
        last, first = x // k, near[x]
        if chains.next[last] >= 0 or chains.prev[first] >= 0 or chains.other[last] == first:
            continue
        head, tail = chains.other[last], chains.other[first]
        length = chains.length[head] + chains.length[first] - savings[x]
        if length <= chains.most[head] + TINY:
            chains.next[last], chains.prev[first] = first, last
            chains.other[head], chains.other[tail] = tail, head
            chains.length[head] = length


def offer_first(recorder: Recorder) -> None:
    """Offer the routes of an auction, and joined ones where UAVs share a base and time is left.

    Args:
        recorder: keeps the better ones.
    """
    recorder.offer(repair(recorder.problem, {}))
    in_time = recorder.elapsed() < recorder.budget
    joined = joined_routes(recorder.problem) if in_time else None
    if joined is not None:
        recorder.offer(joined)


def joined_routes(problem: Problem) -> Routes | None:
    """Join tasks to routes of the UAVs of the nearest bases; insert those left by auction.

    Args:
        problem: whose UAVs get the routes.

    Returns:
        Feasible routes; None where no two UAVs are alike.
    """
    a = problem.arrays
    if not a.near.shape[1] or len(np.unique(a.xyz[:a.uavs], axis=0)) == a.uavs:
        return None
    classes = classes_of(a)
    if len(np.unique(classes)) == a.uavs:
        return None
    base = classes[a.starts[:, 0]]  # of each task
    chains = _chains(a, np.unique(classes, return_index=True)[1][base], base)
    heads = np.flatnonzero(chains.prev < 0)
    nodes, bounds = list[int](), [0]
    rows = {int(head): _tasks_from(chains, int(head)) for head in heads}
    ranked = sorted(rows, key=lambda head: -float(a.value[rows[head]].sum()))
    of_base = [[head for head in ranked if base[head] == kind] for kind in range(base.max() + 1)]
    for kind in classes:
        waiting = of_base[kind] if kind < len(of_base) else []
        nodes += [a.uavs + t for t in rows[waiting.pop(0)]] if waiting else []
        bounds.append(len(nodes))
    routes = empty_routes(a)
    replay(a, routes, np.array(nodes, np.int64), np.array(bounds, np.int64))
    insert_cheapest_first(a, routes, rng_state(0))
    return routes


def _chains(a: Arrays, uav: Ints, base: Ints) -> TaskChains:
    """Join the tasks of each base.

    Lengths home are straight: a route that zones make too long loses tasks when it is written.

    Args:
        a: arrays of the problem.
        uav: (n) one UAV of the base of each task.
        base: (n) number of that base.
    """
    n, near = base.size, a.near.astype(np.int64) - a.uavs
    home = a.xyz[a.ends + uav] - a.xyz[a.uavs:a.ends]
    back = np.sqrt((home ** 2).sum(axis=1)) if a.returns else np.zeros(n)
    out = np.where(a.compatible[uav, np.arange(n)], a.start_length[:, 0], np.inf)
    with np.errstate(invalid='ignore'):  # of tasks that no path leads to: joined to none
        savings = back[:, None] + out[near] - a.near_length
    joins = np.isfinite(savings) & np.isfinite(out)[:, None] & (base[:, None] == base[near])
    savings = np.where(joins, savings, 0.0).ravel()
    chains = TaskChains(np.full(n, -1), np.full(n, -1), np.arange(n), out + back,
                        a.range_left[uav])
    join_chains(chains, near.ravel(), savings, np.argsort(-savings, kind='stable'))
    return chains


def _tasks_from(chains: TaskChains, task: int) -> list[int]:
    """The tasks of a chain from its first one on. O(tasks)."""
    found = [task]
    while (task := int(chains.next[task])) >= 0:
        found.append(task)
    return found
