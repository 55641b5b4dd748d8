# SPDX-License-Identifier: Apache-2.0
"""The rates of the clocks of a run, stated or measured."""
import pytest

from uav_task_alloc.record.time_scale import TimeScale


def scale(stated=0.0, simulated=False, *measured):
    made = TimeScale()
    made.state(stated, simulated)
    for rates in measured:
        made.measure(rates)
    return made


@pytest.mark.parametrize(('simulated', 'speedup', 'second'), [(False, 8.0, 1.0), (True, 1.0, 8.0)])
def test_the_time_of_a_record_is_real_time_or_that_of_the_scenario(simulated, speedup, second):
    made = scale(8.0, simulated)
    assert (made.rate, made.speedup, made.second) == (8.0, speedup, second)


def test_a_stated_rate_is_not_measured():
    assert scale(8.0, False, {'u1': 4.0}).rate == 8.0


@pytest.mark.parametrize(('rates', 'rate'), [
    ({'u1': 7.91, 'u2': 8.05, 'lost': 0.3}, 8.0), ({'u1': 5.51}, 5.51), ({'u1': 1.07}, 1.0),
    ({'u1': 0.95}, 1.0), ({'u1': 0.5}, 0.5), ({}, 1.0)])
def test_a_rate_that_is_not_stated_is_the_median_of_the_vehicles(rates, rate):
    assert scale(0.0, False, rates).rate == rate


def test_small_changes_of_a_measured_rate_are_noise():
    made = scale(0.0, True, {'u1': 5.5}, {'u1': 5.6}, {'u1': 5.4})
    assert (made.rate, made.second) == (5.5, 5.5)
    made.measure({'u1': 20.1})
    assert made.rate == 20.0


def test_the_newest_rate_of_each_vehicle_counts():
    assert scale(0.0, False, {'u1': 4.0, 'u2': 8.0}, {'u1': 8.0}).rate == 8.0
