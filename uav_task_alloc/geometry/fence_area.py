# SPDX-License-Identifier: Apache-2.0
"""The area that a fleet stays in: its corners, and polygons over all that is outside of it."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from uav_task_alloc.checks import check_polygon
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.geometry.polygon import XY, signed_area
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.zone_codec import OUTSIDE_AREA

MOST_AREA_CORNERS = 20
_REACH = 1e6  # [m] from the area: farther than any UAV would fly around its outside
AreaCorners = tuple[XY, ...]  # [m]


def area_corners(entries: Iterable[str], origin: Origin) -> AreaCorners:
    """Return the corners of an area that is given in degrees.

    Args:
        entries: corners like `47.3977,8.5456` [deg], either way round.
        origin: of the ENU frame.

    Returns:
        (east, north) [m], counter-clockwise; () where there are no entries.

    Raises:
        InvalidValue: an entry has another form, there are more than 20, or the polygon is not
            simple.
    """
    places = [degrees_of('fence_area', entry) for entry in entries]
    if not places:
        return ()
    return check_fence_area([to_enu(origin, *place, origin.altitude_amsl)[:2] for place in places])


def check_fence_area(corners: Sequence[XY]) -> AreaCorners:
    """Check the corners of an area.

    Args:
        corners: (east, north) [m], either way round.

    Returns:
        The same, counter-clockwise.

    Raises:
        InvalidValue: there are more than 20, or the polygon is not simple.
    """
    if len(corners) > MOST_AREA_CORNERS:
        raise InvalidValue('fence_area', len(corners), f'at most {MOST_AREA_CORNERS} corners')
    checked = check_polygon('fence_area', corners)
    return checked if signed_area(checked) > 0.0 else checked[::-1]


def zones_outside(corners: Sequence[XY]) -> tuple[ThreatZone, ...]:
    """Return zones over all that is outside of the area that a fleet stays in.

    Args:
        corners: (east, north) [m] of a simple polygon, either way round, 20 at most; () for none.

    Returns:
        Two, west and east, at all heights, for the `zones` of `plan`; none where there is no area.

    Raises:
        InvalidValue: there are more corners, or the polygon is not simple.
    """
    if not corners:
        return ()
    rings = outside_rings(check_fence_area(corners), _REACH)
    return tuple(ThreatZone.polygon(f'{OUTSIDE_AREA} ({side})', ring)
                 for side, ring in zip(('west', 'east'), rings, strict=True))


def degrees_of(name: str, entry: str) -> tuple[float, float]:
    """Return the place that a text states.

    Args:
        name: of the parameter.
        entry: like `47.3977,8.5456` [deg].

    Returns:
        Latitude and longitude [deg].

    Raises:
        InvalidValue: it has another form, or is no place on Earth.
    """
    try:
        latitude, longitude = map(float, entry.split(','))
    except ValueError:
        latitude = longitude = math.nan
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise InvalidValue(name, entry, '`LATITUDE,LONGITUDE` in degrees')
    return latitude, longitude


def outside_rings(corners: AreaCorners, reach: float) -> tuple[AreaCorners, AreaCorners]:
    """Return two simple polygons that together cover what is outside of an area.

    One lies along its west side, one along its east side. North and south of it both do, so that
    no leg passes between them.

    Args:
        corners: of a simple polygon [m], counter-clockwise.
        reach: [m] by which they extend beyond its box.

    Returns:
        Corners [m].
    """
    xs, ys = zip(*corners, strict=True)
    west, east, south, north = min(xs) - reach, max(xs) + reach, min(ys) - reach, max(ys) + reach
    top, bottom = max(ys), min(ys)
    at_top = sorted((x, k) for k, (x, y) in enumerate(corners) if y == top)
    at_bottom = sorted((x, k) for k, (x, y) in enumerate(corners) if y == bottom)
    western = _between(corners, at_top[-1][1], at_bottom[-1][1])
    eastern = _between(corners, at_bottom[0][1], at_top[0][1])
    box = (east, south), (west, south), (west, north), (east, north)
    return ((*western, (east, bottom), *box, (east, top)),
            (*eastern, (west, top), *box[2:], *box[:2], (west, bottom)))


def _between(corners: AreaCorners, first: int, last: int) -> AreaCorners:
    """The corners from one to another, counter-clockwise."""
    return corners[first:last + 1] if first <= last else corners[first:] + corners[:last + 1]
