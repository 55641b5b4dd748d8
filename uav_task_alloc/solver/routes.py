# SPDX-License-Identifier: Apache-2.0
"""Routes as doubly linked lists in arrays, and the kernels that change them in O(1).

With m UAVs and n tasks the nodes are: UAV starts 0..m-1, tasks m..m+n-1, route ends m+n..2m+n-1.
In all kernels of this package `a` is the problem (Arrays), `r` are routes (Routes), `u` is a UAV,
`t` a task node. Lengths are float64 [m]. """
from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.geometry.outline import Floats as Floats, Ints as Ints
from uav_task_alloc.geometry.pairs import Pairs, length, length_via
from uav_task_alloc.kernel import inline_kernel, kernel

Nodes = NDArray[np.uint32]  # unsigned: numba omits the check for negative indices
NODE: Any = np.uint32
SIGNED: Any = np.int64  # to int64: in kernels int() of an unsigned number is unsigned
DISTANCE, EXCESS, UNASSIGNED_COST, VALUE, RANGE_PENALTY = range(5)  # what Routes.sums holds
TINY = 1e-7  # [m] tolerance for accumulated rounding
PENALTY_CAP = 1e9  # [m/m] in sums: an infinite range penalty times 0 m would give NaN


class Arrays(NamedTuple):
    """A problem as kernels take it: m UAVs, n tasks, k neighbours and s starts for each task."""

    uavs: int  # m
    ends: int  # first end node
    returns: bool  # routes end at home
    hard: bool  # ranges are hard constraints
    excess_floor: float  # [m] excess over the ranges that no plan can avoid
    range_penalty: Floats  # (m) [m/m] current cost of a metre beyond range; inf: not allowed
    pairs: Pairs  # lengths by node
    straight: bool  # no zones: leg lengths are Euclidean distances of xyz
    xyz: Floats  # (2m + n, 3) [m]
    range_left: Floats  # (m) [m] range, less what locked tasks use
    empty_route_length: Floats  # (m) [m] length of the route without tasks
    compatible: NDArray[np.bool_]  # (m, n) whether a UAV may serve a task
    restricted: NDArray[np.bool_]  # (n) some UAV may not serve it
    value: Floats  # (n)
    unassigned_cost: Floats  # (n) [m] current cost of not serving a task; 0: no UAV can
    max_unassigned_cost: Floats  # (n) [m] upper bound of unassigned_cost
    near: Nodes  # (n, k) task nodes, nearest first
    near_length: Floats  # (n, k) [m]
    starts: Nodes  # (n, s) starts, nearest first
    start_length: Floats  # (n, s) [m]


class Routes(NamedTuple):
    """Routes of all UAVs; arrays by node have 2 m + n entries."""

    next: Nodes  # by node
    prev: Nodes  # by node
    uav_of: Ints  # by node; -1: unassigned
    leg: Floats  # by node [m] length of the leg that leaves it
    length: Floats  # (m) [m] of each route
    tasks: Ints  # (m) number of tasks of each route
    sums: Floats  # (5) DISTANCE, EXCESS [m], UNASSIGNED_COST [m], VALUE, RANGE_PENALTY [m]


@inline_kernel
def straight_length(a: Arrays, i: int, j: int) -> float:
    """Return the straight distance [m] of two nodes. O(1).

    Args:
        a: arrays of the problem.
        i: a node.
        j: a node.
    """
    x, y, z = a.xyz[i, 0] - a.xyz[j, 0], a.xyz[i, 1] - a.xyz[j, 1], a.xyz[i, 2] - a.xyz[j, 2]
    return math.sqrt(x * x + y * y + z * z)


@inline_kernel
def leg_length(a: Arrays, i: int, j: int) -> float:
    """Return the length of the leg between two nodes. O(1) where it is known.

    Args:
        a: arrays of the problem.
        i: node that it begins at.
        j: node that it ends at.

    Returns:
        [m]; 0 to an end node where routes do not return, inf where there is no path.
    """
    if j >= a.ends:
        if i < a.uavs:
            return float(a.empty_route_length[i])
        if not a.returns:
            return 0.0
    if a.straight:
        return straight_length(a, i, j)
    return float(length(a.pairs, SIGNED(i), SIGNED(j)))


@kernel
def clear(a: Arrays, r: Routes) -> None:
    """Make all routes empty. O(m + n).

    Args:
        a: arrays of the problem.
        r: routes, which are changed.
    """
    r.uav_of[:] = -1
    for u in range(a.uavs):
        end = a.ends + u
        r.next[u], r.prev[u], r.next[end], r.prev[end] = end, u, u, u
        r.uav_of[u] = r.uav_of[end] = u
        r.leg[u] = r.length[u] = a.empty_route_length[u]
        r.tasks[u] = 0
    update_sums(a, r)


@kernel
def update_sums(a: Arrays, r: Routes) -> None:
    """Recompute r.sums, which insert and remove update incrementally. O(m + n)."""
    r.sums[:] = 0.0
    for u in range(a.uavs):
        r.sums[DISTANCE] += r.length[u]
        over = max(0.0, r.length[u] - a.range_left[u])
        r.sums[EXCESS] += over
        r.sums[RANGE_PENALTY] += min(a.range_penalty[u], PENALTY_CAP) * over
    for i in range(a.unassigned_cost.size):
        if r.uav_of[a.uavs + i] < 0:
            r.sums[UNASSIGNED_COST] += a.unassigned_cost[i]
        else:
            r.sums[VALUE] += a.value[i]


