# SPDX-License-Identifier: Apache-2.0
"""The objective, eq 2.12, and its weights."""
import math

import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Uav
from uav_task_alloc.objective import Weights, excess, fit


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
