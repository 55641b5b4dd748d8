# SPDX-License-Identifier: Apache-2.0
"""Routes as linked lists in arrays, and the kernels that change them: O(1) a change.

Nodes: UAV starts 0..m-1, tasks m..m+n-1, route ends m+n..2m+n-1. Sums are float64.
"""
from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.geometry.distances import Pairs, length, length_via
from uav_task_alloc.kernel import inline_kernel, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Nodes = NDArray[np.uint32]  # unsigned: numba need not ask whether an index counts from the end
NODE: Any = np.uint32
WHOLE: Any = np.int64  # in kernels int() of an unsigned number is unsigned
DISTANCE, EXCESS, LEFT_OUT, VALUE, STRAIN = range(5)  # what Routes.sums holds
TINY = 1e-7  # [m] what rounding may add up to
STRICT = 1e9  # [m/m] at most this in sums, where inf would make NaN


class Arrays(NamedTuple):
    """A problem as kernels take it."""

    uavs: int
    ends: int  # first end node
    returns: bool  # routes end at home
    hard: bool  # no range is ever exceeded
    excess_floor: float  # [m] beyond range that no plan can avoid
    strain: Floats  # (m) [m/m] what a metre beyond range costs now; inf: none is allowed
    pairs: Pairs  # lengths by node
    straight: bool  # no zones: lengths are distances of xyz
    xyz: Floats  # (2m + n, 3) [m]
    reach: Floats  # (m) [m] range
    idle: Floats  # (m) [m] length of the route without tasks
    may: NDArray[np.bool_]  # (m, n) who may serve what
    picky: NDArray[np.bool_]  # (n) not everybody may
    value: Floats  # (n)
    price: Floats  # (n) [m] of leaving a task out now; 0: nobody can serve it
    dearest: Floats  # (n) [m] what that may rise to
    near: Nodes  # (n, k) task nodes, nearest first
    near_length: Floats  # (n, k) [m]
    starts: Nodes  # (n, s) starts, nearest first
    start_length: Floats  # (n, s) [m]


class Routes(NamedTuple):
    """Who flies what in which order; on[node] = -1: left out."""

    next: Nodes
    prev: Nodes
    on: Ints
    leg: Floats  # [m] length of the leg that leaves the node
    length: Floats  # (m) [m]
    tasks: Ints  # (m) tasks
    sums: Floats  # DISTANCE, EXCESS [m], LEFT_OUT [m], VALUE, STRAIN [m]


@inline_kernel
def step(a: Arrays, i: int, j: int) -> float:
    """Length [m] of the leg from node i to node j."""
    if j >= a.ends:
        if i < a.uavs:
            return float(a.idle[i])
        if not a.returns:
            return 0.0
    if a.straight:
        x, y, z = a.xyz[i, 0] - a.xyz[j, 0], a.xyz[i, 1] - a.xyz[j, 1], a.xyz[i, 2] - a.xyz[j, 2]
        return math.sqrt(x * x + y * y + z * z)
    return float(length(a.pairs, WHOLE(i), WHOLE(j)))


@kernel
def clear(a: Arrays, r: Routes) -> None:
    """Leave everything out."""
    r.on[:] = -1
    for u in range(a.uavs):
        end = a.ends + u
        r.next[u], r.prev[u], r.next[end], r.prev[end] = end, u, u, u
        r.on[u] = r.on[end] = u
        r.leg[u] = r.length[u] = a.idle[u]
        r.tasks[u] = 0
    total(a, r)


@kernel
def total(a: Arrays, r: Routes) -> None:
    """Sum up anew what changes only change. O(n)."""
    r.sums[:] = 0.0
    for u in range(a.uavs):
        r.sums[DISTANCE] += r.length[u]
        over = max(0.0, r.length[u] - a.reach[u])
        r.sums[EXCESS] += over
        r.sums[STRAIN] += min(a.strain[u], STRICT) * over
    for i in range(a.price.size):
        if r.on[a.uavs + i] < 0:
            r.sums[LEFT_OUT] += a.price[i]
        else:
            r.sums[VALUE] += a.value[i]


def empty_routes(a: Arrays) -> Routes:
    """Routes without tasks."""
    nodes = a.ends + a.uavs
    routes = Routes(np.empty(nodes, NODE), np.empty(nodes, NODE),
                    np.empty(nodes, np.int64), np.zeros(nodes), np.empty(a.uavs),
                    np.empty(a.uavs, np.int64), np.empty(5))
    clear(a, routes)
    return routes


