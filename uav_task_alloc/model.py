# SPDX-License-Identifier: Apache-2.0
"""What is allocated, to whom, around what, and the answer: frozen values, SI units, ENU."""
from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sized
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.polygon import is_simple, signed_area

Point = tuple[float, float, float]  # [m] ENU
FAR = 1e8  # [m] no coordinate is beyond
_ROS_NAME = re.compile(r'[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*')


def check_point(place: str, value: Iterable[float]) -> Point:
    """Three coordinates [m] as floats, none beyond FAR; raise InvalidValue otherwise."""
    try:
        x, y, z = (float(v) for v in value)
    except (TypeError, ValueError):
        raise InvalidValue(place, value, 'three coordinates [m]') from None
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        raise InvalidValue(place, (x, y, z), 'three finite coordinates [m]')
    if max(abs(x), abs(y), abs(z)) > FAR:
        raise InvalidValue(place, (x, y, z), f'three coordinates in [{-FAR:g}, {FAR:g}] m')
    return x, y, z


def check_number(place: str, value: float, low: float, high: float = math.inf,
                 open_low: bool = False) -> float:
    """A number in [low, high], or (low, high] where open_low; raise InvalidValue otherwise."""
    interval = f'{"(" if open_low else "["}{low:g}, {high:g}]'
    if isinstance(value, bool) or (not isinstance(value, (int, float)) and not hasattr(
            value, '__float__')):
        raise InvalidValue(place, value, f'a number in {interval}')
    number = float(value)
    if not low <= number <= high or (open_low and number == low):
        raise InvalidValue(place, number, f'a number in {interval}')
    return number


def check_count(place: str, many: Sized, most: int) -> None:
    """Raise InvalidValue where there are more than `most`."""
    if len(many) > most:
        raise InvalidValue(f'{place}: number', len(many), f'at most {most}')


def check_id(place: str, value: object) -> str:
    """A non-empty string; raise InvalidValue otherwise."""
    if not isinstance(value, str) or not value.strip():
        raise InvalidValue(place, value, 'a non-empty string')
    return value


def check_ros_name(place: str, value: str) -> str:
    """A string that can be part of a topic's name; raise InvalidValue otherwise."""
    if not is_ros_name(value):
        raise InvalidValue(place, value, 'a ROS name (letters, digits, _ and /; no digit first)')
    return value


def is_ros_name(value: str) -> bool:
    """Tokens of letters, digits and single _ that begin with no digit, joined by /."""
    return len(value) <= 200 and '__' not in value and _ROS_NAME.fullmatch(value) is not None


def check_names(place: str, value: Iterable[str]) -> frozenset[str]:
    """A set of strings; a bare string is refused, as it would fall into letters."""
    if isinstance(value, str) or not isinstance(value, Iterable) or not all(
            isinstance(v, str) and v.strip() for v in value):
        raise InvalidValue(place, value, 'a set of non-empty strings')
    return frozenset(value)


@dataclass(frozen=True, slots=True)
class Task:
    """A place that one UAV visits once. Raises InvalidValue."""

    id: str
    position: Point  # [m] ENU
    value: float = 1.0  # > 0, what 2.12 calls R sums it
    service_time: float = 0.0  # [s] spent there
    required_capabilities: frozenset[str] = frozenset()
    allowed_uavs: frozenset[str] | None = None  # None: any
    acceptance_radius: float | None = None  # [m]; None: the parameter's

    def __post_init__(self) -> None:
        check_id('task id', self.id)
        place = f'task {self.id}: '
        put = object.__setattr__
        put(self, 'position', check_point(place + 'position', self.position))
        put(self, 'value', check_number(place + 'value', self.value, 0.0, open_low=True))
        if math.isinf(self.value):
            raise InvalidValue(place + 'value', self.value, 'a finite number')
        put(self, 'service_time', check_number(place + 'service_time', self.service_time, 0.0,
                                               1e9))
        put(self, 'required_capabilities',
            check_names(place + 'required_capabilities', self.required_capabilities))
        if self.allowed_uavs is not None:
            put(self, 'allowed_uavs', check_names(place + 'allowed_uavs', self.allowed_uavs))
        if self.acceptance_radius is not None:
            put(self, 'acceptance_radius', check_number(
                place + 'acceptance_radius', self.acceptance_radius, 0.0, 1e6, open_low=True))


@dataclass(frozen=True, slots=True)
class Uav:
    """A vehicle as the solver sees it at one moment. Raises InvalidValue."""

    id: str
    position: Point  # [m] ENU, where it is now
    range: float = math.inf  # [m] it can still fly
    cruise_speed: float = 15.0  # [m/s]
    capabilities: frozenset[str] = frozenset()
    home: Point | None = None  # [m] ENU; None: its position

    def __post_init__(self) -> None:
        check_id('uav id', self.id)
        place = f'uav {self.id}: '
        put = object.__setattr__
        put(self, 'position', check_point(place + 'position', self.position))
        put(self, 'range', check_number(place + 'range', self.range, 0.0))
        put(self, 'cruise_speed', check_number(place + 'cruise_speed', self.cruise_speed, 0.0,
                                               1e4, open_low=True))
        put(self, 'capabilities', check_names(place + 'capabilities', self.capabilities))
        if self.home is not None:
            put(self, 'home', check_point(place + 'home', self.home))


