# SPDX-License-Identifier: Apache-2.0
"""A problem with time, and its routes, as arrays: one row a node, and what the columns hold.

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

from uav_task_alloc.geometry.distances import Pairs
from uav_task_alloc.geometry.outline import Floats, Ints
from uav_task_alloc.solver.timed.path_times import PathTimes

Links = NDArray[np.uint32]  # unsigned: numba omits the check for negative indices
LINK: Any = np.uint32
TOLERANCE = 1e-7  # [s], [m] or [kg] of rounding

# columns of TimedArrays.fixed, by node
X, Y, Z, SERVICE, OPENS, CLOSES, RELEASE, LOAD = range(8)  # RELEASE: no earlier leg to it
TRIP_RELEASE, DUE, WEIGHT, WORTH, WIDTH, REMOTE = range(8, 14)
FIXED = 16
# columns of TimedArrays.begin, by UAV: ready for its first leg, time in the air by then, latest
# departure, length and time of its route without tasks, whether this trip began at the base,
# cruise speed, whether it has locked tasks
READY, IN_AIR, LAST_DEPARTURE, EMPTY_LENGTH, EMPTY_TIME, GROUNDED, CRUISE, HELD = range(8)
BEGIN = 8
# columns of TimedArrays.weight
# BY_END: of the end of each route, which leads the search to an early last one; BY_EXCESS: of a
# metre beyond range or endurance, inf: not allowed
BY_DISTANCE, BY_FINISH, BY_LATENESS, BY_END, BY_EXCESS = range(5)
# columns of TimedRoutes.link, by node
NEXT, PREV, UAV, HEAD = range(4)  # UAV: m where a task is in no route
# columns of TimedRoutes.row, by node
START, DEPARTURE, LATEST, WARP_BEFORE, WARP_AFTER, LEG, TIME, WAITS = range(8)
RATE, LOAD_BEFORE, LENGTH_BEFORE, LASTED, LEFT, LASTS, EARLY = range(8, 15)
ROW = 16
# columns of TimedRoutes.trip and TimedArrays.limit, by slot
CARRIED, FLOWN, AIRBORNE = range(3)  # load, length, duration
TRIP = 4
# columns of TimedRoutes.route, by UAV; WARP to ENDURANCE_EXCESS are also those of sums
WARP, LOAD_EXCESS, RANGE_EXCESS, ENDURANCE_EXCESS, METRES, TIME_COST, END, TASKS = range(8)
ROUTE = 8
FINISH, UNSERVED, SERVED_WORTH = range(6, 9)  # further columns of TimedRoutes.sums
SUMS = 9
# entries of TimedRoutes.count
INFEASIBLE, SERVED = range(2)  # routes with excess, tasks served


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
    point: Ints  # by node: its index in Distances
    fixed: Floats  # (nodes, FIXED)
    pace: Floats  # (m, 3) [s/m] horizontally, up, down
    speeds: Ints  # (m) class of speeds
    begin: Floats  # (m, BEGIN)
    limit: Floats  # (slots, TRIP) capacity, range, endurance
    compatible: NDArray[np.bool_]  # (slot kinds 2, m, n): in the first trip, in later ones
    restricted: NDArray[np.bool_]  # (n) some UAV may not serve it
    price: Floats  # (4) of excess of WARP, LOAD, RANGE, ENDURANCE; inf: not allowed
    unserved: Floats  # (n) cost of not serving a task
    weight: Floats  # (5) coefficients of the objective; that of response is in WEIGHT
    near: Links  # (n, k) task nodes, nearest first
    near_length: Floats  # (n, k) [m]
    near_count: Ints  # (n) of neighbours
    near_class: Ints  # (n, c) classes of UAVs that are alike, nearest start first; -1: none
    members: Ints  # UAVs by class
    first_member: Ints  # (classes + 1)
    class_of: Ints  # (m)


class TimedRoutes(NamedTuple):
    """Routes of all UAVs."""

    link: Links  # (nodes, 4)
    row: Floats  # (nodes, ROW)
    trip: Floats  # (slots, TRIP)
    route: Floats  # (m, ROUTE)
    sums: Floats  # (SUMS)
    count: Ints  # (2)
    empty: Ints  # (classes) number of empty routes
