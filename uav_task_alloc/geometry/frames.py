# SPDX-License-Identifier: Apache-2.0
"""WGS84 to ENU and back around one origin; up is not height above ground, as the earth curves."""
from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pymap3d
from numpy.typing import ArrayLike, NDArray

from uav_task_alloc.checks import check_number
from uav_task_alloc.model import Point

_WGS84 = pymap3d.Ellipsoid.from_name('wgs84')
_MAJOR, _MINOR = _WGS84.semimajor_axis, _WGS84.semiminor_axis  # [m]
_MAJOR_SQUARE, _RATIO_SQUARE = _MAJOR**2, (_MINOR / _MAJOR) ** 2


@dataclass(frozen=True, slots=True)
class Origin:
    """The position of ENU (0, 0, 0).

    Altitudes are AMSL throughout. pymap3d takes them as ellipsoidal; as origin and points are
    shifted by the same geoid height, which is near constant over a mission, ENU does not change.

    Raises:
        InvalidValue: a value is out of range.
    """

    latitude: float  # [deg]
    longitude: float  # [deg]
    altitude_amsl: float = 0.0  # [m]

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, 'latitude', check_number('origin latitude', self.latitude, -90.0, 90.0))
        put(self, 'longitude', check_number('origin longitude', self.longitude, -180.0, 180.0))
        put(self, 'altitude_amsl',
            check_number('origin altitude_amsl', self.altitude_amsl, -1e4, 1e5))


def to_enu(origin: Origin, latitude: float, longitude: float, altitude_amsl: float) -> Point:
    """Convert a geodetic position to ENU, as `to_enu_batch`; many times as fast for one.

    The equations of `pymap3d.geodetic2enu` in the same order, so that each bit is the same.

    Args:
        origin: of the ENU frame.
        latitude: [deg] WGS84.
        longitude: [deg] WGS84.
        altitude_amsl: [m].

    Returns:
        (east, north, up) [m].
    """
    (x, y, z), *_ = _ecef(float(latitude), float(longitude), float(altitude_amsl))
    (x0, y0, z0), cos_lat, sin_lat, cos_lon, sin_lon = _ecef_of(origin)
    u, v, w = x - x0, y - y0, z - z0
    t = cos_lon * u + sin_lon * v
    return (-sin_lon * u + cos_lon * v, -sin_lat * t + cos_lat * w, cos_lat * t + sin_lat * w)


def _ecef(latitude: float, longitude: float, altitude: float,
          ) -> tuple[Point, float, float, float, float]:
    """ECEF [m], and cosine and sine of latitude and longitude, as `pymap3d.geodetic2ecef`."""
    lat, lon = math.radians(latitude), math.radians(longitude)  # sines of math may differ
    cos_lat, sin_lat = float(np.cos(lat)), float(np.sin(lat))
    cos_lon, sin_lon = float(np.cos(lon)), float(np.sin(lon))
    # radius of the prime vertical [m]
    n = _MAJOR_SQUARE / float(np.hypot(_MAJOR * cos_lat, _MINOR * sin_lat))
    return ((n + altitude) * cos_lat * cos_lon, (n + altitude) * cos_lat * sin_lon,
            (n * _RATIO_SQUARE + altitude) * sin_lat), cos_lat, sin_lat, cos_lon, sin_lon


@lru_cache(maxsize=16)
def _ecef_of(origin: Origin) -> tuple[Point, float, float, float, float]:
    return _ecef(origin.latitude, origin.longitude, origin.altitude_amsl)


def to_geodetic(origin: Origin, point: Point) -> tuple[float, float, float]:
    """Convert an ENU point to a geodetic position, as `to_geodetic_batch`.

    Args:
        origin: of the ENU frame.
        point: (east, north, up) [m].

    Returns:
        Latitude [deg], longitude [deg], altitude AMSL [m].
    """
    latitude, longitude, altitude = to_geodetic_batch(origin, [point])[0]
    return float(latitude), float(longitude), float(altitude)


def to_enu_batch(origin: Origin, places: ArrayLike) -> NDArray[np.float64]:
    """Convert many positions at once.

    Args:
        origin: of the ENU frame.
        places: (n, 3): latitude [deg], longitude [deg], altitude AMSL [m].

    Returns:
        (n, 3), ENU [m].
    """
    rows = np.asarray(places, dtype=np.float64).reshape(-1, 3)
    return np.column_stack(pymap3d.geodetic2enu(
        *rows.T, origin.latitude, origin.longitude, origin.altitude_amsl))


def to_geodetic_batch(origin: Origin, points: ArrayLike) -> NDArray[np.float64]:
    """Convert many ENU points at once.

    Args:
        origin: of the ENU frame.
        points: (n, 3), ENU [m].

    Returns:
        (n, 3): latitude [deg], longitude [deg], altitude AMSL [m].
    """
    rows = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    return np.column_stack(pymap3d.enu2geodetic(
        *rows.T, origin.latitude, origin.longitude, origin.altitude_amsl))
