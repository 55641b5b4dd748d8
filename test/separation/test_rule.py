# SPDX-License-Identifier: Apache-2.0
"""The rule of separation: its values are checked, either distance suffices."""
import pytest

from uav_task_alloc import Separation
from uav_task_alloc.allocator.replanning.from_now import separation_of
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.params import AllocatorParams


@pytest.mark.parametrize(('given', 'text'), [
    ({'horizontal': -1.0}, 'separation: horizontal = -1.0: expected a number in [0, 10000]'),
    ({'speed_error': 1.5}, 'separation: speed_error = 1.5: expected a number in [0, 1]'),
    ({'time': float('nan')}, 'separation: time = nan: expected a number in [0, 3600]'),
    ({'horizontal': 10.0}, 'separation: vertical = 0.0: expected more than 0 m where horizontal '
     '= 10 m; at 0 all UAVs are apart'),
])
def test_a_bad_value_is_refused_with_its_range(given, text):
    with pytest.raises(InvalidValue) as refused:
        Separation(**given)
    assert str(refused.value) == text


def test_the_horizontal_or_the_vertical_distance_suffices():
    rule = Separation(10.0, 5.0)
    assert rule.on
    assert rule.keeps(10.0, 0.0)
    assert rule.keeps(0.0, -5.0)
    assert not rule.keeps(9.9, 4.9)


def test_uncertainty_grows_with_time_up_to_the_horizon():
    rule = Separation(10.0, 5.0, 1.0, 0.2, 60.0)
    assert [rule.uncertainty(s) for s in (-1.0, 10.0, 60.0, 999.0)] == [0.0, 2.0, 12.0, 12.0]


def test_a_horizontal_distance_of_0_switches_it_off():
    assert not Separation().on


def test_the_allocator_takes_its_distances_from_its_parameters():
    assert not separation_of(AllocatorParams()).on
    params = AllocatorParams(separation__horizontal=10.0, separation__vertical=4.0,
                             separation__time=1.0)
    assert separation_of(params) == Separation(10.0, 4.0, 1.0)
