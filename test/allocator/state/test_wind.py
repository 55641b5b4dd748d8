# SPDX-License-Identifier: Apache-2.0
"""The wind measured in gusts: what courses do not tell is not made up of their scatter."""
import math
import random
import statistics

import pytest

from uav_task_alloc.allocator.state.flight_pace import FlightPace
from uav_task_alloc.allocator.state.wind import WindEstimate

CRUISE, SEEDS, GUST_TIME = 15.0, range(20), 10.0  # [m/s], , [s]
EAST, NORTH, BACK = (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)


def seconds(speed, wind, course):
    """Of flight for each metre."""
    return 1.0 / FlightPace(speed, wind=wind).ground_speed(*course)


def error_of(seed, gusts, courses, asked, samples=90):
    """Share by which times on a course are off after a flight on others, 20 s on each in turn."""
    rng = random.Random(seed)
    strength, angle = rng.uniform(0.0, 5.0), rng.uniform(0.0, math.tau)
    speed = CRUISE * rng.uniform(0.9, 1.1)
    steady = strength * math.cos(angle), strength * math.sin(angle)
    estimate, kept = WindEstimate(), math.exp(-1.0 / GUST_TIME)
    gust = [rng.gauss(0.0, gusts) for _ in range(2)]
    for t in range(samples):
        gust = [kept * each + rng.gauss(0.0, gusts * math.sqrt(1.0 - kept * kept))
                for each in gust]
        x, y = courses[t // 20 % len(courses)]
        wind = steady[0] + gust[0], steady[1] + gust[1]
        fast, aside = 1.0 / seconds(speed, wind, (x, y)), rng.gauss(0.0, 0.15)
        estimate.add('a', CRUISE, (fast * x - aside * y, fast * y + aside * x), float(t))
    return abs(seconds(*estimate.of('a', CRUISE), asked) / seconds(speed, steady, asked) - 1.0)


@pytest.mark.parametrize('gusts', [1.0, 2.5])
@pytest.mark.parametrize('courses', [(EAST,), (EAST, (0.87, 0.5)), (EAST, NORTH)])
def test_in_gusts_the_way_back_is_predicted_as_far_as_the_courses_tell(gusts, courses):
    found = [error_of(seed, gusts, courses, BACK) for seed in SEEDS]
    assert statistics.median(found) < 0.2
    assert max(found) < 0.6  # with a wind made up of gusts: 40 times the time


@pytest.mark.parametrize(('gusts', 'median', 'most'), [(0.0, 0.01, 0.02), (1.0, 0.05, 0.2)])
def test_there_and_back_both_ways_are_predicted(gusts, median, most):
    found = [error_of(seed, gusts, (EAST, BACK), asked) for seed in SEEDS
             for asked in (EAST, BACK)]
    assert statistics.median(found) < median
    assert max(found) < most


def test_without_samples_there_is_no_wind_and_none_is_left_of_a_uav_that_is_gone():
    estimate = WindEstimate()
    assert estimate.wind == (0.0, 0.0)
    assert estimate.of('a', 12.0) == (12.0, (0.0, 0.0))
    for t in range(30):
        estimate.add('a', CRUISE, (10.0, 0.0), float(t))
    assert estimate.wind[0] < -1.0
    estimate.forget('a')
    assert estimate.of('a', 12.0) == (12.0, (0.0, 0.0))
