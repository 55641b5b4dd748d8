# SPDX-License-Identifier: Apache-2.0
"""CBBA: agents that receive only from neighbours agree within the rounds proven by its authors."""
from itertools import product

import numpy as np
import pytest
from optimum import subsets
from plan_checks import make

from uav_task_alloc.errors import UnknownName
from uav_task_alloc.solver.baselines.cbba import GRAPHS, CbbaSettings, make_agents, make_graph
from uav_task_alloc.solver.baselines.consensus import (
    NO_AGENT,
    RULES,
    Agent,
    ConsensusMessage,
    EntryAction,
    diameter,
    one_round,
)
from uav_task_alloc.solver.problem import Limits, Rules, make_problem

UPDATE, RESET, LEAVE = EntryAction.UPDATE, EntryAction.RESET, EntryAction.LEAVE


class Coverage:
    """A task's own worth and what it shows of a map, each cell counted once: gains diminish."""

    def __init__(self, own, worth, seen):
        self.own, self.worth, self.seen = own, worth, seen  # (tasks), (cells), (tasks, cells)

    def value(self, path):
        path = list(path)
        return float(self.own[path].sum() + self.worth[self.seen[path].any(axis=0)].sum())

    def __call__(self, path):
        """The score of an agent: gain of each task, and its place, which is always the end."""
        now, tasks = self.value(path), range(len(self.seen))
        gain = np.array([0.0 if t in path else self.value([*path, t]) - now for t in tasks])
        return gain, np.full(len(gain), len(path))


def make_scores(agents, tasks, seed, ties=False):
    """Agents that value tasks and cells differently; ties: cells are worth 1 to all."""
    rng = np.random.default_rng(seed)
    seen = rng.random((tasks, 12)) < 0.4
    return [Coverage(np.zeros(tasks), np.ones(12), seen) if ties else
            Coverage(rng.random(tasks), rng.uniform(0.5, 2.0, 12), seen) for _ in range(agents)]


def agree(scores, graph, most=None):
    """Agents after the protocol, and the rounds it took; a round too many fails."""
    tasks = len(scores[0].seen)
    agents = [Agent(i, len(scores), tasks, score, most or tasks)
              for i, score in enumerate(scores)]
    rounds = 0
    while one_round(agents, graph, rounds + 1):
        rounds += 1
        assert rounds <= min(tasks, (most or tasks) * len(scores)) * diameter(graph)
    return agents, rounds


def check_free_of_conflict(agents):
    """All have the same winners, and each path holds just the tasks won."""
    for agent in agents:
        assert (agent.winner == agents[0].winner).all()
        assert (agent.bid == agents[0].bid).all()
        assert sorted(agent.path) == np.flatnonzero(agents[0].winner == agent.me).tolist()
        assert sorted(agent.path) == sorted(agent.bundle)


def greedy(scores, most):
    """The central sequential greedy algorithm: always the greatest gain of all."""
    paths = [[] for _ in scores]
    while True:
        best = (0.0, 0, 0, 0)
        for i, score in enumerate(scores):
            gain, place = score(paths[i])
            gain[[t for path in paths for t in path]] = 0.0
            task = int(np.argmax(gain))
            if len(paths[i]) < most and gain[task] > best[0]:
                best = (gain[task], i, task, place[task])
        if best[0] == 0.0:
            return paths
        paths[best[1]].insert(best[3], best[2])


@pytest.mark.parametrize('kind', GRAPHS)
@pytest.mark.parametrize('seed', range(12))
def test_agents_agree_in_time_on_bids_that_none_can_beat(kind, seed):
    agents, tasks, most = 2 + seed % 5, 3 + seed % 7, 1 + seed % 4
    scores = make_scores(agents, tasks, seed)
    for limit in (tasks, most):
        found, _ = agree(scores, make_graph(kind, agents), limit)
        check_free_of_conflict(found)
        for score, agent in zip(scores, found, strict=True):
            gain, _ = score(agent.path)
            assert len(agent.path) == limit or (gain <= agent.bid + 1e-9).all()
            assert agent.bid[agent.path].sum() == pytest.approx(score.value(agent.path))


@pytest.mark.parametrize('kind', GRAPHS)
@pytest.mark.parametrize('seed', range(6))
def test_where_bids_do_not_depend_on_bundles_it_is_the_central_greedy_choice(kind, seed):
    scores = make_scores(5, 9, seed)
    assert [agent.path for agent in agree(scores, make_graph(kind, 5), 1)[0]] == greedy(scores, 1)
    for score in scores:
        score.worth[:] = 0.0
    for most in (2, 9):
        found, _ = agree(scores, make_graph(kind, 5), most)
        assert [agent.path for agent in found] == greedy(scores, most)


@pytest.mark.parametrize('kind', GRAPHS)
@pytest.mark.parametrize('seed', range(8))
def test_equal_bids_do_not_keep_agents_from_agreeing(kind, seed):
    found, _ = agree(make_scores(5, 7, seed, ties=True), make_graph(kind, 5))
    check_free_of_conflict(found)


@pytest.mark.parametrize('seed', range(10))
def test_the_agreement_has_at_least_half_the_value_of_the_optimum(seed):
    scores = make_scores(3, 7, seed)
    found, _ = agree(scores, make_graph('line', 3))
    reached = sum(score.value(agent.path) for score, agent in zip(scores, found, strict=True))
    best = optimum(scores)
    assert 0.5 * best <= reached <= best + 1e-9


