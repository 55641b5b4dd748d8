# SPDX-License-Identifier: Apache-2.0
"""Sequential single-item auction: all UAVs bid on all unassigned tasks, the lowest bid wins.

A bid is the increase of the bidder's route length by cheapest insertion (BidSumPath of Lagoudakis
et al., Auction-Based Multi-Robot Routing, Robotics: Science and Systems 2005). The whole auction
is one iteration.
"""
from __future__ import annotations

import numpy as np

from uav_task_alloc.solver.baselines.bidder import Bidder
from uav_task_alloc.solver.baselines.leg_lengths import all_leg_lengths, routes_of
from uav_task_alloc.solver.recorder import Recorder


def solve(recorder: Recorder, seed: int, learnt: object = None) -> None:
    """Offer the auction's plan.

    Args:
        recorder: with the problem; takes the plan.
        seed: not used.
        learnt: not used.

    Raises:
        InvalidValue: there are too many tasks for a table of leg lengths.
    """
    problem = recorder.problem
    if problem.uavs and problem.tasks:
        recorder.offer(routes_of(problem, run_auction(recorder)))
    recorder.count()


def run_auction(recorder: Recorder) -> list[list[int]]:
    """Run the auction; returns the tasks of each UAV in order. O(n (n m + n^2 / m))."""
    problem = recorder.problem
    legs, m = all_leg_lengths(problem), len(problem.uavs)
    bidders = [Bidder(problem, u, legs) for u in range(m)]
    rows: list[list[int]] = [[] for _ in bidders]
    offers = [bidder.costs(()) for bidder in bidders]
    bids, places = np.array([o[0] for o in offers]), np.array([o[1] for o in offers])
    assigned: list[int] = []
    while not recorder.over():
        u, task = divmod(int(np.argmin(bids)), len(problem.tasks))
        if bids[u, task] == np.inf:
            break
        rows[u].insert(int(places[u, task]), task)
        assigned.append(task)
        bids[u], places[u] = bidders[u].costs(rows[u])  # the other routes have not changed
        bids[:, assigned] = np.inf
    return rows
