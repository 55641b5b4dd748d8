# SPDX-License-Identifier: Apache-2.0
"""Waiting places: where idle UAVs wait so that the next task is answered soonest."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.anticipation.intensity import Cells, cell_at
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


MOVE_PRICES = MovePrices(0.2, 0.2, 250.0, 0.8)
_LEAST, _SMALL, _MORE = 4, 8, 0.0125  # UAVs; [s/s] more for each that is missing
ROUNDS = 6  # of best responses, at most


def move_prices(uavs: int) -> MovePrices:
    """Return the prices of moves in a fleet.

    The places of a few UAVs are far from each other: at the price of a larger fleet they would
    fly a larger share of what they can.

    Args:
        uavs: of the fleet.

    Returns:
        With 4 to 7 UAVs a way costs more than in MOVE_PRICES; fewer were not measured.
    """
    more = _MORE * (_SMALL - uavs) if _LEAST <= uavs < _SMALL else 0.0
    return MOVE_PRICES._replace(way=MOVE_PRICES.way + more)


@kernel
def choose_places(cells: Cells, distance: _Floats, weight: _Floats, w: Waiting, prices: MovePrices,
                  rounds: int, scratch: _Floats) -> None:
    """Choose places: the best response of the UAV that gains most, until none gains.

    The cost of a set of places is the expected time until a UAV is at the next task.
    O(rounds m^2 c^2 / 4).

    Args:
        cells: the area of work; a place is inside of it. At least 6.
        distance: (c, c) [m] between cells; not read.
        weight: (c) probability of the next task, times its value.
        w: place holds the present places of idle UAVs and is changed.
        prices: of moves.
        rounds: at most.
        scratch: (4, c).
    """
    for _ in range(rounds * w.idle.size):
        best, most, x, y = -1, 0.0, 0.0, 0.0
        for u in range(w.idle.size):
            if w.idle[u] > 0.0:
                gain, to_x, to_y = _best_response(cells, weight, w, prices, u, scratch)
                if gain > most:
                    best, most, x, y = u, gain, to_x, to_y
        if best < 0:
            break
        w.place[best, 0], w.place[best, 1] = x, y


@inner_kernel
def _best_response(cells: Cells, weight: _Floats, w: Waiting, prices: MovePrices, u: int,
                   scratch: _Floats) -> tuple[float, float, float]:
    """How much better [s] the best place of UAV u is, and the place [m]. O(c^2 / 4)

    The middle of each block of 2 x 2 cells is tried, then points around the best of them.
    """
    _times_of_others(cells, w, prices, u, scratch[0], scratch[1])
    size = cells.x.size // 2
    x, y = scratch[3, :size], scratch[3, size:]
    x[0], y[0] = w.place[u, 0], w.place[u, 1]
    _costs(cells, weight, w, prices, u, 1, scratch)
    present = scratch[2, 0]
    wanted = present - prices.hysteresis * scratch[2, size]
    best, n = (math.inf, w.place[u, 0], w.place[u, 1]), 0
    for k in range(cells.x.size):
        if k % cells.across % 2 == 0 and k // cells.across % 2 == 0:
            x[n], y[n] = cells.x[k] + 0.5 * cells.side[0], cells.y[k] + 0.5 * cells.side[1]
            n += 1
        if n == size or k == cells.x.size - 1:
            best = _best_of(cells, weight, w, prices, u, n, scratch, best)
            n = 0
    for step in (0.5, 0.25):
        middle_x, middle_y = best[1], best[2]
        for i in range(-1, 2):
            for j in range(3):
                x[j] = middle_x + step * (j - 1) * cells.side[0]
                y[j] = middle_y + step * i * cells.side[1]
            best = _best_of(cells, weight, w, prices, u, 3, scratch, best)
    return (present - best[0] if best[0] < wanted else 0.0), best[1], best[2]


@inner_kernel
def _best_of(cells: Cells, weight: _Floats, w: Waiting, prices: MovePrices, u: int, n: int,
             scratch: _Floats, best: tuple[float, float, float]) -> tuple[float, float, float]:
    """The cost [s] and the point [m] of the best one so far and n more points. O(n c)"""
    _costs(cells, weight, w, prices, u, n, scratch)
    size = cells.x.size // 2
    for k in range(n):
        x, y = scratch[3, k], scratch[3, size + k]
        way = math.hypot(x - w.x[u], y - w.y[u])
        if scratch[2, k] < best[0] and way <= w.reach[u] and _inside(cells, x, y):
            best = (scratch[2, k], x, y)
    return best


@inner_kernel
def _inside(cells: Cells, x: float, y: float) -> bool:
    """Whether a point is in a cell of the area of work. O(1)"""
    c, half = cell_at(cells, x, y), 0.500001
    return bool(cells.inside[c] > 0.0 and abs(x - cells.x[c]) <= half * cells.side[0]
                and abs(y - cells.y[c]) <= half * cells.side[1])


@inner_kernel
def _costs(cells: Cells, weight: _Floats, w: Waiting, prices: MovePrices, u: int, n: int,
           scratch: _Floats) -> None:
    """The cost [s] of n places of UAV u, and the share of tasks it is nearest to. O(n c)

    scratch: times of others in two rows; costs and shares; the places.
    """
    size = cells.x.size // 2
    first, second = scratch[0], scratch[1]
    cost, nearest = scratch[2, :size], scratch[2, size:2 * size]
    x, y = scratch[3, :size], scratch[3, size:2 * size]
    slowness = 1.0 / w.speed[u]
    for k in range(n):
        cost[k] = 0.0
        nearest[k] = 0.0
    for c in range(cells.x.size):
        if weight[c] <= 0.0:
            continue
        a, b, at_x, at_y = first[c], second[c], cells.x[c], cells.y[c]
        one, two = weight[c] * (1.0 - prices.backup), weight[c] * prices.backup
        for k in range(n):
            dx, dy = x[k] - at_x, y[k] - at_y
            t = math.sqrt(dx * dx + dy * dy) * slowness
            nearest[k] += weight[c] if t < a else 0.0
            low = t if t < a else a
            high = a if t < a else t
            cost[k] += one * low + two * (high if high < b else b)
    price = prices.way * slowness
    for k in range(n):
        way = math.hypot(x[k] - w.x[u], y[k] - w.y[u])
        cost[k] += nearest[k] * price * way


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
