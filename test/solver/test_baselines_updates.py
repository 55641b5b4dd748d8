# SPDX-License-Identifier: Apache-2.0
"""The equations of the baselines, with values worked out by hand."""
import math

import numpy as np
import pytest

from uav_task_alloc import Task, Uav, plan
from uav_task_alloc.objective import excess, fit
from uav_task_alloc.solver.baselines import bee_colony, ga, paper_chain_q, q_learning
from uav_task_alloc.solver.baselines.population import Coding
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.routes import empty_routes


def on_a_line(starts, tasks):
    """UAVs u0, u1, ... and tasks t0, t1, ... at these metres."""
    return ([Uav(f'u{i}', (x, 0.0, 0.0)) for i, x in enumerate(starts)],
            [Task(f't{i}', (x, 0.0, 0.0)) for i, x in enumerate(tasks)])


def problem_of(uavs, tasks, rules=None):
    return make_problem(uavs, tasks, {}, Limits(), rules or Rules())


def ones(uavs, tasks):
    return paper_chain_q.Chains(np.ones((tasks, uavs, uavs)), np.ones((tasks, tasks, tasks)))


def test_both_chains_learn_by_eq_2_6_from_the_next_position():
    q = ones(2, 3)
    q.uav[1, 1] = 2.0, 3.0
    q.task[1, 2] = 4.0, 2.0, 9.0
    paper_chain_q.learn(q, np.array([1, 0]), np.array([2, 0]), 2, 0.5, 0.1, 0.5, 0.01,
                        np.empty(3, np.bool_))
    assert q.uav[0, 0, 1] == pytest.approx(1.0 + 0.1 * (0.5 + 0.5 * 3.0 - 1.0))
    assert q.task[0, 0, 2] == pytest.approx(1.0 + 0.1 * (0.5 + 0.5 * 4.0 - 1.0))  # 9: visited
    assert q.uav[1, 1, 0] == pytest.approx(2.0 + 0.1 * (0.5 - 2.0))  # no next step
    assert q.task[1, 2, 0] == pytest.approx(4.0 + 0.1 * (0.5 - 4.0))
    assert np.count_nonzero(q.uav != 1.0) == 3  # 1.1, 1.85 and the 3 set above
    assert np.count_nonzero(q.task != 1.0) == 4


def test_ranking_coefficients_sum_to_one_and_scale_alpha_as_in_eq_2_14():
    first, second = paper_chain_q.rank_coefficients(2, 0.5)
    assert (first, second) == pytest.approx((2.0 / 3.0, 1.0 / 3.0))
    assert paper_chain_q.rank_coefficients(7, 0.8).sum() == pytest.approx(1.0)
    q, chain = ones(1, 1), np.array([0])
    for coefficient, reward in ((first, 4.0), (second, 2.0)):
        paper_chain_q.learn(q, chain, chain, 1, reward, 0.3 * coefficient, 0.5, 0.01,
                            np.empty(1, np.bool_))
    assert q.task[0, 0, 0] == pytest.approx(1.6 + 0.1 * (2.0 - 1.6))  # 1 + 0.2 (4 - 1) = 1.6


def test_q_stays_above_its_floor():
    q, chain = ones(1, 1), np.array([0])
    paper_chain_q.learn(q, chain, chain, 1, 0.0, 1.0, 0.5, 0.01, np.empty(1, np.bool_))
    assert q.uav[0, 0, 0] == q.task[0, 0, 0] == 0.01


def test_probabilities_are_shares_of_open_q_as_in_eq_2_9_and_2_10():
    p = np.empty(3)
    assert paper_chain_q.probabilities(np.array([1.0, 3.0, 4.0]),
                                       np.array([True, True, False]), p)
    assert p.tolist() == [0.25, 0.75, 0.0]
    assert not paper_chain_q.probabilities(p, np.zeros(3, np.bool_), p)


def test_a_greedy_bee_takes_the_greatest_q_of_each_position_that_is_unvisited():
    problem = problem_of(*on_a_line([0.0, 5.0], [1.0, 2.0, 3.0]))
    q = ones(2, 3)
    q.uav[0, 0] = 1.0, 2.0
    q.uav[1, 1] = 3.0, 1.0
    q.task[:, :, 1] = 9.0  # at each position, but it is visited once only
    q.task[1, 1, 2] = 5.0
    routes, uavs, tasks = empty_routes(problem.arrays), np.zeros(3, int), np.zeros(3, int)
    scratch = paper_chain_q.Scratch(np.empty(2, np.bool_), np.empty(3, np.bool_), np.empty(2),
                                    np.empty(3))
    steps = paper_chain_q.fly_bee(problem.arrays, routes, uavs, tasks, q, 1.0, scratch,
                                  rng_state(1))
    assert (steps, uavs[:2].tolist(), tasks.tolist()) == (3, [1, 0], [1, 2, 0])


