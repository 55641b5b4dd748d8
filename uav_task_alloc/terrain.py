# SPDX-License-Identifier: Apache-2.0
"""Ground heights of a GeoTIFF, and whether and how straight legs keep clear of the ground."""
from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.errors import AllocError, InvalidValue
from uav_task_alloc.geometry.frames import Origin, to_geodetic_batch
from uav_task_alloc.model import Point

_Floats = NDArray[np.float64]
_CHUNK = 100.0  # [m] of a leg that is straight in the grid: the earth's curve over it is 0.2 mm
_MANY = 1000  # chunks: 100 km
_SLACK = 0.05  # [m] more than asked for, for that and for rounding
_MOST_POINTS = 200  # that are added to a leg
_LARGEST = 200_000_000  # nodes of a raster
_DEGREES = 4326  # EPSG number of longitude and latitude of WGS84


class TerrainError(AllocError, ValueError):
    """Terrain cannot be read, or does not reach as far as it is needed."""


class Projection(Protocol):
    """Turns degrees into positions in the grid."""

    def __call__(self, longitude: _Floats, latitude: _Floats) -> tuple[_Floats, _Floats]:
        """Columns and rows of nodes, counted from the centre of the first, not rounded."""


class Terrain:
    """The surface through the nodes of a raster, bilinear between four of them.

    Args:
        heights: float64 (rows, columns) [m] AMSL; NaN where nothing is known.
        to_grid: gives positions in the grid.
        origin: of the ENU frame.
        name: of the file, for errors.
    """

    def __init__(self, heights: _Floats, to_grid: Projection, origin: Origin,
                 name: str = 'terrain') -> None:
        self._heights, self._to_grid = np.asarray(heights, np.float64), to_grid
        self.origin, self.name = origin, name

    def above_ground(self, points: Sequence[Point]) -> _Floats:
        """Return how high points are above the ground.

        Args:
            points: [m] ENU.

        Returns:
            float64 (n,) [m], negative below it.

        Raises:
            TerrainError: a point is outside the raster, or where it has no data.
        """
        line = np.array(points, np.float64).reshape(-1, 3)
        u, v, altitude = self._grid(line)
        return altitude - self._surface(u, v, line)

    def raised(self, points: Sequence[Point], height: float | Sequence[float]) -> list[Point]:
        """Return the points above or below some at a height above ground.

        Args:
            points: [m] ENU; z does not count.
            height: [m] above the ground, one for all or one each.

        Returns:
            [m] ENU, within a centimetre of it.

        Raises:
            TerrainError: as `above_ground`.
        """
        found = [(x, y, 0.0) for x, y, _ in points]
        for _ in range(4):  # up at a place is not quite up at the origin
            higher = np.asarray(height) - self.above_ground(found)
            found = [(x, y, float(z + more)) for (x, y, z), more in zip(
                found, higher, strict=True)]
            if (np.abs(higher) < 0.5).all():
                break  # 100 km away that moves the place by 8 mm
        return found

    def least_clearance(self, a: Point, b: Point) -> tuple[float, float]:
        """Return how near a leg comes to the ground, exactly.

        In each cell that a leg crosses its height above the bilinear surface is a quadratic
        function; its least value is at an end of the crossing or at its vertex. O(cells crossed)

        Args:
            a, b: its ends [m] ENU.

        Returns:
            The least height above the ground [m], negative below it, and where: a share of ab.

        Raises:
            TerrainError: the leg leaves the raster, or crosses cells without data.
        """
        parts = max(1, math.ceil(math.dist(a, b) / _CHUNK))
        if parts > _MANY:
            self.above_ground([a, b])  # far outside is found at once
        shares = np.linspace(0.0, 1.0, parts + 1)
        line = np.array(a) + shares[:, None] * (np.array(b) - np.array(a))
        u, v, altitude = self._grid(line)
        self._check_inside(u, v, line)
        cuts = np.unique(np.concatenate([shares, *(
            _crossings(values, shares) for values in (u, v))]))
        middles = (cuts[1:] + cuts[:-1]) / 2  # three values make a quadratic function
        every = np.sort(np.concatenate([cuts, middles]))
        uu, vv, up = (np.interp(every, shares, values) for values in (u, v, altitude))
        return _least(self._above(uu, vv, up, line), every)

    def _above(self, u: _Floats, v: _Floats, up: _Floats, line: _Floats) -> _Floats:
        """Heights (3, n) above the ground at begin, middle and end of each crossing."""
        begin, middle, end = slice(0, -2, 2), slice(1, -1, 2), slice(2, None, 2)
        column, row = np.floor(u[middle]), np.floor(v[middle])
        return np.array([up[part] - self._surface(u[part], v[part], line, column, row)
                         for part in (begin, middle, end)])

    def _grid(self, points: _Floats) -> tuple[_Floats, _Floats, _Floats]:
        """Column, row and altitude AMSL of ENU points (n, 3)."""
        places = to_geodetic_batch(self.origin, points)
        u, v = self._to_grid(places[:, 1], places[:, 0])
        return np.asarray(u, np.float64), np.asarray(v, np.float64), places[:, 2]

    def _surface(self, u: _Floats, v: _Floats, points: _Floats, column: _Floats | None = None,
                 row: _Floats | None = None) -> _Floats:
        """Heights AMSL at positions in the grid, of the cells given or those around them."""
        self._check_inside(u, v, points)
        rows, columns = self._heights.shape
        i = np.clip(np.floor(u) if column is None else column, 0, columns - 2).astype(np.int64)
        j = np.clip(np.floor(v) if row is None else row, 0, rows - 2).astype(np.int64)
        x, y, h = u - i, v - j, self._heights
        found: _Floats = (h[j, i] * (1 - x) * (1 - y) + h[j, i + 1] * x * (1 - y)
                         + h[j + 1, i] * (1 - x) * y + h[j + 1, i + 1] * x * y)
        if not np.isfinite(found).all():
            raise TerrainError(f'{self.name}: it has no data near {_spots(points)}: expected '
                               'heights everywhere on the way')
        return found

    def _check_inside(self, u: _Floats, v: _Floats, points: _Floats) -> None:
        """Check positions in the grid, which may be infinite. Raises TerrainError."""
        rows, columns = self._heights.shape
        inside = (u >= -1e-6) & (v >= -1e-6) & (u <= columns - 1 + 1e-6) & (v <= rows - 1 + 1e-6)
        if not inside.all():
            raise TerrainError(f'{self.name}: it does not reach to {_spots(points)}: expected a '
                               'raster that covers all UAVs, tasks and the ways between')

    def lifted(self, a: Point, b: Point, clearance: float) -> tuple[Point, ...]:
        """Return points between two ends by which a leg keeps clear of the ground.

        An end that is nearer to the ground is left and reached upright.

        Args:
            a, b: ends [m] ENU.
            clearance: [m] above the ground.

        Returns:
            [m] ENU, none where the straight leg is clear.

        Raises:
            TerrainError: no data, or too many points would be needed.
        """
        floor = self.raised([a, b], clearance + _SLACK)
        ends = [(p[0], p[1], max(p[2], q[2])) for p, q in zip((a, b), floor, strict=True)]
        points = [ends[0], *self._between(ends[0], ends[1], clearance), ends[1]]
        start = 0 if points[0] != a else 1
        return tuple(points[start:len(points) - (points[-1] == b)])

    def _between(self, a: Point, b: Point, clearance: float) -> list[Point]:
        """Points added where the leg is nearest to the ground, until it is clear."""
        open_parts, done = [(a, b)], [a]
        while open_parts:
            p, q = open_parts.pop()
            least, share = self.least_clearance(p, q)
            if least >= clearance or math.dist(p[:2], q[:2]) < 0.01:
                done.append(q)
                continue
            if len(done) + len(open_parts) > _MOST_POINTS:
                raise TerrainError(f'{self.name}: the leg from {_shown(a)} to {_shown(b)} needs '
                                   f'more than {_MOST_POINTS} points to keep {clearance:g} m')
            found = min(max(share, 0.02), 0.98)
            x, y, z = (p[k] + found * (q[k] - p[k]) for k in range(3))
            if found != share:
                least, = self.above_ground([(x, y, z)])
            top = x, y, z + max(clearance - float(least) + 0.02 * clearance, 0.0) + _SLACK
            open_parts += [(top, q), (p, top)]
        return done[1:-1]

    def followed(self, path: Sequence[Point], tolerance: float) -> tuple[Point, ...]:
        """Return a way whose heights above ground become heights of the ENU frame.

        Args:
            path: x, y [m] ENU, z [m] above the ground.
            tolerance: [m] by which the way between its points may be higher or lower than that.

        Returns:
            [m] ENU, with points added where the ground bends.

        Raises:
            TerrainError: no data.
        """
        ways: list[Point] = []
        for a, b in pairwise(path):
            parts = max(1, math.ceil(math.dist(a[:2], b[:2]) / max(1.0, tolerance)))
            line = [(a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2]))
                    for t in np.linspace(0.0, 1.0, parts + 1).tolist()]
            profile = self.raised(line, [z for _, _, z in line])
            ways += _bends(profile, tolerance)[bool(ways):]
        return tuple(ways)


