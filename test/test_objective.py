# SPDX-License-Identifier: Apache-2.0
"""The objective, eq 2.12, and its weights."""
import math

import pytest

from uav_task_alloc.errors import InvalidValue, UnknownName
from uav_task_alloc.model import Task, Uav
from uav_task_alloc.objective import (
    OBJECTIVES,
    Objective,
    Weights,
    check_objective,
    excess,
    fit,
    needs_time,
    response_time,
)

HERE = (0.0, 0.0, 0.0)


def test_fit_is_eq_2_12():
    assert fit(2000.0, 8.0, 3.0) == 0.01 * 2000.0 + 100.0 / 8.0 + 3.0


def test_weights_are_parameters():
    assert fit(2000.0, 8.0, 3.0, Weights(1.0, 0.0, 2.0)) == 2006.0


def test_the_fit_of_a_plan_that_serves_nothing_is_infinite():
    assert fit(0.0, 0.0, 0.0) == math.inf


def test_excess_counts_only_what_is_beyond_a_range():
    uavs = [Uav('a', (0.0, 0.0, 0.0), 100.0), Uav('b', (0.0, 0.0, 0.0), 50.0)]
    assert excess(uavs, [90.0, 80.0]) == 30.0


def test_a_negative_weight_is_refused():
    with pytest.raises(InvalidValue, match=r'penalty weight = -1\.0: expected a number in'):
        Weights(penalty=-1.0)


@pytest.mark.parametrize(('wrong', 'text'), [
    ({'distance': -1.0}, 'objective: distance = -1.0: expected a number in [0, 1e+09]'),
    ({'finish': math.inf}, 'objective: finish = inf: expected a number in [0, 1e+09]'),
    ({'response': math.nan}, 'objective: response = nan: expected a number in [0, 1e+09]'),
    ({'lateness': -1.0}, 'objective: lateness = -1.0: expected a number in [0, inf]'),
    ({'unserved': 1e10},
     'objective: unserved = 10000000000.0: expected a number in [0, 1e+09], or inf'),
])
def test_a_coefficient_of_the_objective_out_of_range_is_refused(wrong, text):
    with pytest.raises(InvalidValue) as refused:
        Objective(**wrong)
    assert str(refused.value) == text


def test_the_cost_is_the_sum_of_its_terms():
    prices = Objective(0.5, 2.0, 3.0, 4.0, 5.0)
    assert prices.cost(10.0, 20.0, 30.0, 40.0, 50.0) == 5.0 + 40.0 + 90.0 + 160.0 + 250.0
    assert prices.coefficients.tolist() == [0.5, 2.0, 3.0, 4.0, 5.0]


def test_infinite_coefficients_are_rules_and_no_prices():
    assert Objective().cost(10.0, 20.0, 30.0, 40.0, 50.0) == 10.0


def test_an_objective_is_given_by_name_or_as_it_is():
    assert check_objective('finish') is OBJECTIVES['finish']
    mine = Objective(response=2.0)
    assert check_objective(mine) is mine
    with pytest.raises(UnknownName, match="objective 'fast': expected one of distance, finish"):
        check_objective('fast')
    with pytest.raises(InvalidValue, match='objective = 3: expected an Objective, or one of the'):
        check_objective(3)


def test_the_response_time_is_weighted_with_the_values_and_counts_from_the_announcement():
    tasks = [Task('a', HERE, 3.0, announced=-10.0), Task('b', HERE), Task('c', HERE, 4.0)]
    assert response_time(tasks, {'a': 20.0, 'b': 6.0}) == (3.0 * 30.0 + 6.0) / 8.0
    assert response_time([], {}) == 0.0


@pytest.mark.parametrize(('uav', 'task', 'objective', 'trips', 'needed'), [
    ({}, {}, Objective(), 1, False),
    ({}, {}, Objective(7.0, lateness=1.0), 1, False),
    ({}, {'earliest': 9.0, 'release': 9.0, 'service_time': 9.0}, Objective(), 1, False),
    ({'climb_speed': 2.0, 'available_from': 5.0}, {}, Objective(), 3, False),
    ({}, {'latest': 9.0}, Objective(), 1, True),
    ({}, {'payload': 0.1}, Objective(), 1, True),
    ({'endurance': 600.0}, {}, Objective(), 1, True),
    ({'available_until': 600.0}, {}, Objective(), 1, True),
    ({'turnaround': 60.0}, {}, Objective(), 1, False),
    ({'turnaround': 60.0}, {}, Objective(), 2, True),
    ({}, {}, Objective(unserved=5.0), 1, True),
    *(({}, {}, OBJECTIVES[name], 1, True) for name in ('finish', 'response', 'balanced')),
])
def test_time_is_needed_where_it_can_change_the_best_plan(uav, task, objective, trips, needed):
    fleet, tasks = [Uav('u', HERE), Uav('v', HERE, **uav)], [Task('t', HERE, **task)]
    assert needs_time(fleet, tasks, objective, trips) is needed