def test_single_agent_q_learning_is_eq_2_5():
    uavs, tasks = on_a_line([0.0], [100.0, 300.0])
    problem = problem_of(uavs, tasks)
    q = np.array([[-1.0, -3.0], [0.0, -2.0], [-2.0, 0.0]])
    q_learning.episode(problem.arrays, empty_routes(problem.arrays), q, 100.0, 0.5, 0.8, 1.0,
                       rng_state(1))
    assert q[0].tolist() == pytest.approx([-1.0 + 0.5 * (-1.0 + 0.8 * -2.0 + 1.0), -3.0])
    assert q[1].tolist() == pytest.approx([0.0, -2.0])  # reward -2, nothing ahead
    assert q[2].tolist() == [-2.0, 0.0]


def test_onlookers_choose_by_eq_2_8_with_one_over_fit():
    assert bee_colony.source_probabilities(np.array([1.0, 2.0, 4.0])) == pytest.approx(
        [4.0 / 7.0, 2.0 / 7.0, 1.0 / 7.0])
    assert bee_colony.source_probabilities(np.array([math.inf, math.inf])).tolist() == [0.5, 0.5]


def test_a_key_selects_the_uav_by_interval_and_the_order_by_size():
    coding = Coding(problem_of(*on_a_line([0.0, 9.0], [1.0, 2.0, 3.0, 4.0])))
    colony = bee_colony.AbcColony(coding, bee_colony.AbcSettings(), np.random.default_rng(1))
    row, uav_of = colony.decoded(np.array([[0.1, 0.9, 0.7, 0.0]]))
    assert uav_of.tolist() == [[0, 1, 1, 0]]
    assert row.tolist() == [[3, 0, 2, 1]]


@pytest.mark.parametrize('home', [False, True])
def test_rows_are_evaluated_as_the_routes_that_they_encode(home):
    rng = np.random.default_rng(7)
    uavs = [Uav(f'u{i}', (*rng.uniform(0.0, 900.0, 2), 0.0), 700.0, home=(0.0, 0.0, 50.0))
            for i in range(3)]
    tasks = [Task(f't{i}', (*rng.uniform(0.0, 900.0, 2), 9.0), 1.0 + i) for i in range(6)]
    coding = Coding(problem_of(uavs, tasks, Rules(returns=home, hard=False)))
    uav_of = rng.integers(0, 3, (20, 6))
    row = coding.rows(rng.permuted(np.tile(np.arange(6), (20, 1)), axis=1), uav_of)
    for k, fitness in enumerate(coding.fits(row, uav_of)):
        lengths = []
        for u, uav in enumerate(uavs):
            flown = [tasks[t].position for t in row[k] if uav_of[k, t] == u]
            stops = [uav.position, *flown, *([uav.home] if home and flown else [])]
            lengths.append(sum(map(math.dist, stops, stops[1:])))
        assert fitness == pytest.approx(fit(sum(lengths), 21.0, excess(uavs, lengths)))


def test_a_child_keeps_a_slice_and_takes_the_rest_in_the_others_order():
    child = ga.crossover(np.array([[0, 1, 2, 3, 4]] * 2), np.array([[4, 2, 0, 1, 3]] * 2),
                       np.array([1, 0]), np.array([3, 0]))
    assert child.tolist() == [[4, 1, 2, 0, 3], [4, 2, 0, 1, 3]]


def test_children_of_a_generation_serve_every_task_once_by_an_allowed_uav():
    uavs, tasks = on_a_line([0.0, 9.0], [1.0, 2.0, 3.0, 4.0])
    tasks.append(Task('only', (5.0, 0.0, 0.0), allowed_uavs=frozenset({'u1'})))
    population = ga.Population(Coding(problem_of(uavs, tasks)), ga.GaSettings(),
                               np.random.default_rng(1))
    best = population.fits.min()
    for _ in range(20):
        population.advance()
        assert (np.sort(population.row, axis=1) == np.arange(5)).all()
        assert (population.uav_of[:, 4] == 1).all()
        assert population.fits.min() <= best  # the elite is kept
        best = population.fits.min()


def test_nearest_balances_before_it_compares_lengths():
    result = plan(*on_a_line([0.0, 1000.0], [10.0, 20.0, 30.0]), solver='nearest')
    assert result.routes == {'u0': ('t0', 't1'), 'u1': ('t2',)}


def test_each_bid_of_the_auction_builds_on_what_was_won():
    result = plan(*on_a_line([0.0, 100.0], [40.0, 52.0, 90.0]), solver='auction')
    assert result.routes == {'u0': (), 'u1': ('t2', 't1', 't0')}  # 10 < 38 < 12 < u0's 40
