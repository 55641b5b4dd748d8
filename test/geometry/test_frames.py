# SPDX-License-Identifier: Apache-2.0
"""WGS84 to ENU and back, also over the earth's curvature."""
import random

import numpy as np
import pymap3d
import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import (
    Origin,
    to_enu,
    to_enu_batch,
    to_geodetic,
    to_geodetic_batch,
)

ZURICH = Origin(47.397742, 8.545594, 488.0)


def test_the_origin_is_zero():
    assert to_enu(ZURICH, 47.397742, 8.545594, 488.0) == pytest.approx((0, 0, 0), abs=1e-6)


def test_there_and_back_is_the_same_position():
    point = (4321.0, -1234.0, 87.0)
    assert to_enu(ZURICH, *to_geodetic(ZURICH, point)) == pytest.approx(point, abs=1e-6)


def test_level_in_enu_climbs_above_ground_with_distance():
    altitude = to_geodetic(ZURICH, (5000.0, 0.0, 0.0))[2]
    assert altitude - 488.0 == pytest.approx(1.96, abs=0.05)


def test_a_batch_converts_as_single_positions_do():
    points = np.array([(0.0, 0.0, 0.0), (100.0, 200.0, 30.0), (-3000.0, 50.0, 120.0)])
    places = to_geodetic_batch(ZURICH, points)
    assert places[1] == pytest.approx(to_geodetic(ZURICH, (100.0, 200.0, 30.0)))
    assert to_enu_batch(ZURICH, places) == pytest.approx(points, abs=1e-6)


def test_no_points_give_no_rows():
    assert to_enu_batch(ZURICH, []).shape == (0, 3)


def test_a_latitude_beyond_the_pole_is_refused():
    with pytest.raises(InvalidValue, match=r'origin latitude = 91.0: expected a number in \[-90'):
        Origin(91.0, 0.0)


def test_one_position_is_converted_bit_by_bit_as_by_pymap3d():
    rng = random.Random(5)
    for _ in range(20):
        origin = Origin(rng.uniform(-90.0, 90.0), rng.uniform(-180.0, 180.0),
                        rng.uniform(-100.0, 4000.0))
        for reach in (1e-4, 0.1, 20.0):
            place = (max(-90.0, min(90.0, origin.latitude + rng.uniform(-reach, reach))),
                     origin.longitude + rng.uniform(-reach, reach), rng.uniform(-100.0, 9000.0))
            assert to_enu(origin, *place) == pymap3d.geodetic2enu(
                *place, origin.latitude, origin.longitude, origin.altitude_amsl)
