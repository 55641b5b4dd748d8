# SPDX-License-Identifier: Apache-2.0
"""Tasks, UAVs, threat zones, routes and plans: frozen, checked values in SI units and ENU."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from uav_task_alloc.checks import check_id, check_names, check_number, check_point, check_polygon
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.separation.rule import Conflict
from uav_task_alloc.timetable import Timetable

Point = tuple[float, float, float]  # [m] ENU
LONG = 4e9  # [s] bound of all finite times; a message holds 2.1e9
BASE_RADIUS = 1.0  # [m] from its home within which a UAV is at its base
_TASK_TIMES = (('earliest', -math.inf, LONG), ('latest', -LONG, math.inf),
               ('release', -LONG, LONG), ('announced', -LONG, LONG))  # [s]
_UAV_LIMITS = (
    ('endurance', 0.0, math.inf), ('payload_capacity', 0.0, 1e6), ('climb_speed', 0.0, math.inf),
    ('descent_speed', 0.0, math.inf), ('available_from', 0.0, LONG),
    ('available_until', 0.0, math.inf), ('full_range', 0.0, math.inf),
    ('turnaround', 0.0, math.inf), ('full_endurance', 0.0, math.inf))


@dataclass(frozen=True, slots=True)
class Task:
    """A position that one UAV visits once.

    Attributes:
        id: unique.
        position: [m] ENU.
        value: > 0; the sum over the tasks served is R of eq 2.12.
        service_time: [s] spent at the position.
        required_capabilities: a UAV needs all of them.
        allowed_uavs: ids of UAVs; None: any.
        acceptance_radius: [m]; None: that of the parameters.
        earliest: [s] from now, of the start of the service; a UAV that arrives earlier waits.
        latest: [s] from now, of the start of the service.
        release: [s] from now; no UAV sets out for it before: does not begin the leg to it or, with
            a payload, the trip.
        announced: [s] from now, mostly negative; the response time counts from it.
        payload: [kg] taken on at the base.

    Raises:
        InvalidValue: a value is out of range.
    """

    id: str
    position: Point  # [m] ENU
    value: float = 1.0
    service_time: float = 0.0  # [s]
    required_capabilities: frozenset[str] = frozenset()
    allowed_uavs: frozenset[str] | None = None
    acceptance_radius: float | None = None  # [m]
    earliest: float = -math.inf  # [s]
    latest: float = math.inf  # [s]
    release: float = 0.0  # [s]
    announced: float = 0.0  # [s]
    payload: float = 0.0  # [kg]

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
        for name, low, high in _TASK_TIMES:
            put(self, name, check_number(place + name, getattr(self, name), low, high))
        put(self, 'payload', check_number(place + 'payload', self.payload, 0.0, 1e6))
        if self.latest < self.earliest:
            raise InvalidValue(place + 'latest', self.latest,
                               f'at least earliest = {self.earliest:g}')


@dataclass(frozen=True, slots=True)
class Uav:
    """A vehicle as the solver sees it at one moment.

    Attributes:
        id: unique.
        position: [m] ENU, the present one.
        range: [m] that it can still fly.
        cruise_speed: [m/s].
        capabilities: that tasks may require.
        home: [m] ENU, its base; None: its position.
        endurance: [s] that it can still be in the air, service and waiting included.
        payload_capacity: [kg] that it can take on at its base.
        climb_speed: [m/s] at most, upwards.
        descent_speed: [m/s] at most, downwards.
        available_from: [s] from now.
        available_until: [s] from now; its route ends by then.
        full_range: [m] after a visit of its base; None: `range`.
        turnaround: [s] of a visit of its base between two trips; inf: it makes one trip only.
        full_endurance: [s] after a visit of its base; None: `endurance`.
        aboard: ids of tasks whose payload it has on board in the air; None: those of its locked
            tasks and of the current trip of the plan that `plan` starts from.

    Raises:
        InvalidValue: a value is out of range.
    """

    id: str
    position: Point  # [m] ENU
    range: float = math.inf  # [m]
    cruise_speed: float = 15.0  # [m/s]
    capabilities: frozenset[str] = frozenset()
    home: Point | None = None  # [m] ENU
    endurance: float = math.inf  # [s]
    payload_capacity: float = 0.0  # [kg]
    climb_speed: float = math.inf  # [m/s]
    descent_speed: float = math.inf  # [m/s]
    available_from: float = 0.0  # [s]
    available_until: float = math.inf  # [s]
    full_range: float | None = None  # [m]
    turnaround: float = math.inf  # [s]
    full_endurance: float | None = None  # [s]
    aboard: frozenset[str] | None = None

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
        for name, low, high in _UAV_LIMITS:
            if getattr(self, name) is not None:
                put(self, name, check_number(place + name, getattr(self, name), low, high,
                                             open_low=name.endswith('_speed')))
        if self.available_until < self.available_from:
            raise InvalidValue(place + 'available_until', self.available_until,
                               f'at least available_from = {self.available_from:g}')
        if self.aboard is not None:
            put(self, 'aboard', check_names(place + 'aboard', self.aboard))

    @property
    def base(self) -> Point:
        """Its home, or its position where it has none [m] ENU."""
        return self.position if self.home is None else self.home

    @property
    def at_base(self) -> bool:
        """Whether it is at its base: on the ground, where waiting uses no endurance."""
        return self.home is None or math.dist(self.position, self.home) <= BASE_RADIUS


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
        if self.shape is not Shape.HEMISPHERE and not self.z_min < self.z_max:
            raise InvalidValue(place + 'z_min, z_max', (self.z_min, self.z_max), 'z_min < z_max')
        # of other shapes they are not checked: messages may carry anything there
        put(self, 'vertices', check_polygon(place + 'vertices', self.vertices)
            if self.shape is Shape.POLYGON else ())

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
        x, y = tuple(center)[:2]
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
        corners = tuple(tuple(v)[:2] for v in vertices)
        return cls(id, Shape.POLYGON, (0.0, 0.0, 0.0), 0.0, z_min, z_max,
                   corners, margin)  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Leg:
    """A flight from one stop to the next: its detour points, and the length of the polyline."""

    via: tuple[Point, ...]  # [m] ENU, without both ends
    length: float  # [m]


@dataclass(frozen=True, slots=True)
class Route:
    """The flight of one UAV: task ids in order, and the legs between them and perhaps home."""

    uav: str  # id
    tasks: tuple[str, ...] = ()  # ids in the order of flight
    legs: tuple[Leg, ...] = ()  # one a task, and one more home where `returns`
    returns: bool = False  # flies home after the last task

    @property
    def distance(self) -> float:
        """Length of all legs [m]."""
        return math.fsum(leg.length for leg in self.legs)


@dataclass(frozen=True, slots=True)
class Plan:
    """The result of a solve: routes, unassigned tasks with reasons, terms of the objective.

    Attributes:
        routes: task ids in order by UAV id; each UAV is a key, also one without tasks.
        unassigned: reason by task id.
        distance: [m], D of eq 2.12.
        value: R of eq 2.12.
        penalty: [m] beyond range, P of eq 2.12.
        fit: of eq 2.12, smaller is better.
        history: ([s], fit) of the incumbent.
        state: for the next warm start; opaque.
        legs: by UAV id, as in Route.
        returns: routes end at home.
        solver: name of the solver.
        solve_time: [s].
        iterations: of the solver.
        warm_started: it started from a previous plan.
        cost: of the objective that the plan was solved for, smaller is better.
        timetable: returns the times of the plan; a function, as they are computed when they are
            first asked for.
        conflicts: of UAVs that would not have been apart, and how each was resolved.
    """

    routes: dict[str, tuple[str, ...]]
    unassigned: dict[str, str] = field(default_factory=dict)
    distance: float = 0.0  # [m]
    value: float = 0.0
    penalty: float = 0.0  # [m]
    fit: float = 0.0
    history: tuple[tuple[float, float], ...] = ()  # ([s], fit)
    state: Any = None
    legs: Mapping[str, tuple[Leg, ...]] = field(default_factory=dict)
    returns: bool = False
    solver: str = ''
    solve_time: float = 0.0  # [s]
    iterations: int = 0
    warm_started: bool = False
    cost: float = 0.0
    timetable: Callable[[], Timetable] = field(default=Timetable, compare=False, repr=False)
    conflicts: tuple[Conflict, ...] = ()

    @property
    def arrivals(self) -> Mapping[str, float]:
        """Arrival at each task served [s] from the moment of the plan, by task id."""
        return self.timetable().arrivals

    @property
    def waits(self) -> dict[str, float]:
        """Waiting at each task served, before the service [s], by task id."""
        times = self.timetable()
        return {name: start - times.arrivals[name] for name, start in times.starts.items()}

    @property
    def trips(self) -> Mapping[str, tuple[tuple[str, ...], ...]]:
        """Task ids of each trip, by UAV id."""
        return self.timetable().trips

    def trips_of(self, uav: str) -> tuple[tuple[str, ...], ...]:
        """Return the trips of one UAV.

        Args:
            uav: id.

        Returns:
            Task ids of each; one trip where the plan has no times.
        """
        return self.trips.get(uav) or (self.routes.get(uav, ()),)

    @property
    def finish(self) -> float:
        """End of the last route [s] from the moment of the plan; 0 without tasks."""
        return max(self.timetable().ends.values(), default=0.0)

    @property
    def response(self) -> float:
        """Value-weighted mean time from the announcements to the starts of the services [s]."""
        return self.timetable().response

    def route(self, uav: str) -> Route:
        """Return the route of one UAV with its legs.

        Args:
            uav: id.

        Returns:
            Without tasks where the plan does not use it.

        Raises:
            KeyError: the plan has no such UAV.
        """
        return Route(uav, self.routes[uav], tuple(self.legs.get(uav, ())), self.returns)
