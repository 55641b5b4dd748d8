# SPDX-License-Identifier: Apache-2.0
"""Legs of UAVs between nodes: length, time, arrival; and which node follows which."""
from __future__ import annotations

import math

from uav_task_alloc.geometry.pairs import length
from uav_task_alloc.kernel import inline_kernel
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.path_times import path_seconds
from uav_task_alloc.solver.timed.ways import has_paths, way_length


@inline_kernel
def leg_of(a: TimedArrays, r: TimedRoutes, u: int, i: int, j: int) -> tuple[float, float]:
    """Length [m] and time [s] of UAV u's leg from node i to node j. O(1) once known.

    The length counts the path of node i, too.
    """
    return _leg(a, r, u, i, j, not a.straight)


@inline_kernel
def least_leg(a: TimedArrays, r: TimedRoutes, u: int, i: int, j: int) -> tuple[float, float]:
    """As `leg_of`, without zones. O(1)."""
    return _leg(a, r, u, i, j, False)


@inline_kernel
def _leg(a: TimedArrays, r: TimedRoutes, u: int, i: int, j: int,
         zones: bool) -> tuple[float, float]:
    """See `leg_of`; zones: the leg leads past them."""
    own = way_length(a, i)
    if j >= a.ends and j < a.bases:
        if i < a.uavs:
            return a.begin[u, at.EMPTY_LENGTH], a.begin[u, at.EMPTY_TIME]
        if not a.returns:
            return own, 0.0
    if has_paths(a):
        i, j = r.way[i, at.LEAVE], r.way[j, at.ENTER]
    x, y = a.fixed[j, at.X] - a.fixed[i, at.X], a.fixed[j, at.Y] - a.fixed[i, at.Y]
    if a.flat:
        metres = math.sqrt(x * x + y * y)
        if a.grain > 0.0:
            metres = math.floor(metres * a.grain) / a.grain
        return metres + own, metres * a.pace[u, 0]
    z = a.fixed[j, at.Z] - a.fixed[i, at.Z]
    square = x * x + y * y
    metres = math.sqrt(square + z * z)
    up = z * a.pace[u, 1] if z > 0.0 else -z * a.pace[u, 2]
    seconds = max(math.sqrt(square) * a.pace[u, 0], up)
    if not zones:
        return metres + own, seconds
    found = length(a.pairs, a.point[i], a.point[j])
    if found <= metres * (1.0 + 1e-12):
        return metres + own, seconds
    if found == math.inf:
        return found, found
    return found + own, path_seconds(a.pairs, a.times, a.speeds[u], a.point[i], a.point[j])


@inline_kernel
def after_leg(a: TimedArrays, departure: float, seconds: float, j: int) -> float:
    """Arrival at node j after a leg, not set out on before its release. O(1)."""
    release = a.fixed[j, at.RELEASE]
    return (departure if departure > release else release) + seconds


@inline_kernel
def slot_of(a: TimedArrays, head: int) -> int:
    """The slot of the trip with that head."""
    return head if head < a.uavs else a.uavs + head - a.bases


@inline_kernel
def join(a: TimedArrays, r: TimedRoutes, u: int, i: int, j: int) -> None:
    """Make node j follow node i in UAV u's route. O(1)."""
    r.link[i, at.NEXT], r.link[j, at.PREV] = j, i
    r.row[i, at.LEG], r.row[i, at.TIME] = leg_of(a, r, u, i, j)
    r.row[j, at.LEG_TO] = r.row[i, at.LEG]
