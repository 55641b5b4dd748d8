# SPDX-License-Identifier: Apache-2.0
"""CBBA as a solver: every UAV is an agent of the consensus protocol, over a graph of links.

An agent's score of a path is what its tasks are worth less the way; a task's worth is its price,
so tasks are bid on where that is above the way that they add. An iteration is a round: both phases
of all agents.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uav_task_alloc.errors import UnknownName
from uav_task_alloc.solver.baselines.bidder import Bidder
from uav_task_alloc.solver.baselines.consensus import Agent, Graph, Score, diameter, one_round
from uav_task_alloc.solver.baselines.leg_lengths import all_ways, routes_of
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
    """Who hears whom and how much one bids for."""

    graph: str = 'ring'  # one of GRAPHS
    shares: float = 4.0  # L, tasks in a bundle at most, in fair shares (tasks over UAVs)


def make_graph(kind: str, agents: int) -> Graph:
    """Links of the named kind. Raises UnknownName."""
    if kind not in GRAPHS:
        raise UnknownName('graph', kind, list(GRAPHS))
    return [GRAPHS[kind](i, agents) for i in range(agents)]


def solve(recorder: Recorder, seed: int, learnt: object = None,
          settings: CbbaSettings | None = None) -> None:
    """Offer what the UAVs agree on. Raises InvalidValue where there are too many tasks."""
    problem, known = recorder.problem, settings or CbbaSettings()
    if not problem.uavs or not problem.tasks:
        return
    agents, now = make_agents(problem, known), 0
    graph = make_graph(known.graph, len(agents))
    bound = len(problem.tasks) * diameter(graph)  # rounds until they agree, as is proven
    while now <= bound and not recorder.over() and one_round(
            agents, graph, now + 1, recorder.over):
        now += 1
        recorder.count()
    recorder.offer(routes_of(problem, agreed(agents)))
    recorder.count()  # the round in which nobody had anything to tell


def make_agents(problem: Problem, settings: CbbaSettings) -> list[Agent]:
    """An agent for each UAV."""
    ways, n, m = all_ways(problem), len(problem.tasks), len(problem.uavs)
    most = math.ceil(settings.shares * n / m)
    return [Agent(u, m, n, _score(problem, Bidder(problem, u, ways)), most) for u in range(m)]


def _score(problem: Problem, bidder: Bidder) -> Score:
    """Worth of each task less what it costs."""
    worth = problem.arrays.price

    def gains(path: Sequence[int]) -> tuple[Floats, Ints]:
        cost, place = bidder.costs(path)
        return worth - cost, place
    return gains


def agreed(agents: Sequence[Agent]) -> list[list[int]]:
    """Paths, each task on that of its highest bidder only: time may end the talk too early."""
    bids = np.full((len(agents), agents[0].bid.size), -np.inf)
    for agent in agents:
        bids[agent.me, agent.bundle] = agent.bid[agent.bundle]
    winner = np.argmax(bids, axis=0)
    return [[task for task in agent.path if winner[task] == agent.me] for agent in agents]
