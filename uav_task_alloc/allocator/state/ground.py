# SPDX-License-Identifier: Apache-2.0
"""The ground of the fleet: heights above it, lower tasks, and the area that all stay in."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.fence_area import area_corners, zones_outside
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.terrain import Terrain, TerrainError, check_above, read_terrain
from uav_task_alloc.work.area import NOTHING_FLOWN, FlownStrips
from uav_task_alloc.work.pieces import Work, pieces_of
from uav_task_alloc.work.values import Kind

_DIFFERS = 20.0  # [m] that a UAV on the ground may be above or below that of the raster


class Ground:
    """Tasks and work over the ground of the allocator, where it has a terrain.

    Args:
        terrain: the ground; None: none is known.
        zones: the present zones.
        params: the present parameters.
    """

    def __init__(self, terrain: Terrain | None, zones: Callable[[], Sequence[ThreatZone]],
                 params: Callable[[], AllocatorParams]) -> None:
        self._terrain, self._zones, self._params = terrain, zones, params

    def resolved(self, item: Task | Work) -> Task | Work:
        """Return what is announced, a point above the ground as a point of the ENU frame.

        Args:
            item: as announced.

        Returns:
            The same work; a task for a POINT.

        Raises:
            InvalidValue: a point is below the ground, or the ground is not known.
            TerrainError: the terrain does not reach as far.
        """
        if isinstance(item, Work):
            if item.kind is not Kind.POINT:
                return item
            item, = pieces_of(item, terrain=self._terrain)
        if self._terrain is not None:
            check_above(self._terrain, f'task {item.id}: position', [item.position])
        return item

    def cut(self, work: Work, flown: FlownStrips = NOTHING_FLOWN) -> tuple[Task, ...]:
        """Cut work around the present zones.

        Args:
            work: of any kind.
            flown: of an area, which is left out.

        Returns:
            Its pieces, as `pieces_of` returns them.

        Raises:
            InvalidValue: there would be too many, one is below the ground, or that is not known.
            TerrainError: the terrain does not reach as far.
        """
        pieces = pieces_of(work, self._zones(), self._params().clearance, self._terrain,
                           flown)
        if self._terrain is not None:
            for piece in pieces:
                check_above(self._terrain, f'task {piece.id}: path', piece.path)
                least = min((self._terrain.least_clearance(a, b)[0]
                             for a, b in pairwise(piece.path)), default=0.0)
                if least < 0.0:
                    raise InvalidValue(f'task {piece.id}: path', round(least, 1),
                                       'at least 0 m above the ground on all of its way')
        return pieces

    def differs(self, report: UavReport) -> str:
        """Return how far a UAV on the ground is from the ground; '' for not far.

        Args:
            report: of a UAV.
        """
        if self._terrain is None or not report.standby:
            return ''
        try:
            above = float(self._terrain.above_ground([report.position])[0])
        except TerrainError as error:
            return f'{report.uav_id}: {error}'
        if abs(above) <= _DIFFERS:
            return ''
        return (f'{report.uav_id} stands {abs(above):.0f} m {"above" if above > 0.0 else "below"} '
                f'the ground of {self._terrain.name}: are its heights above mean sea level, and '
                'is origin.altitude_amsl right?')


def read_ground(params: AllocatorParams, origin: Origin) -> Terrain | None:
    """Read the terrain of the parameters.

    Args:
        params: with `terrain`.
        origin: of the ENU frame.

    Returns:
        None where the parameter is empty.

    Raises:
        TerrainError: the file cannot be read, or does not reach to the origin.
    """
    if not params.terrain:
        return None
    terrain = read_terrain(Path(params.terrain), origin)
    terrain.above_ground([(0.0, 0.0, 0.0)])
    return terrain


def area_zones(params: AllocatorParams) -> tuple[ThreatZone, ...]:
    """Return the zones over all that is outside of `fence_area`.

    Args:
        params: with the origin.

    Returns:
        None where no area is given.

    Raises:
        InvalidValue: the area is invalid.
    """
    return zones_outside(area_corners(params.fence_area, Origin(
        params.origin__latitude, params.origin__longitude, params.origin__altitude_amsl)))
