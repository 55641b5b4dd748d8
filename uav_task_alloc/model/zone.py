# SPDX-License-Identifier: Apache-2.0
"""Threat zones: frozen, checked values in SI units and ENU."""
from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from uav_task_alloc.checks import check_id, check_number, check_point, check_polygon
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model.task import Point


class Shape(Enum):
    """The shape of a threat zone; the values are those of ThreatZone messages."""

    HEMISPHERE = 0
    CYLINDER = 1
    POLYGON = 2


@dataclass(frozen=True, slots=True)
class ThreatZone:
    """A volume that no route may enter.

    HEMISPHERE: the half z >= center z of a ball (eq 2.3). CYLINDER: upright, z_min..z_max.
    POLYGON: the prism z_min..z_max over a simple polygon.

    Attributes:
        id: unique.
        shape: which of the other attributes count.
        center: [m] ENU; of a CYLINDER x and y.
        radius: [m], HEMISPHERE and CYLINDER.
        z_min: [m], CYLINDER and POLYGON.
        z_max: [m], CYLINDER and POLYGON.
        vertices: (x, y) [m], POLYGON; empty for the others.
        margin: [m], added all around.

    Raises:
        InvalidValue: a value is out of range, or the polygon is not simple.
    """

    id: str
    shape: Shape
    center: Point = (0.0, 0.0, 0.0)  # [m]
    radius: float = 0.0  # [m]
    z_min: float = -math.inf  # [m]
    z_max: float = math.inf  # [m]
    vertices: tuple[tuple[float, float], ...] = ()  # [m]
    margin: float = 0.0  # [m]

    def __post_init__(self) -> None:
        check_id('zone id', self.id)
        place = f'zone {self.id}: '
        put = object.__setattr__
        if not isinstance(self.shape, Shape):
            raise InvalidValue(place + 'shape', self.shape, 'one of ' + ', '.join(map(str, Shape)))
        put(self, 'center', check_point(place + 'center', self.center))
        put(self, 'margin', check_number(place + 'margin', self.margin, 0.0, 1e6))
        if self.shape is not Shape.POLYGON:
            put(self, 'radius', check_number(place + 'radius', self.radius, 0.0, 1e7,
                                             open_low=True))
        if self.shape is not Shape.HEMISPHERE:
            self._check_ends(place)
        # of other shapes they are not checked: messages may carry anything there
        put(self, 'vertices', check_polygon(place + 'vertices', self.vertices)
            if self.shape is Shape.POLYGON else ())

    def _check_ends(self, place: str) -> None:
        """Check the lower and the upper end."""
        refused = InvalidValue(place + 'z_min, z_max', (self.z_min, self.z_max), 'z_min < z_max')
        for name in ('z_min', 'z_max'):
            try:
                number = check_number(place + name, getattr(self, name), -math.inf)
            except InvalidValue:
                raise refused from None
            object.__setattr__(self, name, number)
        if self.z_min >= self.z_max:
            raise refused

    @classmethod
    def hemisphere(cls, id: str, center: Point, radius: float,
                   margin: float = 0.0) -> ThreatZone:
        """Return a dome on the plane z = center z.

        Args:
            id: unique.
            center: [m] ENU.
            radius: [m] > 0.
            margin: [m] added all around.

        Returns:
            The zone; eq 2.3.

        Raises:
            InvalidValue: a value is out of range.
        """
        return cls(id, Shape.HEMISPHERE, center, radius, margin=margin)

    @classmethod
    def cylinder(cls, id: str, center: Iterable[float], radius: float, z_min: float = -math.inf,
                 z_max: float = math.inf, margin: float = 0.0) -> ThreatZone:
        """Return an upright cylinder.

        Args:
            id: unique.
            center: x, y [m] ENU; further coordinates are ignored.
            radius: [m] > 0.
            z_min: [m] lower end.
            z_max: [m] upper end, above the lower.
            margin: [m] added all around.

        Returns:
            The zone.

        Raises:
            InvalidValue: a value is out of range.
        """
        try:
            x, y = tuple(center)[:2]
        except (TypeError, ValueError):
            raise InvalidValue(f'zone {id}: center', center, 'two coordinates [m]') from None
        return cls(id, Shape.CYLINDER, (x, y, 0.0), radius, z_min, z_max, margin=margin)

    @classmethod
    def polygon(cls, id: str, vertices: Iterable[Iterable[float]], z_min: float = -math.inf,
                z_max: float = math.inf, margin: float = 0.0) -> ThreatZone:
        """Return an upright prism over a simple polygon.

        Args:
            id: unique.
            vertices: x, y [m] ENU in either orientation; further coordinates are ignored.
            z_min: [m] lower end.
            z_max: [m] upper end, above the lower.
            margin: [m] added all around.

        Returns:
            The zone.

        Raises:
            InvalidValue: a value is out of range, or the polygon is not simple.
        """
        try:
            corners = tuple(tuple(v)[:2] for v in vertices)
        except TypeError:
            raise InvalidValue(f'zone {id}: vertices', vertices, 'points (x, y) [m]') from None
        return cls(id, Shape.POLYGON, (0.0, 0.0, 0.0), 0.0, z_min, z_max,
                   corners, margin)  # type: ignore[arg-type]
