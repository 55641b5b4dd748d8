# SPDX-License-Identifier: Apache-2.0
"""CBBA as a solver: every UAV is an agent of the consensus protocol, over a graph of links.

An agent's score of a path is the worth of its tasks less the path length; a task's worth is the
cost of not serving it, so tasks are bid on where that exceeds the length that they add. An
iteration is a round: both phases of all agents.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uav_task_alloc.errors import UnknownName
from uav_task_alloc.solver.baselines.bidder import Bidder
from uav_task_alloc.solver.baselines.consensus import Agent, Graph, Score, diameter, one_round
from uav_task_alloc.solver.baselines.leg_lengths import all_leg_lengths, routes_of
from uav_task_alloc.solver.problem import Problem
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import Floats, Ints

GRAPHS: Mapping[str, Callable[[int, int], Sequence[int]]] = {  # neighbours of agent i of m
    'full': lambda i, m: [k for k in range(m) if k != i],
    'ring': lambda i, m: sorted({(i - 1) % m, (i + 1) % m} - {i}),
    'line': lambda i, m: [k for k in (i - 1, i + 1) if 0 <= k < m],
}


@dataclass(frozen=True, slots=True)
class CbbaSettings:
    """Communication graph and bundle size."""

    graph: str = 'ring'  # one of GRAPHS
    shares: float = 4.0  # L, tasks in a bundle at most, in fair shares (tasks over UAVs)


def make_graph(kind: str, agents: int) -> Graph:
    """Links of the named kind. Raises UnknownName."""
    if kind not in GRAPHS:
        raise UnknownName('graph', kind, list(GRAPHS))
    return [GRAPHS[kind](i, agents) for i in range(agents)]


def solve(recorder: Recorder, seed: int, learnt: object = None,
          settings: CbbaSettings | None = None) -> None:
    """Offer the plan that the agents agree on.

    Args:
        recorder: with the problem; takes the plan.
        seed: not used.
        learnt: not used.
        settings: None: the defaults.

    Raises:
        InvalidValue: there are too many tasks for a table of leg lengths.
    """
    problem, chosen = recorder.problem, settings or CbbaSettings()
    if not problem.uavs or not problem.tasks:
        return
    agents, now = make_agents(problem, chosen), 0
    graph = make_graph(chosen.graph, len(agents))
    bound = len(problem.tasks) * diameter(graph)  # rounds until agreement (Choi et al.)
    while now <= bound and not recorder.over() and one_round(
            agents, graph, now + 1, recorder.over):
        now += 1
        recorder.count()
    recorder.offer(routes_of(problem, agreed_paths(agents)))
    recorder.count()  # the round without changes


def make_agents(problem: Problem, settings: CbbaSettings) -> list[Agent]:
    """An agent for each UAV."""
    legs, n, m = all_leg_lengths(problem), len(problem.tasks), len(problem.uavs)
    most = math.ceil(settings.shares * n / m)
    return [Agent(u, m, n, _score(problem, Bidder(problem, u, legs)), most) for u in range(m)]


def _score(problem: Problem, bidder: Bidder) -> Score:
    """Gain of each task: its worth less its cost."""
    worth = problem.arrays.unassigned_cost

    def gains(path: Sequence[int]) -> tuple[Floats, Ints]:
        cost, place = bidder.costs(path)
        return worth - cost, place
    return gains


def agreed_paths(agents: Sequence[Agent]) -> list[list[int]]:
    """Paths with each task at its highest bidder only: the budget may end before agreement."""
    bids = np.full((len(agents), agents[0].bid.size), -np.inf)
    for agent in agents:
        bids[agent.me, agent.bundle] = agent.bid[agent.bundle]
    winner = np.argmax(bids, axis=0)
    return [[task for task in agent.path if winner[task] == agent.me] for agent in agents]
