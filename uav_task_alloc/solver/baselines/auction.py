# SPDX-License-Identifier: Apache-2.0
"""Sequential single item auction: each round all bid on all tasks left, the lowest bid wins.

A bid is what the task would add to the bidder's route at its cheapest place (Lagoudakis and
others, Auction-Based Multi-Robot Routing, 2005: BidSumPath, bids made by cheapest insertion). The
whole is one iteration.
"""
from __future__ import annotations

import numpy as np

from uav_task_alloc.solver.baselines.bidder import Bidder
from uav_task_alloc.solver.baselines.leg_lengths import all_ways, routes_of
from uav_task_alloc.solver.recorder import Recorder


def solve(recorder: Recorder, seed: int, learnt: object = None) -> None:
    """Offer the auction's plan. Raises InvalidValue where there are too many tasks."""
    problem = recorder.problem
    if problem.uavs and problem.tasks:
        recorder.offer(routes_of(problem, auction(recorder)))
    recorder.count()


def auction(recorder: Recorder) -> list[list[int]]:
    """Tasks of each UAV in order. O(n (n m + n^2 / m))."""
    problem = recorder.problem
    ways, m = all_ways(problem), len(problem.uavs)
    bidders = [Bidder(problem, u, ways) for u in range(m)]
    rows: list[list[int]] = [[] for _ in bidders]
    offers = [bidder.costs(()) for bidder in bidders]
    bids, places = np.array([o[0] for o in offers]), np.array([o[1] for o in offers])
    given: list[int] = []
    while not recorder.over():
        u, task = divmod(int(np.argmin(bids)), len(problem.tasks))
        if bids[u, task] == np.inf:
            break
        rows[u].insert(int(places[u, task]), task)
        given.append(task)
        bids[u], places[u] = bidders[u].costs(rows[u])  # nobody else's route has changed
        bids[:, given] = np.inf
    return rows
