# SPDX-License-Identifier: Apache-2.0
"""What a camera that looks straight down sees, and the strips and photos that follow from it."""
from __future__ import annotations

from dataclasses import dataclass

from uav_task_alloc.checks import check_number
from uav_task_alloc.errors import InvalidValue

SIDE_OVERLAP, FRONT_OVERLAP = 0.6, 0.75  # as surveys for maps usually have


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera that looks down, its wider side across the way.

    Either `ground_sample_distance` and the pixels, or the sensor, the focal length and the height
    say how much it sees.

    Attributes:
        sensor_width, sensor_height: [m].
        focal_length: [m].
        height: [m] above the ground; 0: that of the flight above the origin.
        ground_sample_distance: [m] of one pixel on the ground.
        image_width, image_height: [pixels].
        side_overlap: share of a strip that the next one sees as well.
        front_overlap: share of a photo that the next one on the way sees as well.

    Raises:
        InvalidValue: a value is out of range, or something is missing.
    """

    sensor_width: float = 0.0  # [m]
    sensor_height: float = 0.0  # [m]
    focal_length: float = 0.0  # [m]
    height: float = 0.0  # [m]
    ground_sample_distance: float = 0.0  # [m]
    image_width: float = 0.0  # [pixels]
    image_height: float = 0.0  # [pixels]
    side_overlap: float = SIDE_OVERLAP
    front_overlap: float = FRONT_OVERLAP

    def __post_init__(self) -> None:
        for name, high in (('sensor_width', 1.0), ('sensor_height', 1.0), ('focal_length', 10.0),
                           ('height', 1e4), ('ground_sample_distance', 100.0),
                           ('image_width', 1e6), ('image_height', 1e6), ('side_overlap', 0.95),
                           ('front_overlap', 0.99)):
            check_number(f'camera: {name}', getattr(self, name), 0.0, high)
        needed = (('image_width', 'image_height') if self.ground_sample_distance
                  else ('sensor_width', 'sensor_height', 'focal_length'))
        for name in needed:
            if not getattr(self, name):
                raise InvalidValue(f'camera: {name}', 0.0, 'it with a ground_sample_distance'
                                   if self.ground_sample_distance else
                                   'it, or a ground_sample_distance with image_width and '
                                   'image_height')


@dataclass(frozen=True, slots=True)
class Footprint:
    """What follows from a camera and a height."""

    strip_width: float  # [m] between two strips
    trigger_distance: float  # [m] between two photos


def footprint(camera: Camera, height: float) -> Footprint:
    """How far apart strips and photos are.

    Args:
        camera: looks straight down.
        height: [m] of the flight above the ground, where the camera does not say it.

    Returns:
        The ground that one photo shows, less the overlaps.

    Raises:
        InvalidValue: the height counts and is not above 0.
    """
    if camera.ground_sample_distance:
        across = camera.ground_sample_distance * camera.image_width
        along = camera.ground_sample_distance * camera.image_height
    else:
        height = check_number('camera: height', camera.height or height, 0.0, 1e4, open_low=True)
        across = height * camera.sensor_width / camera.focal_length
        along = height * camera.sensor_height / camera.focal_length
    return Footprint(across * (1.0 - camera.side_overlap), along * (1.0 - camera.front_overlap))
