# SPDX-License-Identifier: Apache-2.0
"""Lengths on demand, from kernels, and after points and zones were added, moved or removed."""
import math

import numba
import numpy as np
import pytest
from scenes import CLEARANCE, random_point, random_zones

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry import distances
from uav_task_alloc.geometry.detour import detour
from uav_task_alloc.geometry.distances import Distances
from uav_task_alloc.geometry.pairs import length
from uav_task_alloc.geometry.search_budget import SearchBudget
from uav_task_alloc.model import ThreatZone


@numba.njit(nogil=True)
def square(pairs, n):
    out = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            out[i, j] = length(pairs, i, j)
    return out


@pytest.fixture(scope='module')
def scene():
    rng = np.random.default_rng(3)
    zones = random_zones(rng, 6, False, 1500.0)
    return zones, np.array([random_point(rng, zones, 1500.0) for _ in range(30)])


def distances_among(points, zones):
    return Distances(points, zones, clearance=CLEARANCE)


def test_without_zones_lengths_are_straight(scene):
    points = scene[1]
    expected = np.linalg.norm(points[:, None] - points[None], axis=2)
    found = Distances(points)
    assert square(found.pairs, 30) == pytest.approx(expected)
    assert found.leg(0, 1).via == ()


def test_a_kernel_gets_the_lengths_of_detour(scene):
    zones, points = scene
    found = square(distances_among(points, zones).pairs, 30)
    for i, j in ((0, 1), (4, 7), (9, 2), (20, 21)):
        assert found[i, j] == detour(points[i], points[j], zones, clearance=CLEARANCE)[0]
    assert np.array_equal(found, found.T)
    assert np.all(np.diag(found) == 0)


def test_a_leg_has_the_length_that_kernels_get(scene):
    zones, points = scene
    found = distances_among(points, zones)
    for i in range(10):
        leg = found.leg(i, 29 - i)
        assert leg.length == found.length(i, 29 - i)
        line = np.array([points[i], *leg.via, points[29 - i]])
        assert np.linalg.norm(np.diff(line, axis=0), axis=1).sum() == pytest.approx(leg.length)


def test_a_point_inside_a_zone_can_be_left_but_not_reached():
    zone = ThreatZone.cylinder('z', (0, 0), 50)
    found = Distances([(10, 0, 5), (300, 0, 5)], [zone])
    assert found.length(0, 1) == pytest.approx(290, abs=0.5)
    assert found.length(1, 0) == math.inf
    assert found.leg(0, 1).via[0][0] == pytest.approx(50, abs=0.1)
    assert found.leg(1, 0) == distances.Leg((), math.inf)
    assert (found.zones_around(0), found.zones_around(1)) == (('z',), ())


def test_known_lengths_are_read_without_a_search():
    zone = ThreatZone.cylinder('z', (0, 0), 50)
    found = Distances([(10, 0, 5), (300, 0, 5), (300, 90, 5)], [zone])
    origins, goals = [0, 1, 1, 2, 2], [1, 0, 2, 1, 2]
    assert np.array_equal(found.known_lengths(origins, goals),
                          [math.nan, math.inf, math.nan, math.nan, 0.0], equal_nan=True)
    found.ensure([1], [2])
    assert np.array_equal(found.known_lengths(origins, goals),
                          [math.nan, math.inf, 90.0, 90.0, 0.0], equal_nan=True)
    assert Distances([(0, 0, 0), (3, 4, 0)]).known_lengths([0], [1]).tolist() == [5.0]


def test_changed_zones_invalidate_only_the_paths_they_cut(scene):
    zones, points = scene
    before = distances_among(points, zones)
    square(before.pairs, 30)
    other = random_zones(np.random.default_rng(8), 2, False, 1500.0)
    for change in ([*zones, other[0]], zones[1:], [other[1], *zones[2:]]):
        after = before.updated(zones=change)
        kept = np.isfinite(after._table.cells).sum()
        assert 0 < kept < 900
        assert square(after.pairs, 30) == pytest.approx(
            square(distances_among(points, change).pairs, 30), rel=1e-9)
    assert square(before.pairs, 30) == pytest.approx(
        square(distances_among(points, zones).pairs, 30))


def test_new_points_in_any_order_keep_known_lengths(scene):
    zones, points = scene
    before = distances_among(points, zones)
    known = square(before.pairs, 30)
    rng = np.random.default_rng(5)
    fresh = np.array([random_point(rng, zones, 1500.0) for _ in range(200)])
    for more in (fresh[:1], fresh):
        after = before.updated(points=np.vstack([points[20:], more, points[:10]]))
        tail = len(after.points) - 10
        assert after.length(0, tail) == known[20, 0]
        fewer = distances_among(np.vstack([more, points[20:21]]), zones)
        assert after.length(10, 0) == fewer.length(0, len(more))
    assert np.array_equal(square(before.pairs, 30), known)


def test_zones_may_be_added_to_none_and_all_removed(scene):
    zones, points = scene
    empty = Distances(points, clearance=CLEARANCE)
    assert np.array_equal(square(empty.updated(zones=zones).pairs, 30),
                          square(distances_among(points, zones).pairs, 30))
    assert np.array_equal(square(distances_among(points, zones).updated(zones=()).pairs, 30),
                          square(empty.pairs, 30))


def test_beyond_the_table_a_cache_gives_the_same_lengths(scene, monkeypatch):
    zones, points = scene
    dense = square(distances_among(points, zones).pairs, 30)
    monkeypatch.setattr(distances, 'DENSE_MAX', 10)
    cached = distances_among(points, zones)
    assert np.array_equal(square(cached.pairs, 30), dense)
    assert np.array_equal(square(cached.pairs, 30), dense)


def test_beyond_the_table_easy_paths_are_found_when_the_time_is_up(monkeypatch):
    monkeypatch.setattr(distances, 'DENSE_MAX', 0)
    zones = [ThreatZone.cylinder('a', (500.0, 0.0), 100.0),
             ThreatZone.cylinder('b', (500.0, 150.0), 100.0)]
    points = [(0.0, 0.0, 0.0), (0.0, 500.0, 0.0), (1000.0, -60.0, 0.0), (1000.0, 0.0, 0.0),
              (500.0, 0.0, 0.0), (1000.0, 10.0, 0.0)]
    limits = {'altitude_min': 0.0, 'altitude_max': 0.0}
    free, stopped = Distances(points, zones, **limits), SearchBudget(lambda: True)
    assert math.isfinite(free.length(0, 3))  # and keeps the path
    late = free.updated(budget=stopped)
    stopped.start_stage()
    assert stopped.is_exhausted
    straight, past_one, stored = (0, 1), (0, 2), (0, 3)
    for i, j in (straight, past_one, stored):
        assert late.length(i, j) == free.length(i, j), (i, j)
    past_both, to_inside, from_inside = (0, 5), (0, 4), (4, 0)
    for i, j in (past_both, to_inside, from_inside):
        assert late.length(i, j) == math.inf, (i, j)
    assert late.given_up(*past_both)


def test_ensured_pairs_are_known_at_once(scene):
    zones, points = scene
    found = distances_among(points, zones)
    found.ensure([0, 1], [5, 6])
    assert np.isfinite(found._table.cells).sum() == 4


def test_a_point_that_is_not_finite_is_refused():
    with pytest.raises(InvalidValue, match=r'points = .*expected finite coordinates'):
        Distances([(0, 0, math.nan)])