@kernel
def copy(a: Any, b: Any) -> None:
    """Routes b become what routes a are."""
    for i in range(a.next.size):
        b.next[i], b.prev[i], b.on[i], b.leg[i] = a.next[i], a.prev[i], a.on[i], a.leg[i]
    for u in range(a.length.size):
        b.length[u], b.tasks[u] = a.length[u], a.tasks[u]
    for i in range(a.sums.size):
        b.sums[i] = a.sums[i]


def twin(a: Routes) -> Routes:
    """The same routes in arrays of their own."""
    return Routes(*[part.copy() for part in a])  # type: ignore[arg-type]


def cost_now(a: Arrays, r: Routes) -> float:
    """What the search makes small [m]."""
    return float(r.sums[DISTANCE] + r.sums[LEFT_OUT] + r.sums[STRAIN])


def better_now(a: Arrays, r: Routes, s: Routes) -> bool:
    """Whether r is better than s: more value; as much, then shorter; hard: within range."""
    if a.hard and not r.sums[EXCESS] <= a.excess_floor + TINY:
        return False
    gain = r.sums[VALUE] - s.sums[VALUE]
    slack = 1e-9 * (abs(s.sums[VALUE]) + 1.0)
    if gain > slack:
        return True
    shorter = s.sums[DISTANCE] - r.sums[DISTANCE]
    if not a.hard:
        shorter += s.sums[STRAIN] - r.sums[STRAIN]
    return bool(gain >= -slack and shorter > TINY + 1e-12 * s.sums[DISTANCE])


# of their own in kernels: handing arrays to a kernel takes 0.1 ms
cost, better = inline_kernel(cost_now), inline_kernel(better_now)


@inline_kernel
def lengthened(a: Arrays, r: Routes, u: int, delta: float) -> float:
    """Cost [m] of making UAV u's route longer by delta [m]; inf where it may not."""
    if not delta < math.inf:
        return math.inf
    before = r.length[u] - a.reach[u]
    after = before + delta
    if after <= TINY and before <= TINY:
        return delta
    return float(delta + a.strain[u] * (max(0.0, after) - max(0.0, before)))


@inline_kernel
def stretch(a: Arrays, r: Routes, u: int, delta: float) -> None:
    """Make UAV u's route longer by delta [m]."""
    before = r.length[u]
    r.length[u] = before + delta
    r.sums[DISTANCE] += delta
    over = max(0.0, before + delta - a.reach[u]) - max(0.0, before - a.reach[u])
    r.sums[EXCESS] += over
    r.sums[STRAIN] += min(a.strain[u], STRICT) * over


@inline_kernel
def insert(a: Arrays, r: Routes, t: int, after: int) -> None:
    """Put the left out task node t behind node `after`."""
    u, then = r.on[after], r.next[after]
    first, second = step(a, after, t), step(a, t, then)
    delta = first + second - r.leg[after]
    r.next[after], r.prev[t], r.next[t], r.prev[then] = t, after, then, t
    r.leg[after], r.leg[t] = first, second
    r.on[t] = u
    r.tasks[u] += 1
    stretch(a, r, u, delta)
    r.sums[LEFT_OUT] -= a.price[t - a.uavs]
    r.sums[VALUE] += a.value[t - a.uavs]


@inline_kernel
def _over(a: Arrays, r: Routes, before: int, t: int, then: int) -> float:
    """Length [m] of the way over t, which is kept where its points are."""
    found = float(length_via(a.pairs, WHOLE(before), WHOLE(t), WHOLE(then)))
    return found if found < math.inf else float(r.leg[before] + r.leg[t])


@inline_kernel
def remove(a: Arrays, r: Routes, t: int) -> None:
    """Take the task node t out of its route."""
    u, before, then = r.on[t], r.prev[t], r.next[t]
    direct = step(a, before, then)
    if direct == math.inf:  # a way that is not known leads over t
        direct = _over(a, r, before, t, then)
    delta = direct - r.leg[before] - r.leg[t]
    r.next[before], r.prev[then] = then, before
    r.leg[before] = direct
    r.on[t] = -1
    r.tasks[u] -= 1
    stretch(a, r, u, delta)
    r.sums[LEFT_OUT] += a.price[t - a.uavs]
    r.sums[VALUE] -= a.value[t - a.uavs]
