# SPDX-License-Identifier: Apache-2.0
"""Routes rebuilt by labels, where few UAVs could serve more tasks than there is time for.

One after the other is replaced by the best one beside the other, if that is better.
"""
from __future__ import annotations

import numpy as np

from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import Links, TimedArrays, TimedRoutes
from uav_task_alloc.solver.timed.labels import (
    AT_NODE,
    BEFORE,
    LABELS,
    Labels,
    best_label,
    empty_labels,
)
from uav_task_alloc.solver.timed.order import set_order
from uav_task_alloc.solver.timed.search import BEST_WORTH, Incumbent
from uav_task_alloc.solver.timed.warm import fill_routes, no_routes

KEPT = 50  # labels at a task, at most
LEAST_KEPT = 5  # fewer find too little
MOST_LABELS = 200_000  # at the same time: some 40 MB with 1000 tasks
MOST_UAVS = 2  # with more of them it gains nothing: the routes of the others are in the way
TIME_PRICE = 0.6  # of a second, in what the best routes earn a second: which labels are kept


def rebuild(a: TimedArrays, r: TimedRoutes, best: Incumbent, prizes: bool, most: float) -> None:
    """Replace the best routes in turn, each by the best one beside the other, if that is better.

    Args:
        a: the problem, with the search's own prices.
        r: any routes; those of `best` after it.
        best: overwritten with what is better.
        prizes: whether tasks may be left out because they are not worth their way.
        most: labels that may be made, about; nothing is done where they are too few.
    """
    set_order(a, r, best.order)
    tasks, absent = a.ends - a.uavs, int((r.link[a.uavs:a.ends, at.OF_UAV] == a.uavs).sum())
    if (a.uavs > MOST_UAVS or absent == 0
            or a.whole or a.timed_cost or a.paths.ndim == 2 or a.visits > 0):
        return
    calls = 1 if a.uavs == 1 else 2 * a.uavs
    kept = min(KEPT, int(most / (LABELS * calls * (absent + (tasks - absent) / a.uavs))),
               MOST_LABELS // (2 * LABELS * tasks))
    closes = a.fixed[a.uavs:a.ends, at.CLOSES] + a.fixed[a.uavs:a.ends, at.SERVICE]
    ends = np.minimum(a.fixed[a.ends:a.ends + a.uavs, at.CLOSES], closes.max())
    if kept < LEAST_KEPT or not np.isfinite(ends).all():
        return
    room, stayed = empty_labels(tasks, kept), 0
    passed = r.row[a.ends:a.ends + a.uavs, at.START] - a.begin[:, at.READY]
    earned = a.unserved[r.link[a.uavs:a.ends, at.OF_UAV] < a.uavs].sum()
    price = TIME_PRICE * float(earned) / max(1e-9, float(passed.sum()))
    for call in range(calls):
        u, worth = call % a.uavs, float(best.score[BEST_WORTH])
        label = best_label(a, r, u, room, float(ends[u]), price)
        set_order(a, r, _with_route(a, best.order, u, room, label))
        fill_routes(a, r, no_routes(a), np.empty(0, np.int64), prizes, 0, best, rng_state(0))
        set_order(a, r, best.order)
        stayed = 1 if best.score[BEST_WORTH] > worth else stayed + 1
        if stayed == a.uavs:
            break


def _with_route(a: TimedArrays, order: Links, u: int, room: Labels, label: int) -> Links:
    """An order in which UAV u has the route that a label ends, instead of its own."""
    order, node = order.copy(), int(order[u])
    while node != a.ends + u:
        then = int(order[node])
        order[node], node = node, then
    while label >= 0:
        before = int(room.link[label, AT_NODE])
        order[before] = node
        node, label = before, int(room.link[label, BEFORE])
    return order
