# SPDX-License-Identifier: Apache-2.0
"""A camera says how far apart strips and photos are."""
import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.work.footprint import Camera, footprint

ONE_INCH = {'sensor_width': 0.0132, 'sensor_height': 0.0088, 'focal_length': 0.0088}


def test_strips_follow_from_the_height_and_the_overlap():
    # 13.2 x 8.8 mm at 8.8 mm and 100 m: 150 m x 100 m of ground
    found = footprint(Camera(**ONE_INCH, side_overlap=0.6, front_overlap=0.8), 100.0)
    assert found.strip_width == pytest.approx(60.0)
    assert found.trigger_distance == pytest.approx(20.0)


def test_the_height_of_the_camera_goes_before_that_of_the_flight():
    assert footprint(Camera(**ONE_INCH, height=50.0), 100.0) == footprint(
        Camera(**ONE_INCH), 50.0)


def test_a_ground_sample_distance_needs_no_height():
    found = footprint(Camera(ground_sample_distance=0.02, image_width=5000, image_height=4000,
                             side_overlap=0.5, front_overlap=0.75), -1.0)
    assert found.strip_width == pytest.approx(50.0)
    assert found.trigger_distance == pytest.approx(20.0)


@pytest.mark.parametrize(('given', 'text'), [
    ({}, 'camera: sensor_width = 0.0: expected it, or a ground_sample_distance'),
    ({'ground_sample_distance': 0.02, 'image_width': 4000}, 'camera: image_height = 0.0'),
    ({**ONE_INCH, 'side_overlap': 1.0}, r'camera: side_overlap = 1.0: expected .* \[0, 0.95\]'),
    ({**ONE_INCH, 'sensor_width': 13.2}, r'camera: sensor_width = 13.2'),
])
def test_what_is_missing_or_absurd_is_named(given, text):
    with pytest.raises(InvalidValue, match=text):
        Camera(**given)


def test_a_flight_below_the_origin_has_no_footprint():
    with pytest.raises(InvalidValue, match=r'camera: height = -5\.0'):
        footprint(Camera(**ONE_INCH), -5.0)
