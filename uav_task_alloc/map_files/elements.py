# SPDX-License-Identifier: Apache-2.0
"""What the readers of map files return: points, lines, polygons and circles in degrees."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from uav_task_alloc.errors import AllocError, shown
from uav_task_alloc.geometry.frames import Origin

AMSL, ABOVE_ORIGIN, UNSAID = 'amsl', 'origin', 'unsaid'  # what altitudes refer to
OWN_KEY = 'uav_task_alloc'  # of items in .plan files: what QGroundControl has no key for
LARGEST_FILE = 100_000_000  # [bytes], unpacked


class MapFileError(AllocError, ValueError):
    """A file cannot be read; the text names file, element and reason."""


@dataclass(frozen=True, slots=True)
class Place:
    """One vertex."""

    latitude: float  # [deg] WGS84
    longitude: float  # [deg] WGS84
    altitude: float | None = None  # [m] above what the element says; None: not given


@dataclass(frozen=True, slots=True)
class Element:
    """A point, line, polygon or circle of a file."""

    where: str  # file and element, for messages
    name: str  # '' for none
    geometry: str  # point | line | polygon | circle
    places: tuple[Place, ...]  # of a polygon its outer ring, open; of a circle its centre
    reference: str = UNSAID  # of the altitudes: AMSL, ABOVE_ORIGIN or UNSAID
    properties: dict[str, Any] = field(default_factory=dict)  # by lower-case name
    radius: float = math.nan  # [m] of a circle
    holes: tuple[tuple[Place, ...], ...] = ()  # of a polygon, open rings
    zone: bool = False  # the file says that it is a no-fly zone


@dataclass(slots=True)
class MapFile:
    """The content of a file."""

    elements: list[Element] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)  # what was not read, and why
    origin: Origin | None = None  # home position in the file


def check_place(where: str, numbers: Sequence[Any]) -> Place:
    """Check longitude, latitude and, where there is one, altitude.

    Args:
        where: file and element, for errors.
        numbers: in the order of KML and GeoJSON; texts are converted.

    Returns:
        The place.

    Raises:
        MapFileError: there are fewer than two, or one is no number or out of range.
    """
    try:
        values = [float(value) for value in numbers if not isinstance(value, bool)]
    except (TypeError, ValueError, OverflowError):
        values = []
    if len(values) < 2 or len(values) != len(numbers) or not all(map(math.isfinite, values)):
        raise MapFileError(f'{where}: coordinates {shown(list(numbers))}: expected longitude, '
                           'latitude [deg] and perhaps altitude [m]')
    longitude, latitude = values[:2]
    if not (-180.0 <= longitude <= 180.0 and -90.0 <= latitude <= 90.0):
        raise MapFileError(f'{where}: longitude {longitude:g}, latitude {latitude:g}: expected '
                           'degrees in [-180, 180] and [-90, 90] of WGS84')
    return Place(latitude, longitude, values[2] if len(values) > 2 else None)


def own_values(where: str, item: dict[str, Any]) -> dict[str, Any]:
    """The values of an item of a .plan that this package has written beside those of QGC.

    Args:
        where: file and element, for errors.
        item: as JSON has it.

    Returns:
        By key of a scenario.

    Raises:
        MapFileError: they are no object.
    """
    found = item.get(OWN_KEY, {})
    if not isinstance(found, dict):
        raise MapFileError(f'{where}: {OWN_KEY} = {shown(found)}: expected an object')
    return dict(found)


def open_ring(where: str, places: Sequence[Place]) -> tuple[Place, ...]:
    """A ring without its last vertex where that repeats the first.

    Raises:
        MapFileError: it has fewer than three vertices.
    """
    ring = tuple(places)
    if len(ring) > 1 and (ring[0].latitude, ring[0].longitude) == (
            ring[-1].latitude, ring[-1].longitude):
        ring = ring[:-1]
    if len(ring) < 3:
        raise MapFileError(f'{where}: a ring with {len(ring)} vertices: expected at least 3')
    return ring


def named(file: str, kind: str, name: str, number: int) -> str:
    """Where an element is, for messages: `field.kml: Placemark 'Mast 7'`."""
    return f'{file}: {kind} {shown(name) if name else number}'
