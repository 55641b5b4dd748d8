# SPDX-License-Identifier: Apache-2.0
"""The detector of conflicts: against a judge that samples, and on encounters known by hand."""
import math
import random

import numpy as np
import pytest

from uav_task_alloc import Separation
from uav_task_alloc.separation.conflicts import AcceptedRows, find_conflicts
from uav_task_alloc.separation.flight_legs import Flight, FlightLeg
from uav_task_alloc.separation.volumes import flight_volumes, rows_of_legs

RULE = Separation(10.0, 5.0, 0.0, 0.0)
STEP = 0.1  # [s] of the judge


def flight(name, *points, begin=0.0, speed=10.0, **leg):
    """A UAV that flies a polyline and lands at its end, so that it is gone."""
    return Flight(name, (FlightLeg(points, 't', lands=True, **leg),), points[0], speed,
                  begin=begin)


def conflicts(*flights, rule=RULE):
    return find_conflicts(flight_volumes(flights, rule), rule)


def test_head_on_at_one_height_is_a_conflict_where_they_meet():
    found, = conflicts(flight('a', (0, 0, 30), (100, 0, 30)),
                       flight('b', (100, 3, 30), (0, 3, 30)))
    assert found.flights == (0, 1)
    assert found.horizontal == pytest.approx(3.0)
    assert found.time == pytest.approx(5.0)


def test_a_layer_higher_it_is_none():
    assert not conflicts(flight('a', (0, 0, 30), (100, 0, 30)),
                         flight('b', (100, 0, 35), (0, 0, 35)))


def test_a_crossing_after_the_other_has_passed_is_a_conflict_only_within_the_time():
    one = flight('a', (0, 0, 30), (100, 0, 30))
    other = flight('b', (50, -50, 30), (50, 50, 30), begin=3.0)
    assert not conflicts(one, other)
    assert conflicts(one, other, rule=Separation(10.0, 5.0, 2.5, 0.0))
    # each may be off by a fifth of 10 s
    assert conflicts(one, other, rule=Separation(10.0, 5.0, 0.0, 0.2))


def test_one_that_overtakes_is_a_conflict():
    found, = conflicts(flight('a', (0, 0, 30), (100, 0, 30)),
                       flight('b', (-50, 0, 30), (200, 0, 30), speed=20.0))
    assert found.horizontal == pytest.approx(0.0, abs=1e-3)


def test_a_climb_through_the_height_of_another_is_a_conflict():
    assert conflicts(flight('a', (0, 0, 30), (100, 0, 30)),
                     flight('b', (0, 20, 10), (100, -20, 50)))
    assert not conflicts(flight('a', (0, 0, 30), (100, 0, 30)),
                         flight('b', (0, 20, 40), (100, -20, 50)))


def test_a_uav_that_serves_is_in_the_way_until_it_leaves():
    legs = (FlightLeg(((0, 0, 30), (50, 0, 30)), 't', 20.0),
            FlightLeg(((50, 0, 30), (50, 200, 30)), '', lands=True))
    server = Flight('a', legs, (0, 0, 30), 10.0)
    assert [each.legs for each in conflicts(
        server, flight('b', (0, -20, 30), (50, -4, 30), begin=10.0))] == [(0, 0)]
    assert not conflicts(server, flight('b', (0, -20, 30), (50, -4, 30), begin=40.0))


def test_a_uav_without_legs_stays_in_the_air_and_on_the_ground_it_is_not_in_the_way():
    waiting = Flight('a', (), (50, 0, 30))
    passing = flight('b', (0, 0, 30), (100, 0, 30), begin=1000.0)
    assert conflicts(waiting, passing)
    assert not conflicts(Flight('a', (), (50, 0, 30), in_air=False), passing)


def test_take_off_and_landing_are_columns():
    leg = FlightLeg(((0, 0, 0), (100, 0, 30), (200, 0, 0)), '', takes_off=True, lands=True)
    assert leg.flown() == ((0, 0, 0), (0, 0, 30), (100, 0, 30), (200, 0, 30), (200, 0, 0))


def sampled(leg):
    """Positions and times at multiples of the step, of (begin, start, end, speed)."""
    begin, a, b, speed = leg
    seconds = math.dist(a[:2], b[:2]) / speed
    times = STEP * np.arange(math.ceil(begin / STEP), math.floor((begin + seconds) / STEP) + 1)
    share = ((times - begin) / seconds)[:, None]
    return (1.0 - share) * np.array(a) + share * np.array(b), times


def judged(one, other, horizontal, vertical, lag):
    (p, s), (q, t) = sampled(one), sampled(other)
    near = np.abs(s[:, None] - t[None]) <= lag + 1e-9
    level = np.hypot(p[:, None, 0] - q[None, :, 0], p[:, None, 1] - q[None, :, 1])
    upright = np.abs(p[:, None, 2] - q[None, :, 2])
    return bool((near & (level < horizontal) & (upright < vertical)).any())


def random_leg(rng):
    a, b = ((rng.uniform(0.0, 300.0), rng.uniform(0.0, 300.0),
             rng.choice((20.0, rng.uniform(15.0, 35.0)))) for _ in 'ab')
    return rng.uniform(0.0, 20.0), a, b, rng.uniform(3.0, 20.0)


def test_no_conflict_that_a_judge_at_10_hz_sees_is_missed():
    rng, seen, in_vain = random.Random(5), 0, 0
    while seen < 60:
        one, other, lag = random_leg(rng), random_leg(rng), rng.choice((0.0, 1.0, 3.0))
        horizontal, vertical = rng.choice(((10.0, 5.0), (30.0, 10.0)))
        rule = Separation(horizontal, vertical, lag, 0.0)
        flights = [Flight(name, (FlightLeg((leg[1], leg[2]), 't'),), leg[1], leg[3], begin=leg[0])
                   for name, leg in (('a', one), ('b', other))]
        truth = judged(one, other, horizontal, vertical, lag)
        found = any(each.legs == (0, 0) for each in conflicts(*flights, rule=rule))
        assert found or not truth, (one, other, rule)
        seen += truth
        in_vain += found and not truth
    assert in_vain <= 1  # a minimum between two samples


def test_accepted_rows_find_what_the_sweep_finds():
    rng, rule = random.Random(7), Separation(10.0, 5.0, 2.0)
    for _ in range(200):
        flights = [flight(name, *(leg := random_leg(rng))[1:3], begin=leg[0], speed=leg[3])
                   for name in 'abc']
        table = AcceptedRows(rule)
        for k in (0, 1):
            for n, rows in enumerate(rows_of_legs(flights[k], rule)):
                table.add(rows, (k, n))
        rows = [row for some in rows_of_legs(flights[2], rule) for row in some]
        assert (table.conflict(rows, 2) is not None) == any(
            each.flights[1] == 2 for each in conflicts(*flights, rule=rule))
