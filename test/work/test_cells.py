# SPDX-License-Identifier: Apache-2.0
"""Crossings of rings, of which most edges lie far apart, are those of all pairs of edges."""
import math

import numpy as np
import pytest

from uav_task_alloc.geometry.polygon import edges
from uav_task_alloc.work.cells import crossings


def ring(x, y, radius, corners):
    turns = [2.0 * math.pi * k / corners for k in range(corners)]
    return [(x + radius * math.cos(turn), y + radius * math.sin(turn)) for turn in turns]


def crossings_of_all(rings):
    found, ends = [], [pair for each in rings for pair in edges(each)]
    for n, (a, b) in enumerate(ends):
        for c, d in ends[n + 1:]:
            along, beside = np.subtract(b, a), np.subtract(d, c)
            cross = along[0] * beside[1] - along[1] * beside[0]
            if abs(cross) <= 1e-12:
                continue
            x, y = np.subtract(c, a)
            t = (x * beside[1] - y * beside[0]) / cross
            u = (x * along[1] - y * along[0]) / cross
            if 0.0 < t < 1.0 and 0.0 < u < 1.0:
                found.append((a[0] + t * along[0], a[1] + t * along[1]))
    return found


@pytest.mark.parametrize('seed', range(8))
def test_crossings_are_those_of_all_pairs_of_edges_in_their_order(seed):
    rng = np.random.default_rng(seed)
    rings = [ring(*rng.uniform(0.0, 2000.0, 2), rng.uniform(50.0, 700.0), corners)
             for corners in rng.choice([3, 4, 12, 64], 9)]
    found = crossings([*rings, rings[0]])
    assert len(found) > 4
    assert found == crossings_of_all([*rings, rings[0]])


def test_no_rings_have_no_crossings():
    assert crossings([]) == []
