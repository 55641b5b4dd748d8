# SPDX-License-Identifier: Apache-2.0
"""Idle UAVs spread where tasks are expected; a move must be worth its way and within reach."""
import math

import numpy as np
import pytest

from uav_task_alloc.anticipation.demand import Demand
from uav_task_alloc.anticipation.places import MOVE_PRICES, Waiting, choose_places, move_prices

DEMAND = Demand(np.zeros(2), np.full(2, 10_000.0))
CELLS = DEMAND.cells
DISTANCE = np.hypot(CELLS.x[:, None] - CELLS.x, CELLS.y[:, None] - CELLS.y)
EVEN = np.full(len(CELLS.x), 1.0 / len(CELLS.x))
CORNER = (300.0, 300.0)


def fleet(positions, idle=None, free_in=None, reach=math.inf):
    m = len(positions)
    at = np.array(positions)
    idle = np.ones(m) if idle is None else np.array(idle, float)
    return Waiting(idle, np.zeros(m) if free_in is None else np.array(free_in, float),
                   at[:, 0].copy(), at[:, 1].copy(), np.full(m, 15.0), np.full(m, reach),
                   at.copy(), np.zeros(m, np.int64), np.zeros(m))


def choose(waiting, weight=EVEN, **prices):
    choose_places(CELLS, DISTANCE, weight, waiting, MOVE_PRICES._replace(**prices), 6,
                  np.zeros((4, len(weight))))
    return waiting.place


def cost(places, weight=EVEN):
    """Expected time [s] until the nearest UAV is at the next task."""
    away = np.hypot(places[:, :1] - CELLS.x, places[:, 1:] - CELLS.y).min(0)
    return float((weight * away).sum()) / 15.0


def at_spot(x, y, spread=800.0):
    weight = np.exp(-0.5 * ((CELLS.x - x) ** 2 + (CELLS.y - y) ** 2) / spread ** 2)
    return weight / weight.sum()


def test_uavs_in_a_corner_spread_over_the_area():
    places = choose(fleet([CORNER] * 4), way=0.0, hysteresis=0.0, backup=0.0)
    assert cost(places) == pytest.approx(1913.0 / 15.0, rel=0.04)  # of the four quarters' centres


def test_places_follow_the_demand():
    places = choose(fleet([(5000.0, 5000.0)]), at_spot(8000.0, 2000.0))
    assert math.dist(places[0], (8000.0, 2000.0)) < 800.0


def test_a_dear_move_is_not_made():
    positions = [(5000.0, 5000.0)]
    assert choose(fleet(positions), at_spot(8000.0, 2000.0), way=10.0).tolist() == [[5e3, 5e3]]


def test_a_slightly_better_place_is_not_worth_a_move():
    here = [(4900.0, 5100.0)]
    assert choose(fleet(here), way=0.0, hysteresis=20.0).tolist() == [[4900.0, 5100.0]]


def test_no_place_is_beyond_reach_or_outside_the_area():
    demand = Demand(np.zeros(2), np.full(2, 10_000.0),
                    outside=np.flatnonzero(CELLS.x > 7000.0))
    waiting = fleet([(5000.0, 5000.0)] * 2, reach=1500.0)
    choose_places(demand.cells, DISTANCE, at_spot(9000.0, 5000.0), waiting,
                  MOVE_PRICES._replace(way=0.0), 6, np.zeros((4, len(EVEN))))
    ways = np.hypot(*(waiting.place - 5000.0).T)
    assert ways.max() <= 1500.0
    assert ways.max() > 500.0
    assert waiting.place[:, 0].max() <= 7000.0


def test_a_busy_uav_counts_where_and_when_it_will_be_free():
    weight = at_spot(8000.0, 8000.0)
    positions = [(2000.0, 2000.0), (8000.0, 8000.0)]
    soon = choose(fleet(positions, [1, 0], [0.0, 30.0]), weight, backup=0.0, way=0.25)
    assert math.dist(soon[0], (2000.0, 2000.0)) < 2500.0
    late = choose(fleet(positions, [1, 0], [0.0, 3600.0]), weight, backup=0.0)
    assert math.dist(late[0], (8000.0, 8000.0)) < 1000.0
    never = choose(fleet(positions, [1, 0], [0.0, math.inf]), weight, backup=0.0)
    assert math.dist(never[0], (8000.0, 8000.0)) < 1000.0


def test_a_place_is_not_bound_to_the_middles_of_cells():
    place = choose(fleet([(5000.0, 5000.0)]), at_spot(8130.0, 2040.0, 300.0), way=0.0)[0]
    assert math.dist(place, (8130.0, 2040.0)) < 160.0


def test_places_are_chosen_jointly_and_do_not_change_again():
    waiting = fleet([CORNER, (400.0, 9000.0), (9000.0, 400.0)])
    first = choose(waiting).copy()
    assert choose(waiting).tolist() == first.tolist()
    apart = [math.dist(a, b) for a, b in zip(first, np.roll(first, 1, 0), strict=True)]
    assert min(apart) > 2000.0


def test_a_way_costs_more_in_a_small_fleet():
    assert [move_prices(uavs).way for uavs in (3, 4, 6, 8, 16)] == pytest.approx(
        [0.2, 0.25, 0.225, 0.2, 0.2])
