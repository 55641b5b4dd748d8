# SPDX-License-Identifier: Apache-2.0
"""A problem with time, and its routes, as arrays: one row a node.

columns.py names the columns.

With m UAVs, n tasks and b base visits of each UAV the nodes are: UAV starts 0..m-1, tasks
m..m+n-1, route ends m+n..2m+n-1, then b base visits for each UAV. A route is a doubly linked list
from its start to its end; a base visit in it ends one trip and begins the next. Each trip is
known by its head, the start or the base visit it begins with, and has a slot: the slot of a start
is its UAV, those of the base visits follow. In all kernels of this room `a` is the problem
(TimedArrays), `r` are routes (TimedRoutes), `u` is a UAV, `t` a task node. Times are in s, lengths
in m, loads in kg, all float64.
"""
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.geometry.outline import Floats, Ints
from uav_task_alloc.geometry.pairs import Pairs
from uav_task_alloc.solver.timed.path_times import PathTimes

Links = NDArray[np.uint32]  # unsigned: numba omits the check for negative indices
LINK: Any = np.uint32
TOLERANCE = 1e-7  # [s], [m] or [kg] of rounding


def aligned_zeros(rows: int, columns: int) -> Floats:
    """(rows, columns) of 0, each row of 8 columns within one line of the processor's cache."""
    room = np.zeros(rows * columns + 8)
    first = -room.ctypes.data % 64 // 8
    return room[first:first + rows * columns].reshape(rows, columns)


class TimedArrays(NamedTuple):
    """A problem as kernels take it: m UAVs, n tasks, k neighbours of each."""

    uavs: int
    ends: int  # first end node
    bases: int  # first base visit
    visits: int  # base visits of a UAV at most
    returns: bool  # routes end at home
    straight: bool  # no zones: legs are straight
    flat: bool  # all points at one altitude, or time follows from length alone
    timed_cost: bool  # the objective counts times, not only lengths
    whole: bool  # durations or trips matter: changed routes are computed from end to end
    grain: float  # lengths are cut to multiples of 1 / grain [m]; 0: they are not
    pairs: Pairs  # lengths by point
    times: PathTimes  # around zones
    point: Ints  # by node, then by end of a path: its index in Distances
    fixed: Floats  # (nodes and then ends of paths, columns from X)
    paths: NDArray[np.bool_]  # empty; of two dimensions where tasks have paths; ways.py
    far: Ints  # (n) row of the end of its path; of a point its node
    turnable: NDArray[np.bool_]  # (n) may be flown from its last point, too
    way_length: Floats  # (n) [m]
    along: Floats  # (classes of speeds, 2 n) [s] of service and path: from the first, the last
    pace: Floats  # (m, 3) [s/m] horizontally, up, down
    speeds: Ints  # (m) class of speeds
    begin: Floats  # (m, columns from READY)
    limit: Floats  # (slots, 4) columns from CARRIED: capacity, range, endurance
    compatible: NDArray[np.bool_]  # (slot kinds 2, m, n): in the first trip, in later ones
    restricted: NDArray[np.bool_]  # (n) some UAV may not serve it
    price: Floats  # (4) of excess of WARP, LOAD, RANGE, ENDURANCE; inf: not allowed
    unserved: Floats  # (n) cost of not serving a task
    weight: Floats  # (5) of the objective, columns from BY_DISTANCE; that of response is in WEIGHT
    near: Links  # (n, k) task nodes, nearest first
    near_length: Floats  # (n, k) [m]
    near_count: Ints  # (n) of neighbours
    near_class: Ints  # (n, c) classes of UAVs that are alike, nearest start first; -1: none
    members: Ints  # UAVs by class
    first_member: Ints  # (classes + 1)
    class_of: Ints  # (m)
    least_pace: float  # [s] of a way for each metre between its ends, at least
    least_cut: float  # [s] by which cut lengths shorten a way over two legs, at most
    gaps: bool  # TimedRoutes.gap is kept, of tasks in routes: pays where many have no place


class TimedRoutes(NamedTuple):
    """Routes of all UAVs."""

    link: Links  # (nodes, 4)
    row: Floats  # (nodes, columns from START)
    trip: Floats  # (slots, 4) columns from CARRIED
    route: Floats  # (m, columns from WARP)
    sums: Floats  # (10) columns from WARP, without END and TASKS
    counts: Ints  # (2)
    empty: Ints  # (classes) number of empty routes
    way: Links  # (nodes, 2) rows where each is entered and left
    reach: Floats  # (nodes, 2) columns INNER and OUTER, of tasks
    gap: Floats  # (nodes, 2) columns INNER and OUTER, of tasks; as asked for by TimedArrays.gaps
    idle: Ints  # (classes) index in TimedArrays.members of one that was empty lately


def node_count(a: TimedArrays) -> int:
    """How many nodes there are."""
    return a.bases + a.uavs * a.visits
