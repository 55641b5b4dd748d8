# SPDX-License-Identifier: Apache-2.0
"""A sample of paths against the dense reference; benchmarks/detours.py has the full sweep."""
import math

import numpy as np
import pytest
from dense import Dense
from scenes import CLEARANCE, random_point, random_zones, violations

from uav_task_alloc.geometry.detour import detour
from uav_task_alloc.model import ThreatZone


def longer(zones, pairs, rng, side):
    """How much longer than the reference the bent paths of `pairs` random pairs are [%]."""
    dense, excess = Dense(zones, CLEARANCE, low=0.0, ring=24, tiers=5), []
    while len(excess) < pairs:
        a, b = random_point(rng, zones, side), random_point(rng, zones, side)
        length, points = detour(a, b, zones, clearance=CLEARANCE, altitude_min=0.0)
        if length < math.dist(a, b) * (1 + 1e-9):
            continue
        reference = dense.length(a, b)
        assert math.isinf(length) == math.isinf(reference)
        if math.isfinite(length):
            assert violations([a, *points, b], zones) == 0
            excess.append(100 * (length / reference - 1))
    return np.array(excess)


@pytest.mark.parametrize(('count', 'apart', 'side', 'worst'), [
    (1, True, 900.0, 2.0), (5, True, 1500.0, 2.0), (5, False, 1200.0, 5.0),
    (12, False, 2500.0, 5.0)])
def test_paths_are_hardly_longer_than_the_reference(count, apart, side, worst):
    rng = np.random.default_rng(count + apart)
    excess = np.concatenate([
        longer(random_zones(rng, count, apart, side), 3, rng, side) for _ in range(4)])
    assert np.median(excess) <= 0.5
    assert excess.max() <= worst


def test_the_reference_is_right_around_a_circle():
    zone = ThreatZone.cylinder('z', (0, 0), 80)
    exact = 2 * math.sqrt(250 ** 2 - 80 ** 2) + 160 * math.asin(80 / 250)
    assert Dense([zone]).length((-250, 0, 5), (250, 0, 5)) == pytest.approx(exact, rel=4e-3)


def test_a_denser_reference_gains_less_than_its_bound():
    rng = np.random.default_rng(4)
    gains = []
    for _ in range(4):
        zones = random_zones(rng, 3, False, 700.0, shapes='hcpe')
        a, b = random_point(rng, zones, 700.0), random_point(rng, zones, 700.0)
        coarse, fine = (Dense(zones, CLEARANCE, low=0.0, ring=ring, tiers=tiers).length(a, b)
                        for ring, tiers in ((24, 5), (48, 9)))
        gains.append(coarse / fine - 1)
    assert max(gains) <= 1 / math.cos(math.pi / 24) - 1
