# SPDX-License-Identifier: Apache-2.0
"""The boxes near a segment are all that touch it, and few others."""
import random

import numpy as np
import pytest

from uav_task_alloc.geometry.box_grid import BoxGrid


def boxes(rng, count, size):
    low = np.array([(rng.uniform(-5e3, 5e3), rng.uniform(-5e3, 5e3), 0.0) for _ in range(count)])
    return low, low + [(rng.uniform(1.0, size), rng.uniform(1.0, size), 100.0)
                       for _ in range(count)]


@pytest.mark.parametrize('size', [50.0, 9e3])
@pytest.mark.parametrize('far', [100.0, 2e4])
def test_no_box_that_a_segment_touches_is_missed(size, far):
    rng = random.Random(f'{size} {far}')
    low, high = boxes(rng, 200, size)
    grid, spare = BoxGrid(low, high), []
    for _ in range(500):
        a = rng.uniform(-8e3, 8e3), rng.uniform(-8e3, 8e3), 50.0
        b = a[0] + rng.uniform(-far, far), a[1] + rng.uniform(-far, far), 50.0
        touch = np.flatnonzero((np.maximum(a, b) >= low).all(axis=1)
                               & (np.minimum(a, b) <= high).all(axis=1))
        near = set(grid.near(a, b))
        assert near.issuperset(touch.tolist())
        spare.append(len(near) - len(touch))
    if size < 100.0:
        assert sum(spare) / len(spare) < 5.0  # of 200


def test_a_segment_that_ends_at_the_corner_of_a_box_touches_it():
    low, high = np.array([(0.0, 0.0, 0.0), (900.0, 900.0, 0.0)]), np.array(
        [(1.0, 1.0, 9.0), (1e3, 1e3, 9.0)])
    assert 1 in BoxGrid(low, high).near((850.0, 850.0, 5.0), (900.0, 900.0, 5.0))


def test_of_no_boxes_none_is_near():
    assert list(BoxGrid(np.empty((0, 3)), np.empty((0, 3))).near((0, 0, 0), (1, 1, 1))) == []