def empty_routes(a: Arrays) -> Routes:
    """Make routes without tasks.

    Args:
        a: arrays of the problem.

    Returns:
        New arrays.
    """
    nodes = a.ends + a.uavs
    routes = Routes(np.empty(nodes, NODE), np.empty(nodes, NODE),
                    np.empty(nodes, np.int64), np.zeros(nodes), np.empty(a.uavs),
                    np.empty(a.uavs, np.int64), np.empty(5))
    clear(a, routes)
    return routes


@kernel
def copy_into(r: Any, out: Any) -> None:
    """Copy routes r into the arrays of routes `out`. O(m + n)."""
    for i in range(r.next.size):
        out.next[i], out.prev[i], out.uav_of[i] = r.next[i], r.prev[i], r.uav_of[i]
        out.leg[i] = r.leg[i]
    for u in range(r.length.size):
        out.length[u], out.tasks[u] = r.length[u], r.tasks[u]
    for i in range(r.sums.size):
        out.sums[i] = r.sums[i]


def copy(r: Routes) -> Routes:
    """The same routes in new arrays."""
    return Routes(*[array.copy() for array in r])  # type: ignore[arg-type]


def total_cost(a: Arrays, r: Routes) -> float:
    """Return the objective of the search.

    Args:
        a: arrays of the problem.
        r: routes with up-to-date sums.

    Returns:
        [m]: distance, cost of unassigned tasks and range penalty.
    """
    return float(r.sums[DISTANCE] + r.sums[UNASSIGNED_COST] + r.sums[RANGE_PENALTY])


def is_better(a: Arrays, r: Routes, s: Routes) -> bool:
    """Whether r has more value than s, or as much and is shorter; False beyond hard ranges."""
    if a.hard and not r.sums[EXCESS] <= a.excess_floor + TINY:
        return False
    gain = r.sums[VALUE] - s.sums[VALUE]
    slack = 1e-9 * (abs(s.sums[VALUE]) + 1.0)
    if gain > slack:
        return True
    shorter = s.sums[DISTANCE] - r.sums[DISTANCE]
    if not a.hard:
        shorter += s.sums[RANGE_PENALTY] - r.sums[RANGE_PENALTY]
    return bool(gain >= -slack and shorter > TINY + 1e-12 * s.sums[DISTANCE])


# versions for kernels; from Python a call costs 0.1 ms, because arrays are unboxed
total_cost_kernel, is_better_kernel = inline_kernel(total_cost), inline_kernel(is_better)


@inline_kernel
def lengthening_cost(a: Arrays, r: Routes, u: int, delta: float) -> float:
    """Return the cost of making a route longer. O(1).

    Args:
        a: arrays of the problem.
        r: routes.
        u: UAV of the route, in 0..m-1.
        delta: [m]; negative: shorter.

    Returns:
        [m]; inf where it is not allowed.
    """
    if not delta < math.inf:
        return math.inf
    before = r.length[u] - a.range_left[u]
    after = before + delta
    if after <= TINY and before <= TINY:
        return delta
    return float(delta + a.range_penalty[u] * (max(0.0, after) - max(0.0, before)))


@inline_kernel
def add_length(a: Arrays, r: Routes, u: int, delta: float) -> None:
    """Add delta [m] to the length of UAV u's route, and to the sums. O(1)."""
    before = r.length[u]
    r.length[u] = before + delta
    r.sums[DISTANCE] += delta
    over = max(0.0, before + delta - a.range_left[u]) - max(0.0, before - a.range_left[u])
    r.sums[EXCESS] += over
    r.sums[RANGE_PENALTY] += min(a.range_penalty[u], PENALTY_CAP) * over


@inline_kernel
def insert(a: Arrays, r: Routes, t: int, after: int) -> None:
    """Insert a task into a route. O(1).

    Args:
        a: arrays of the problem.
        r: routes, which are changed.
        t: node of an unassigned task.
        after: start or task node of a route.
    """
    u, then = r.uav_of[after], r.next[after]
    first, second = leg_length(a, after, t), leg_length(a, t, then)
    delta = first + second - r.leg[after]
    r.next[after], r.prev[t], r.next[t], r.prev[then] = t, after, then, t
    r.leg[after], r.leg[t] = first, second
    r.uav_of[t] = u
    r.tasks[u] += 1
    add_length(a, r, u, delta)
    r.sums[UNASSIGNED_COST] -= a.unassigned_cost[t - a.uavs]
    r.sums[VALUE] += a.value[t - a.uavs]


@inline_kernel
def _length_over(a: Arrays, r: Routes, before: int, t: int, then: int) -> float:
    """Length [m] of the path over t, which is stored with the known lengths. O(1)."""
    length_known = float(length_via(a.pairs, SIGNED(before), SIGNED(t), SIGNED(then)))
    return length_known if length_known < math.inf else float(r.leg[before] + r.leg[t])


@inline_kernel
def remove(a: Arrays, r: Routes, t: int) -> None:
    """Remove the task node t from its route. O(1)."""
    u, before, then = r.uav_of[t], r.prev[t], r.next[t]
    direct = leg_length(a, before, then)
    if direct == math.inf:  # no path is known: keep the one over t
        direct = _length_over(a, r, before, t, then)
    delta = direct - r.leg[before] - r.leg[t]
    r.next[before], r.prev[then] = then, before
    r.leg[before] = direct
    r.uav_of[t] = -1
    r.tasks[u] -= 1
    add_length(a, r, u, delta)
    r.sums[UNASSIGNED_COST] += a.unassigned_cost[t - a.uavs]
    r.sums[VALUE] -= a.value[t - a.uavs]