def _crossings(values: _Floats, shares: _Floats) -> _Floats:
    """Shares of a leg at which piecewise linear values are whole numbers."""
    found = []
    for (s, p), (t, q) in pairwise(zip(shares.tolist(), values.tolist(), strict=True)):
        low, high = min(p, q), max(p, q)
        whole = np.arange(math.ceil(low), math.floor(high) + 1)
        if high > low:
            found.append(s + (t - s) * (whole - p) / (q - p))
    return np.concatenate(found) if found else np.zeros(0)


def _least(above: _Floats, every: _Floats) -> tuple[float, float]:
    """The least of quadratic functions given at begin, middle and end, and where."""
    begin, middle, end = above
    curve, slope = 2 * (begin + end - 2 * middle), 4 * middle - 3 * begin - end
    with np.errstate(divide='ignore', invalid='ignore'):
        vertex = np.where(curve > 0.0, np.clip(-slope / (2 * curve), 0.0, 1.0), 0.0)
    where = np.array([np.zeros_like(vertex), vertex, np.ones_like(vertex)])
    values = begin + slope * where + curve * where**2
    k = int(np.argmin(values))
    part, index = divmod(k, values.shape[1])
    first, last = every[2 * index], every[2 * index + 2]
    return float(values[part, index]), float(first + where[part, index] * (last - first))


