# SPDX-License-Identifier: Apache-2.0
"""The paper's learner where it decides where UAVs wait: a chained Q over cells for each UAV."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.anticipation.intensity import Cells
from uav_task_alloc.anticipation.places import MovePrices, Waiting
from uav_task_alloc.kernel import inner_kernel, kernel
from uav_task_alloc.solver.rng import RngState, uniform

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


class Learner(NamedTuple):
    """The tables of m UAVs over a grid of s x s cells, and memory for a round of b bees."""

    q: _Floats  # (m, s s, s s) response time saved [s]: by the cell where it is, the cell to go to
    across: int  # s
    corner: _Floats  # (2) [m] the south-west corner of the area
    side: _Floats  # (2) [m] of a cell
    choice: _Ints  # (b, m) cell that each bee sends each UAV to
    gain: _Floats  # (b) [s] saved a task
    rank: _Ints  # (b) bees by falling gain
    future: _Floats  # (k, 2) [m] of the tasks drawn for a round
    x: _Floats  # (m) [m] scratch
    y: _Floats  # (m)
    ready: _Floats  # (m)
    rounds: int
    tasks: int  # of a future; k is a multiple of it
    learning_rate: float  # alpha of eq 2.6
    discount: float  # gamma of eq 2.6
    rank_decay: float  # weight of a rank over that of the one before (eq 2.14)
    explore: float  # share of random choices


class LearnerSettings(NamedTuple):
    """The settings of a learner."""

    across: int = 5  # cells of its grid in each direction
    bees: int = 8  # of a round
    rounds: int = 6  # at each choice
    futures: int = 8  # drawn for each round
    tasks: int = 2  # of a future
    learning_rate: float = 0.1  # alpha of eq 2.6
    discount: float = 0.0  # gamma of eq 2.6
    rank_decay: float = 0.5  # weight of a rank over that of the one before (eq 2.14)
    explore: float = 0.2  # share of random choices


def make_learner(uavs: int, side: float, settings: LearnerSettings) -> Learner:
    """Tables that know nothing: staying is as good as any place.

    Args:
        uavs: of the fleet.
        side: [m] of the square area, its south-west corner at the origin.
        settings: of the learner.

    Returns:
        The learner.
    """
    n, s = settings.across * settings.across, settings
    return Learner(np.zeros((uavs, n, n)), s.across, np.zeros(2), np.full(2, side / s.across),
                   np.zeros((s.bees, uavs), np.int64), np.zeros(s.bees),
                   np.zeros(s.bees, np.int64), np.zeros((s.futures * s.tasks, 2)),
                   np.zeros(uavs), np.zeros(uavs), np.zeros(uavs), s.rounds, s.tasks,
                   s.learning_rate, s.discount, s.rank_decay, s.explore)


@kernel
def learn_places(cells: Cells, weight: _Floats, w: Waiting, q: Learner, prices: MovePrices,
                 rng: RngState) -> None:
    """Learn from futures drawn from the intensity, then send UAVs that choose by their Q.

    O(rounds b k m^2) and O(rounds k c).

    Args:
        cells: the area.
        weight: (c) probability of the next task.
        w: place is changed.
        q: is changed.
        prices: of moves.
        rng: is changed.
    """
    for _ in range(q.rounds if w.idle.sum() > 0.0 else 0):
        _draw_future(cells, weight, q, rng)
        staying = _response(w, q, prices, -1, -1)
        for b in range(q.gain.size):
            for u in range(w.idle.size):
                if _chooses(w, u):
                    q.choice[b, u] = _draw_choice(q, w, u, rng)
            q.gain[b] = staying - _response(w, q, prices, b, -1)
        _reinforce(w, q, prices)
    for u in range(w.idle.size):
        if _chooses(w, u):
            best = _best_choice(q, u, _cell(q, w.x[u], w.y[u]))
            s = _cell(q, w.x[u], w.y[u])
            if q.q[u, s, best] > q.q[u, s, s] + prices.hysteresis:
                w.place[u, 0], w.place[u, 1] = _centre_x(q, best), _centre_y(q, best)


@inner_kernel
def _chooses(w: Waiting, u: int) -> bool:
    """Whether UAV u is idle and at its place; on the way to one it goes on. O(1)"""
    way = math.hypot(w.place[u, 0] - w.x[u], w.place[u, 1] - w.y[u])
    return w.idle[u] > 0.0 and way < 1.0


@inner_kernel
def _reinforce(w: Waiting, q: Learner, prices: MovePrices) -> None:
    """Eq 2.14: move the Q of each bee's choices towards their gain, weighted by its rank.

    The gain of a choice is the response time that it saves against that UAV staying while the
    others do as the bee: a gain of all UAVs together teaches each what others did. O(b k m^2)
    """
    bees = q.gain.size
    for b in range(bees):
        q.rank[b] = b
    for i in range(1, bees):
        b, j = q.rank[i], i
        while j > 0 and q.gain[q.rank[j - 1]] < q.gain[b]:
            q.rank[j] = q.rank[j - 1]
            j -= 1
        q.rank[j] = b
    share = 1.0
    for i in range(bees):
        b = q.rank[i]
        for u in range(w.idle.size):
            if _chooses(w, u):
                s, a = _cell(q, w.x[u], w.y[u]), q.choice[b, u]
                gain = (_response(w, q, prices, b, u) - _response(w, q, prices, b, -1)
                        if a != s else 0.0)
                worth = gain + q.discount * q.q[u, a, _best_choice(q, u, a)]  # eq 2.6
                q.q[u, s, a] += q.learning_rate * share * (worth - q.q[u, s, a])
        share *= q.rank_decay


@inner_kernel
def _response(w: Waiting, q: Learner, prices: MovePrices, b: int, still: int) -> float:
    """Mean response time [s] of the futures and the price of the moves of bee b. O(k m)

    b: -1: all stay where they are; still: UAV that stays in any case.
    """
    total, moves = 0.0, 0.0
    for first in range(0, q.future.shape[0], q.tasks):
        for u in range(w.idle.size):
            q.x[u], q.y[u] = w.x[u], w.y[u]
            q.ready[u] = max(0.0, w.free_in[u] - prices.look_ahead)
            if w.idle[u] > 0.0:
                q.ready[u], q.x[u], q.y[u] = 0.0, w.place[u, 0], w.place[u, 1]
                moves_now = b >= 0 and u != still and _chooses(w, u)
                if moves_now and q.choice[b, u] != _cell(q, w.x[u], w.y[u]):
                    q.x[u], q.y[u] = _centre_x(q, q.choice[b, u]), _centre_y(q, q.choice[b, u])
                if first == 0 and _chooses(w, u):
                    moves += math.hypot(q.x[u] - w.x[u], q.y[u] - w.y[u]) / w.speed[u]
        for k in range(first, first + q.tasks):
            total += _answer(w, q, k, (k - first) * prices.look_ahead)
    return float(total / q.future.shape[0] + prices.way / w.idle.sum() * moves)


@inner_kernel
def _answer(w: Waiting, q: Learner, k: int, now: float) -> float:
    """The response time [s] of the UAV that is first at task k of a future, and send it. O(m)"""
    best, least = -1, math.inf
    for u in range(w.idle.size):
        way = math.hypot(q.future[k, 0] - q.x[u], q.future[k, 1] - q.y[u])
        t = max(0.0, q.ready[u] - now) + way / w.speed[u]
        if t < least:
            best, least = u, t
    q.ready[best] = now + least
    q.x[best], q.y[best] = q.future[k, 0], q.future[k, 1]
    return float(least)


@inner_kernel
def _draw_future(cells: Cells, weight: _Floats, q: Learner, rng: RngState) -> None:
    """Draw the places of tasks from the intensity. O(k c)"""
    total = 0.0
    for c in range(weight.size):
        total += weight[c]
    for k in range(q.future.shape[0]):
        wanted, c = uniform(rng) * total, 0
        while c < weight.size - 1 and wanted >= weight[c]:
            wanted -= weight[c]
            c += 1
        q.future[k, 0] = cells.x[c] + (uniform(rng) - 0.5) * cells.side[0]
        q.future[k, 1] = cells.y[c] + (uniform(rng) - 0.5) * cells.side[1]


@inner_kernel
def _draw_choice(q: Learner, w: Waiting, u: int, rng: RngState) -> int:
    """The cell with the largest Q, or any one with the probability `explore`. O(s s)"""
    if uniform(rng) < q.explore:
        return int(uniform(rng) * q.across * q.across)
    return _best_choice(q, u, _cell(q, w.x[u], w.y[u]))


@inner_kernel
def _best_choice(q: Learner, u: int, s: int) -> int:
    """The cell with the largest Q from a cell; it stays where nothing is better. O(s s)"""
    best = s
    for a in range(q.across * q.across):
        if q.q[u, s, a] > q.q[u, s, best]:
            best = a
    return best


@inner_kernel
def _cell(q: Learner, x: float, y: float) -> int:
    """The cell of a point. O(1)"""
    i = min(max(int((x - q.corner[0]) / q.side[0]), 0), q.across - 1)
    return min(max(int((y - q.corner[1]) / q.side[1]), 0), q.across - 1) * q.across + i


@inner_kernel
def _centre_x(q: Learner, cell: int) -> float:
    """[m] east. O(1)"""
    return float(q.corner[0] + (cell % q.across + 0.5) * q.side[0])


@inner_kernel
def _centre_y(q: Learner, cell: int) -> float:
    """[m] north. O(1)"""
    return float(q.corner[1] + (cell // q.across + 0.5) * q.side[1])
