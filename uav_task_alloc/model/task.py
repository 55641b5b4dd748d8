# SPDX-License-Identifier: Apache-2.0
"""A task, a place or a way that one UAV serves once: a checked value in SI units and ENU."""
from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace

from uav_task_alloc.actions import Action, check_actions, stay_time
from uav_task_alloc.checks import check_id, check_names, check_number, check_point
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.polyline import polyline_length

Point = tuple[float, float, float]  # [m] ENU
LONG = 4e9  # [s] bound of all finite times; a message holds 2.1e9
LONGEST_SERVICE = 1e9  # [s] bound of the service time
LARGEST_VALUE = 1e200  # so that sums over all tasks, and their products with times, stay finite
_TASK_TIMES = (('earliest', -math.inf, LONG), ('latest', -LONG, math.inf),
               ('release', -LONG, LONG), ('announced', -LONG, LONG))  # [s]
_TURN = 2.0 * math.pi


@dataclass(frozen=True, slots=True)
class Task:
    """A position that one UAV visits once, or a way that it flies along once.

    A piece of more work is a task of its own, with an id of piece_ids.py.

    Attributes:
        id: unique.
        position: [m] ENU.
        value: > 0, at most 1e200; the sum over the tasks served is R of eq 2.12.
        service_time: [s] spent at the position, in addition to the flight along the path.
        required_capabilities: a UAV needs all of them.
        allowed_uavs: ids of UAVs; None: any.
        acceptance_radius: [m]; None: that of the parameters.
        earliest: [s] from now, of the start of the service; a UAV that arrives earlier waits.
        latest: [s] from now, of the start of the service.
        release: [s] from now; no UAV sets out for it before: does not begin the leg to it or, with
            a payload, the trip.
        announced: [s] from now, mostly negative; the response time counts from it.
        payload: [kg] taken on at the base; 0 with a path.
        path: [m] ENU, the way that is flown as the service, from `position` to its last point;
            empty: a point.
        reversible: it may be flown from its last point as well.
        heading: [rad] of the vehicle at the task, counter-clockwise from east (REP 103);
            None: any.
        actions: what the UAV does there, in the order in which they begin.

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
    path: tuple[Point, ...] = ()  # [m] ENU
    reversible: bool = False
    heading: float | None = None  # [rad]
    actions: tuple[Action, ...] = ()

    def __post_init__(self) -> None:
        check_id('task id', self.id)
        place = f'task {self.id}: '
        put = object.__setattr__
        put(self, 'position', check_point(place + 'position', self.position))
        put(self, 'value', check_number(place + 'value', self.value, 0.0, open_low=True))
        if self.value > LARGEST_VALUE:
            raise InvalidValue(place + 'value', self.value, 'a finite number' if math.isinf(
                self.value) else f'at most {LARGEST_VALUE:g}')
        put(self, 'service_time', check_number(place + 'service_time', self.service_time, 0.0,
                                               LONGEST_SERVICE))
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
        put(self, 'actions', check_actions(place + 'actions', self.actions))
        if self.heading is not None:
            put(self, 'heading', check_number(place + 'heading', self.heading, -_TURN, _TURN))
        if not isinstance(self.reversible, bool):
            raise InvalidValue(place + 'reversible', self.reversible, 'True or False')
        self._check_path(place)

    def _check_path(self, place: str) -> None:
        """Check the path, and what a task with a path may have."""
        if not isinstance(self.path, Iterable):
            raise InvalidValue(place + 'path', self.path, 'points [m]')
        path = tuple(check_point(place + 'path', point) for point in self.path)
        object.__setattr__(self, 'path', path)
        if not path:
            return
        if polyline_length(path) <= 0.0:
            raise InvalidValue(place + 'path', path, 'at least two points, not all at one place')
        if path[0] != self.position:
            raise InvalidValue(place + 'path', path[0], f'its position {self.position} as first')
        if self.payload > 0.0:
            raise InvalidValue(place + 'payload', self.payload, '0 with a path')

    @property
    def end(self) -> Point:
        """Where its service ends [m] ENU, flown from its position."""
        return self.path[-1] if self.path else self.position

    @property
    def path_length(self) -> float:
        """Length of the way that is flown as the service [m]; 0 of a point."""
        return polyline_length(self.path) if self.path else 0.0

    @property
    def turned(self) -> Task:
        """The same task, flown from its last point; itself where it is a point."""
        if not self.path:
            return self
        return replace(self, position=self.path[-1], path=self.path[::-1])

    @property
    def stay(self) -> float:
        """Service time, and what actions take where the UAV stays [s]; without the path."""
        return stay_time(self.service_time, self.actions, not self.path)


def turned_tasks(tasks: Iterable[Task], reversed: Collection[str]) -> list[Task]:
    """Return tasks as they are flown: those of these ids from their last points.

    Args:
        tasks: in any order.
        reversed: ids; see Plan.reversed.

    Returns:
        In the same order.
    """
    return [task.turned if task.id in reversed else task for task in tasks]