def _bends(points: list[Point], tolerance: float) -> list[Point]:
    """The ends of a profile and the points of it that are needed for the tolerance."""
    keep, open_parts = {0, len(points) - 1}, [(0, len(points) - 1)]
    while open_parts:
        first, last = open_parts.pop()
        if last - first < 2:
            continue
        low, high = points[first][2], points[last][2]
        off = [abs(points[k][2] - low - (high - low) * (k - first) / (last - first))
               for k in range(first + 1, last)]
        worst = max(range(len(off)), key=off.__getitem__)
        if off[worst] > tolerance:
            middle = first + 1 + worst
            keep.add(middle)
            open_parts += [(first, middle), (middle, last)]
    return [points[k] for k in sorted(keep)]


def _shown(point: Sequence[float]) -> str:
    return f'({point[0]:.0f}, {point[1]:.0f})'


def _spots(points: _Floats) -> str:
    return ' to '.join(_shown(point) for point in points[::max(1, len(points) - 1)][:2])


def _read_raster(rasterio: Any, path: Path) -> tuple[_Floats, Any, tuple[float, ...]]:
    """The heights of a raster, its projection, and the coefficients from places to pixels."""
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # what it lacks is said below
        with rasterio.open(path) as raster:
            if raster.crs is None:
                raise TerrainError(f'{path}: it has no projection: expected a GeoTIFF with one')
            if raster.transform.is_identity or raster.transform.is_degenerate:
                raise TerrainError(f'{path}: it has no position: expected a GeoTIFF with one')
            if raster.width * raster.height > _LARGEST or min(raster.width, raster.height) < 2:
                raise TerrainError(f'{path}: {raster.width} x {raster.height} pixels: expected '
                                   f'2 x 2 to {_LARGEST} in all')
            heights = raster.read(1, masked=True).astype(np.float64).filled(np.nan)
            return heights, raster.crs, tuple(~raster.transform)[:6]


def read_terrain(path: Path, origin: Origin) -> Terrain:
    """Read a GeoTIFF.

    Args:
        path: of a raster with heights [m] AMSL in its first band, in any projection.
        origin: of the ENU frame.

    Returns:
        The terrain.

    Raises:
        TerrainError: rasterio is not installed, or the file is no raster with a projection.
    """
    try:
        import rasterio
        from rasterio.warp import transform
    except ImportError:
        raise TerrainError(f"{path}: reading terrain needs rasterio: expected "
                           "pip install 'uav_task_alloc[terrain]'") from None
    try:
        heights, crs, (a, b, c, d, e, f) = _read_raster(rasterio, path)
    except (rasterio.errors.RasterioError, MemoryError) as error:
        raise TerrainError(f'{path}: {error}: expected a GeoTIFF') from None
    if not np.isfinite(heights).any():
        raise TerrainError(f'{path}: it has no data: expected heights')

    degrees = crs.to_epsg() == _DEGREES

    def to_grid(longitude: _Floats, latitude: _Floats) -> tuple[_Floats, _Floats]:
        if degrees:  # a call of GDAL takes a millisecond
            return (a * longitude + b * latitude + c - 0.5,
                    d * longitude + e * latitude + f - 0.5)
        try:
            xs, ys = transform('EPSG:4326', crs, longitude.tolist(), latitude.tolist())[:2]
        except Exception:  # errors of GDAL have no public base
            raise TerrainError(f'{path}: its projection gives no degrees: expected one of the '
                               'earth, and places within it') from None
        x, y = np.array(xs), np.array(ys)
        return a * x + b * y + c - 0.5, d * x + e * y + f - 0.5  # of the centres of pixels
    found = Terrain(heights, to_grid, origin, str(path))
    to_grid(np.array([origin.longitude]), np.array([origin.latitude]))
    return found


def check_above(terrain: Terrain, place: str, points: Sequence[Point]) -> None:
    """Check that points are not below the ground.

    Args:
        terrain: the ground.
        place: name of the points in the error text.
        points: [m] ENU.

    Raises:
        InvalidValue: one is.
        TerrainError: no data.
    """
    for point, above in zip(points, terrain.above_ground(points), strict=True):
        if above < -_SLACK:
            raise InvalidValue(place, round(point[2], 1),
                               f'at least {point[2] - above:.1f} m, the ground there')
