# SPDX-License-Identifier: Apache-2.0
"""Waiting places: where idle UAVs wait so that the next task is answered soonest."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.anticipation.intensity import Cells
from uav_task_alloc.kernel import inner_kernel, kernel

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


class Waiting(NamedTuple):
    """UAVs as the choice of waiting places sees them; m UAVs."""

    idle: _Floats  # (m) 1.0: may be sent to a place
    free_in: _Floats  # (m) [s] until a busy UAV is free; inf: takes no tasks
    x: _Floats  # (m) [m] where an idle UAV is, or a busy one will be free
    y: _Floats  # (m)
    speed: _Floats  # (m) [m/s]
    reach: _Floats  # (m) [m] that it may fly to a place at most
    place: _Floats  # (m, 2) [m] of each UAV: the result
    best: _Ints  # (m) scratch
    gain: _Floats  # (m) scratch


class MovePrices(NamedTuple):
    """What a move costs, in seconds of response time.

    A place serves the tasks that come until its UAV is sent to one. The larger the share of tasks
    to which it is nearest, the fewer they are: a price counts for the next task by that share.
    """

    way: float  # [s/s] for each second of flight to a place
    backup: float  # share of tasks that find their nearest UAV busy: the second one answers
    look_ahead: float  # [s] until the next task: busy UAVs are free by so much sooner
    hysteresis: float  # [s] that a new place must be better


MOVE_PRICES = MovePrices(0.25, 0.2, 250.0, 0.8)
ROUNDS = 6  # of best responses, at most


@kernel
def choose_places(cells: Cells, distance: _Floats, weight: _Floats, w: Waiting, prices: MovePrices,
                  rounds: int, scratch: _Floats) -> None:
    """Choose places by best responses in turn, until no UAV changes its place. O(rounds m c^2).

    The cost of a set of places is the expected time until a UAV is at the next task.

    Args:
        cells: centres are the places to choose from, beside the present one.
        distance: (c, c) [m] between cells.
        weight: (c) probability of the next task, times its value.
        w: place holds the present places of idle UAVs and is changed.
        prices: of moves.
        rounds: at most.
        scratch: (4, c).
    """
    for _ in range(rounds * w.idle.size):
        best = -1
        for u in range(w.idle.size):
            if w.idle[u] > 0.0:
                w.best[u], w.gain[u] = _best_response(cells, distance, weight, w, prices, u,
                                                      scratch)
                if w.gain[u] > 0.0 and (best < 0 or w.gain[u] > w.gain[best]):
                    best = u
        if best < 0:
            break
        w.place[best, 0], w.place[best, 1] = cells.x[w.best[best]], cells.y[w.best[best]]


@inner_kernel
def _best_response(cells: Cells, distance: _Floats, weight: _Floats, w: Waiting,
                   prices: MovePrices, u: int, scratch: _Floats) -> tuple[int, float]:
    """The best place of UAV u, and how much it is better [s]; -1, 0: none is. O(c^2)"""
    first, second, cost, nearest = scratch[0], scratch[1], scratch[2], scratch[3]
    _times_of_others(cells, w, prices, u, first, second)
    cost[:] = 0.0
    nearest[:] = 0.0
    present, nearest_here, slowness = 0.0, 0.0, 1.0 / w.speed[u]
    for c in range(cells.x.size):
        if weight[c] <= 0.0:
            continue
        a, b = first[c], second[c]
        here = math.hypot(cells.x[c] - w.place[u, 0], cells.y[c] - w.place[u, 1]) * slowness
        one, two = weight[c] * (1.0 - prices.backup), weight[c] * prices.backup
        present += one * min(a, here) + two * min(b, max(a, here))
        nearest_here += weight[c] if here < a else 0.0
        row = distance[c]
        for k in range(row.size):
            t = row[k] * slowness
            nearest[k] += weight[c] if t < a else 0.0
            low = t if t < a else a
            high = a if t < a else t
            cost[k] += one * low + two * (high if high < b else b)
    price = prices.way * slowness
    way = math.hypot(w.place[u, 0] - w.x[u], w.place[u, 1] - w.y[u])
    present += nearest_here * price * way
    best, least = -1, present - prices.hysteresis * nearest_here
    for k in range(cells.x.size):
        way = math.hypot(cells.x[k] - w.x[u], cells.y[k] - w.y[u])
        total = cost[k] + nearest[k] * price * way
        if total < least and way <= w.reach[u] and cells.inside[k] > 0.0:
            best, least = k, total
    return best, (present - least if best >= 0 else 0.0)


@inner_kernel
def _times_of_others(cells: Cells, w: Waiting, prices: MovePrices, u: int, first: _Floats,
                     second: _Floats) -> None:
    """The two least times [s] until a UAV other than u is at each cell. O(m c)"""
    longest = 3600.0  # [s] where there is no other
    first[:] = longest
    second[:] = longest
    for v in range(w.idle.size):
        if v == u or not w.free_in[v] < math.inf:
            continue
        idle = w.idle[v] > 0.0
        x, y = (w.place[v, 0], w.place[v, 1]) if idle else (w.x[v], w.y[v])
        ready = 0.0 if idle else max(0.0, w.free_in[v] - prices.look_ahead)
        for c in range(cells.x.size):
            t = ready + math.hypot(cells.x[c] - x, cells.y[c] - y) / w.speed[v]
            if t < first[c]:
                second[c] = first[c]
                first[c] = t
            elif t < second[c]:
                second[c] = t
