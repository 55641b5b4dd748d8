# SPDX-License-Identifier: Apache-2.0
"""What work is made of: its kind, its geometry, and the checks that all kinds share."""
from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise

from uav_task_alloc.checks import check_count, check_number, check_point
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Point, Task
from uav_task_alloc.piece_ids import piece_id

MOST_PIECES = 1000  # of one task
MOST_CORNERS = 1000  # of a path or of one hole
MOST_HOLES = 100
ORBIT_RADII = 1.0, 5000.0  # [m] smallest, largest
_SHORTEST = 0.01  # [m] between two points of a path
_GEOMETRY = 'path', 'holes', 'strip_width', 'direction', 'radius', 'turns'


class Kind(Enum):
    """The kind of work; the values are those of Task messages."""

    POINT = 0
    LINE = 1
    AREA = 2
    ORBIT = 3


class Vertical(Enum):
    """What heights refer to; the values are those of Task messages."""

    ORIGIN = 0
    TERRAIN = 1


@dataclass(frozen=True, slots=True)
class Geometry:
    """The task, kind and geometry of work; `pieces.Work` adds the checks of its kind.

    Attributes:
        task: its id, value, windows and so on. POINT: its position; ORBIT: its position is the
            centre at the height of flight; LINE and AREA: the position becomes `path[0]`.
        kind: which of the other attributes count.
        path: [m] ENU. LINE: the way; AREA: the corners of a simple polygon, all at the height of
            flight; a last corner equal to the first is dropped.
        holes: of an AREA: corners of simple polygons inside of it, which are left out; z is
            ignored.
        strip_width: [m] that one pass over an AREA covers.
        direction: [rad] of the strips of an AREA, or from the centre to the entry of an ORBIT,
            counter-clockwise from east; None: the best, or 0.
        radius: [m] of an ORBIT.
        turns: of an ORBIT, clockwise from above; negative: counter-clockwise. 0: one.
        divisible: a LINE may be cut at its points, and its parts given to several UAVs.
        vertical: what the z of position and path refer to.
    """

    task: Task
    kind: Kind = Kind.POINT
    path: tuple[Point, ...] = ()  # [m]
    holes: tuple[tuple[Point, ...], ...] = ()  # [m]
    strip_width: float = 0.0  # [m]
    direction: float | None = None  # [rad]
    radius: float = 0.0  # [m]
    turns: float = 0.0
    divisible: bool = False
    vertical: Vertical = Vertical.ORIGIN

    def place(self, name: str) -> str:
        """The name of a value in an error text."""
        return f'task {self.task.id}: {name}'


def check_common(given: Geometry) -> None:
    """Check what all kinds share, and put the values in their normal form.

    Args:
        given: changed in place.

    Raises:
        InvalidValue: a value is out of range or of the wrong type.
    """
    put = object.__setattr__
    for name, kind in (('kind', Kind), ('vertical', Vertical)):
        if not isinstance(getattr(given, name), kind):
            raise InvalidValue(given.place(name), getattr(given, name),
                               'one of ' + ', '.join(map(str, kind)))
    if given.task.path:
        raise InvalidValue(given.place('task.path'), given.task.path,
                           'none: the way of work is its own path')
    if given.kind is not Kind.POINT and given.task.payload > 0.0:
        raise InvalidValue(given.place('payload'), given.task.payload,
                           f'0 for {given.kind.name}: only a POINT takes a payload')
    put(given, 'path', _points(given.place('path'), given.path))
    check_count(given.place('holes'), given.holes, MOST_HOLES)
    put(given, 'holes', tuple(_points(given.place(f'holes[{k}]'), hole)
                              for k, hole in enumerate(given.holes)))
    for name, high in (('strip_width', 1e5), ('radius', 1e5)):
        put(given, name, check_number(given.place(name), getattr(given, name), 0.0, high))
    put(given, 'turns', check_number(given.place('turns'), given.turns, -100.0, 100.0))
    if given.direction is not None and not math.isnan(given.direction):
        put(given, 'direction', check_number(given.place('direction'), given.direction,
                                             -2 * math.pi, 2 * math.pi))
    else:
        put(given, 'direction', None)
    if given.kind in (Kind.LINE, Kind.AREA) and given.path:
        put(given, 'task', replace(given.task, position=given.path[0]))


def refuse_unused(given: Geometry, used: tuple[str, ...]) -> None:
    """Refuse geometry that a kind does not have, as it would be ignored.

    Args:
        given: checked by `check_common`.
        used: names of what its kind has.

    Raises:
        InvalidValue: something else is given.
    """
    for name in _GEOMETRY:
        value = getattr(given, name)
        if name not in used and value not in ((), 0.0, None):
            raise InvalidValue(given.place(name), value, f'none for {given.kind.name}')
    if given.divisible and given.kind is not Kind.LINE and given.kind is not Kind.AREA:
        raise InvalidValue(given.place('divisible'), True, f'false for {given.kind.name}')


def check_steps(given: Geometry) -> None:
    """Check that no two consecutive points of the path are the same.

    Raises:
        InvalidValue: they are closer than 1 cm.
    """
    for k, (a, b) in enumerate(pairwise(given.path)):
        if math.dist(a, b) < _SHORTEST:
            raise InvalidValue(given.place(f'path[{k + 1}]'), b,
                               f'a point {_SHORTEST:g} m or more from path[{k}]')


def _points(place: str, given: Iterable[Iterable[float]]) -> tuple[Point, ...]:
    points = tuple(given)
    check_count(place, points, MOST_CORNERS)
    return tuple(check_point(f'{place}[{k}]', point) for k, point in enumerate(points))


def piece_tasks(given: Geometry, paths: list[tuple[Point, ...]],
                reversible: bool) -> tuple[Task, ...]:
    """Tasks of ways: value and service time are shared by length.

    Args:
        given: the whole.
        paths: [m] ENU, at least one, each of at least two points.
        reversible: they may be flown from either end.

    Returns:
        In the order of `paths`; ids are `<task id>#<k>`, k from 1.
    """
    lengths = [math.fsum(math.dist(a, b) for a, b in pairwise(path)) for path in paths]
    total = math.fsum(lengths)
    return tuple(replace(
        given.task, id=piece_id(given.task.id, k), position=path[0], path=path,
        reversible=reversible, value=given.task.value * length / total,
        service_time=given.task.service_time * length / total)
        for k, (path, length) in enumerate(zip(paths, lengths, strict=True), 1))
