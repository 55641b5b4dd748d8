# SPDX-License-Identifier: Apache-2.0
"""Ways of tasks that have a path: from which end each is flown, its length and its time.

A task with a path has two rows in TimedArrays.fixed and `point`, one for each end: its node, and
`far`, beyond all nodes. TimedRoutes.way says of each node which row it is entered at and which it
is left from; of a point, and of other nodes, both are the node. The length of a path counts with
the leg after it, its time with the service. Kernels are compiled once
more for problems with paths, in which TimedArrays.paths has two dimensions: so those without are
solved as fast as if there were no paths.
"""
from __future__ import annotations

from typing import Any

import numpy as np

from uav_task_alloc.geometry.outline import Ints
from uav_task_alloc.kernel import inline_kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK, Links, TimedArrays, TimedRoutes

TURNED = 4  # added to the kind of a place: the task is flown from its last point
TURN_BIT: Any = np.uint32(1 << 31)  # in an order of nodes: the node is flown from its last point


@inline_kernel
def has_paths(a: TimedArrays) -> bool:
    """Whether some tasks have a path; known when kernels are compiled. O(1)."""
    return a.paths.ndim == 2


@inline_kernel
def is_task(a: TimedArrays, i: int) -> bool:
    """Whether node i is a task."""
    return a.uavs <= i < a.ends


@inline_kernel
def directions(a: TimedArrays, t: int) -> int:
    """In how many directions task t may be flown. O(1)."""
    return 2 if has_paths(a) and a.turnable[t - a.uavs] else 1


@inline_kernel
def face(a: TimedArrays, r: TimedRoutes, t: int, turned: bool) -> None:
    """Fly task t from its last point, or from its first. O(1).

    A task in a route has to be joined to its neighbours again.
    """
    far = a.far[t - a.uavs]
    r.way[t, at.ENTER] = far if turned else t
    r.way[t, at.LEAVE] = t if turned else far


@inline_kernel
def is_turned(a: TimedArrays, r: TimedRoutes, i: int) -> bool:
    """Whether node i is flown from its last point. O(1)."""
    return has_paths(a) and r.way[i, at.ENTER] != i


@inline_kernel
def service_of(a: TimedArrays, r: TimedRoutes, u: int, i: int) -> float:
    """Service [s] of UAV u at node i, with the flight along its path. O(1)."""
    if not has_paths(a) or not is_task(a, i):
        return float(a.fixed[i, at.SERVICE])
    return float(a.along[a.speeds[u], 2 * (i - a.uavs) + int(r.way[i, at.ENTER] != i)])


@inline_kernel
def way_length(a: TimedArrays, i: int) -> float:
    """Length [m] of the path of node i. O(1)."""
    return float(a.way_length[i - a.uavs]) if has_paths(a) and is_task(a, i) else 0.0


@inline_kernel
def nearest_ends(a: TimedArrays, t: int, s: int) -> tuple[float, float]:
    """Squared distance [m^2] of the nearest ends of two nodes; the same horizontally. O(1)."""
    least = flat = np.inf
    for k in range(4 if has_paths(a) else 1):
        i, j = t, s
        if k & 1 and is_task(a, t):
            i = a.far[t - a.uavs]
        if k & 2 and is_task(a, s):
            j = a.far[s - a.uavs]
        x, y = a.fixed[i, at.X] - a.fixed[j, at.X], a.fixed[i, at.Y] - a.fixed[j, at.Y]
        z = a.fixed[i, at.Z] - a.fixed[j, at.Z]
        flat = min(flat, x * x + y * y)
        least = min(least, x * x + y * y + z * z)
    return float(least), float(flat)


def first_ways(nodes: int, far: Ints, uavs: int) -> Links:
    """(nodes, 2) all tasks flown from their first points."""
    way = np.repeat(np.arange(nodes).astype(LINK)[:, None], 2, axis=1)
    way[uavs:uavs + len(far), at.LEAVE] = far
    return way