class Shape(Enum):
    """What a threat zone looks like."""

    HEMISPHERE = 0
    CYLINDER = 1
    POLYGON = 2


@dataclass(frozen=True, slots=True)
class ThreatZone:
    """A volume no route may enter; `margin` [m] is added all around it. Raises InvalidValue.

    HEMISPHERE: the half z >= center z of a ball (eq 2.3). CYLINDER: upright, z_min..z_max [m].
    POLYGON: the prism z_min..z_max over a simple polygon of `vertices` (x, y) [m].
    """

    id: str
    shape: Shape
    center: Point = (0.0, 0.0, 0.0)  # [m]
    radius: float = 0.0  # [m]
    z_min: float = -math.inf  # [m]
    z_max: float = math.inf  # [m]
    vertices: tuple[tuple[float, float], ...] = ()  # [m], POLYGON only
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
        if self.shape is not Shape.HEMISPHERE and not self.z_min < self.z_max:
            raise InvalidValue(place + 'z_min, z_max', (self.z_min, self.z_max), 'z_min < z_max')
        # other shapes have none: what a message carries there is never looked at
        put(self, 'vertices', check_polygon(place + 'vertices', self.vertices)
            if self.shape is Shape.POLYGON else ())

    @classmethod
    def hemisphere(cls, id: str, center: Point, radius: float,
                   margin: float = 0.0) -> ThreatZone:
        """A dome on the plane z = center z [m]."""
        return cls(id, Shape.HEMISPHERE, center, radius, margin=margin)

    @classmethod
    def cylinder(cls, id: str, center: Iterable[float], radius: float, z_min: float = -math.inf,
                 z_max: float = math.inf, margin: float = 0.0) -> ThreatZone:
        """An upright cylinder around (x, y) of `center`, from z_min to z_max [m]."""
        x, y = tuple(center)[:2]
        return cls(id, Shape.CYLINDER, (x, y, 0.0), radius, z_min, z_max, margin=margin)

    @classmethod
    def polygon(cls, id: str, vertices: Iterable[Iterable[float]], z_min: float = -math.inf,
                z_max: float = math.inf, margin: float = 0.0) -> ThreatZone:
        """A prism over a simple polygon, given either way round [m]."""
        corners = tuple(tuple(v)[:2] for v in vertices)
        return cls(id, Shape.POLYGON, (0.0, 0.0, 0.0), 0.0, z_min, z_max,
                   corners, margin)  # type: ignore[arg-type]


def check_polygon(place: str, vertices: Iterable[Iterable[float]]) -> tuple[
        tuple[float, float], ...]:
    """At least three corners [m], no two edges crossing or touching, some area."""
    corners = []
    for corner in vertices:
        x, y = (float(v) for v in tuple(corner)[:2])
        if not (math.isfinite(x) and math.isfinite(y)):
            raise InvalidValue(place, (x, y), 'finite coordinates [m]')
        if max(abs(x), abs(y)) > FAR:
            raise InvalidValue(place, (x, y), f'coordinates in [{-FAR:g}, {FAR:g}] m')
        corners.append((x, y))
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    if len(corners) < 3:
        raise InvalidValue(place, tuple(corners), 'at least 3 corners')
    if not is_simple(corners):
        raise InvalidValue(place, tuple(corners), 'edges that do not cross or touch')
    if abs(signed_area(corners)) < 5e-10:
        raise InvalidValue(place, tuple(corners), 'a polygon with some area')
    return tuple(corners)


@dataclass(frozen=True, slots=True)
class Leg:
    """One flight from a stop to the next: detour points and the length of that polyline."""

    via: tuple[Point, ...]  # [m] ENU, without both ends
    length: float  # [m]


@dataclass(frozen=True, slots=True)
class Route:
    """What one UAV flies: task ids in order, a leg before each, and the way home where asked."""

    uav: str
    tasks: tuple[str, ...] = ()
    legs: tuple[Leg, ...] = ()  # one a task, and one more home where `returns`
    returns: bool = False

    @property
    def distance(self) -> float:
        """Length of all legs [m]."""
        return math.fsum(leg.length for leg in self.legs)


@dataclass(frozen=True, slots=True)
class Plan:
    """An answer: who flies what in which order, what is left out and why, and how good it is."""

    routes: dict[str, tuple[str, ...]]  # every UAV is here, also with ()
    unassigned: dict[str, str] = field(default_factory=dict)  # task id -> reason
    distance: float = 0.0  # [m] D of eq 2.12
    value: float = 0.0  # R of eq 2.12
    penalty: float = 0.0  # [m] P of eq 2.12: metres beyond range
    fit: float = 0.0  # eq 2.12, smaller is better
    history: tuple[tuple[float, float], ...] = ()  # ([s], fit) of the incumbent
    state: Any = None  # what the next warm start wants; opaque
    legs: Mapping[str, tuple[Leg, ...]] = field(default_factory=dict)  # as in Route
    returns: bool = False
    solver: str = ''
    solve_time: float = 0.0  # [s]
    iterations: int = 0
    warm_started: bool = False

    def route(self, uav: str) -> Route:
        """The route of one UAV with its legs; KeyError when the plan does not know it."""
        return Route(uav, self.routes[uav], tuple(self.legs.get(uav, ())), self.returns)