def optimum(scores):
    """The greatest sum of values of disjoint sets of tasks."""
    everything = (1 << len(scores[0].seen)) - 1
    best = [0.0] * (everything + 1)
    for score in scores:
        alone = [score.value([t for t in range(len(score.seen)) if mine >> t & 1])
                 for mine in range(everything + 1)]
        best = [max(best[done ^ mine] + alone[mine] for mine in subsets(done))
                for done in range(everything + 1)]
    return best[everything]


def test_gains_that_grow_do_not_keep_agents_from_agreeing():
    for seed in range(6):
        uavs, tasks = make(5, 20, seed, reach=1500.0)
        problem = make_problem(uavs, tasks, {}, Limits(), Rules())
        for kind in GRAPHS:
            graph, rounds = make_graph(kind, 5), 0
            agents = make_agents(problem, CbbaSettings())
            while one_round(agents, graph, rounds + 1):
                rounds += 1
                assert rounds <= 20 * diameter(graph)
            check_free_of_conflict(agents)


def test_the_end_of_the_budget_ends_a_round_between_two_agents():
    scores, polls = make_scores(4, 6, 1), []
    agents = [Agent(i, 4, 6, score, 6) for i, score in enumerate(scores)]
    assert not one_round(agents, make_graph('ring', 4), 1, lambda: polls.append(1) or len(
        polls) > 2)
    assert [bool(agent.bundle) for agent in agents] == [True, True, False, False]


def test_diameters_of_the_graphs():
    assert make_graph('ring', 5) == [[1, 4], [0, 2], [1, 3], [2, 4], [0, 3]]
    assert [diameter(make_graph(kind, 6)) for kind in ('full', 'ring', 'line')] == [1, 3, 5]
    assert make_graph('ring', 1) == [[]]
    with pytest.raises(UnknownName, match="graph 'star': expected one of full, ring, line"):
        make_graph('star', 3)
    with pytest.raises(ValueError, match='expected all agents within reach'):
        diameter([[1], [0], []])


ME, K, M, N = 0, 1, 2, 3  # receiver, sender, others
TABLE = [  # sender's winner, receiver's; sender's bid is higher, newer about M, about N; action
    (K, ME, True, False, False, UPDATE), (K, ME, False, True, True, LEAVE),
    (K, K, False, False, False, UPDATE),
    (K, M, False, True, False, UPDATE), (K, M, True, False, False, UPDATE),
    (K, M, False, False, False, LEAVE), (K, NO_AGENT, False, False, False, UPDATE),
    (ME, ME, True, True, True, LEAVE), (ME, K, False, False, False, RESET),
    (ME, M, False, True, False, RESET), (ME, M, True, False, False, LEAVE),
    (ME, NO_AGENT, True, True, True, LEAVE),
    (M, ME, True, True, False, UPDATE), (M, ME, True, False, False, LEAVE),
    (M, ME, False, True, False, LEAVE),
    (M, K, False, True, False, UPDATE), (M, K, True, False, False, RESET),
    (M, M, False, True, False, UPDATE), (M, M, True, False, False, LEAVE),
    (M, N, False, True, True, UPDATE), (M, N, True, True, False, UPDATE),
    (M, N, False, True, False, LEAVE), (M, N, True, False, True, RESET),
    (M, N, True, False, False, LEAVE),
    (M, NO_AGENT, False, True, False, UPDATE), (M, NO_AGENT, True, False, False, LEAVE),
    (NO_AGENT, ME, False, True, True, LEAVE), (NO_AGENT, K, False, False, False, UPDATE),
    (NO_AGENT, M, False, True, False, UPDATE), (NO_AGENT, M, False, False, False, LEAVE),
    (NO_AGENT, NO_AGENT, False, True, True, LEAVE),
]


@pytest.mark.parametrize(('theirs', 'mine', 'higher', 'newer_m', 'newer_n', 'action'), TABLE)
def test_a_receiver_acts_by_table_1(theirs, mine, higher, newer_m, newer_n, action):
    agent = Agent(ME, 4, 1, None, 1)
    agent.winner[0], agent.bid[0], agent.updated[:] = mine, 5.0, 5
    bid = 6.0 if higher else 4.0
    agent.receive([ConsensusMessage(K, np.array([bid]), np.array([theirs]),
                                    np.array([5, 6, 6 if newer_m else 4, 6 if newer_n else 4]))])
    assert (agent.winner[0], agent.bid[0]) == {
        UPDATE: (theirs, bid), RESET: (NO_AGENT, 0.0), LEAVE: (mine, 5.0)}[action]


def test_table_1_covers_every_case():
    roles = ('sender', 'receiver', 'none', 'other')
    assert set(RULES) == {*product(roles, roles), ('other', 'same')}


def test_a_lost_task_releases_those_after_it():
    scores = make_scores(2, 4, 3)
    agent = Agent(0, 2, 4, scores[0], 4)
    agent.build()
    first, second, *after = agent.bundle
    winner, bid = np.full(4, NO_AGENT), np.zeros(4)
    winner[second], bid[second] = 1, 99.0
    agent.receive([ConsensusMessage(1, bid, winner, np.array([0, 1]))])
    assert agent.bundle == agent.path == [first]
    assert agent.winner[second] == 1
    assert (agent.winner[after] == NO_AGENT).all()
    assert not agent.bid[after].any()
