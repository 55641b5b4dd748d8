# SPDX-License-Identifier: Apache-2.0
"""Chooses the fence of one UAV: which zones, in how many points, and what it does not carry."""
from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.geometry.polygon import signed_area
from uav_task_alloc.mavlink.fence.rings import enlarged, rings_of_fewer_corners
from uav_task_alloc.mavlink.fence.shapes import (
    FenceShape,
    circle_of,
    margin_of,
    vertical_extent,
)
from uav_task_alloc.model import Point, Shape, ThreatZone

_AREA = 'fence_area'  # its id in texts
_INSIDE, _OUTSIDE = 'the UAV or its plan is inside', 'the UAV or its plan is outside'


@dataclass(frozen=True, slots=True)
class FlightSpace:
    """Where one UAV flies: what a fence must leave free."""

    paths: tuple[tuple[Point, ...], ...] = ()  # [m] ENU, each flown along straight legs
    low: float = 0.0  # [m] ENU, lowest height of its plan and its return
    high: float = 0.0  # [m] ENU, highest height of both
    position: Point | None = None  # [m] ENU in the air; None: on the ground

    def enters(self, shape: FenceShape) -> bool:
        """Whether a planned leg, or the vehicle now, is where the shape forbids it.

        Args:
            shape: of a fence.
        """
        if self.position is not None and shape.breached_by(self.position):
            return True
        if shape.inclusion:
            return any(not shape.contains(p) for path in self.paths for p in path) or any(
                shape.meets_outline(a, b) for path in self.paths for a, b in pairwise(path))
        return any(shape.meets(a, b) for path in self.paths
                   for a, b in pairwise((*path[:1], *path)))


@dataclass(frozen=True, slots=True)
class Fence:
    """The fence that one UAV is to carry, and the zones that it does not carry."""

    shapes: tuple[FenceShape, ...] = ()  # in their order on board
    free_side: dict[str, str] = field(default_factory=dict)  # why, by id of a zone with a height
    waiting: dict[str, str] = field(default_factory=dict)  # why it would breach, by id of a zone
    breached: dict[str, str] = field(default_factory=dict)  # on board, and why it will be, by id
    no_space: tuple[str, ...] = ()  # ids of zones for which the store has no points, or _AREA

    @property
    def points(self) -> int:
        """The points that it takes of a fence store."""
        return sum(shape.points for shape in self.shapes)


def choose_fence(zones: Iterable[ThreatZone], area: FenceShape | None, space: FlightSpace,
                 budget: int, origin: Origin,
                 onboard: Sequence[FenceShape] = ()) -> Fence:
    """Choose the fence of one UAV.

    A zone with a height is carried only where the UAV cannot use its free side. A zone that the
    UAV or its plan is in waits; one that is on board already stays, and is named. Polygons are
    simplified outwards until all fit, never over a planned leg; then the zones farthest from the
    plan are left out. So is an area of more corners than the budget.

    Args:
        zones: with their margins.
        area: that the fleet stays in; None: none.
        space: where the UAV flies.
        budget: points of the fence store.
        origin: of the ENU frame.
        onboard: the shapes of the verified fence.

    Returns:
        The shapes within the budget, and why the other zones are left out.
    """
    free_side: dict[str, str] = {}
    waiting: dict[str, str] = {}
    breached: dict[str, str] = {}
    chosen: list[_Choice] = []
    carried = set(onboard)
    for zone in zones:
        reason = _free_side(zone, space)
        first = next(_shapes_of(zone, origin))
        if reason:
            free_side[zone.id] = reason
        elif not space.enters(first):
            chosen.append(_Choice(zone, first, space, origin))
        elif first in carried and not _is_limited(zone):
            chosen.append(_Choice(zone, first, space, origin))
            breached[zone.id] = _INSIDE
        elif _is_limited(zone):
            free_side[zone.id] = 'the plan passes over or under it, and a fence has no height'
        else:
            waiting[zone.id] = _INSIDE
    fixed = []
    leaves = area is not None and space.enters(area)
    if area is not None and (area in carried or not leaves):
        fixed = [area]
    if leaves:
        (breached if fixed else waiting)[_AREA] = _OUTSIDE
    too_large = [_AREA for shape in fixed if shape.points > budget]
    fixed = [] if too_large else fixed
    left_out = (*too_large, *_fit(chosen, budget - sum(shape.points for shape in fixed), space))
    # PX4 reads a polygon after a circle wrongly
    shapes = (*fixed, *sorted((choice.shape for choice in chosen),
                              key=lambda shape: not shape.corners))
    return Fence(shapes, free_side, waiting, breached, left_out)


def _is_limited(zone: ThreatZone) -> bool:
    """Whether a zone has a side above or below it."""
    return any(math.isfinite(z) for z in vertical_extent(zone))


def _free_side(zone: ThreatZone, space: FlightSpace) -> str:
    """Why a UAV may use the side above or below a zone; '': it cannot."""
    bottom, top = vertical_extent(zone)
    if space.high >= top:
        return f'it ends at {top:.0f} m, and the UAV flies up to {space.high:.0f} m'
    if space.low <= bottom:
        return f'it begins at {bottom:.0f} m, and the UAV flies down to {space.low:.0f} m'
    return ''


def _shapes_of(zone: ThreatZone, origin: Origin) -> Iterator[FenceShape]:
    """Shapes that cover a zone with its margin, from exact to ever fewer points."""
    if zone.shape is not Shape.POLYGON:
        yield circle_of(zone, origin)
        return
    for ring in rings_of_fewer_corners(enlarged(zone.vertices, margin_of(zone, origin))):
        yield FenceShape(zone.id, corners=ring)


class _Choice:
    """The shape of one zone, and the next simpler one that leaves the plan free."""

    def __init__(self, zone: ThreatZone, first: FenceShape, space: FlightSpace,
                 origin: Origin) -> None:
        self.zone, self.shape, self._space = zone, first, space
        self._rest = _shapes_of(zone, origin)
        self._first = True
        self._simpler: FenceShape | None = None

    @property
    def simpler(self) -> FenceShape | None:
        """The next simpler shape; None: there is none that leaves the plan free."""
        if self._first:
            next(self._rest, None)
            self._first = False
            self._advance()
        return self._simpler

    @property
    def price(self) -> float:
        """The area [m2] added by the next simpler shape, for each point saved."""
        assert self.simpler is not None
        return (signed_area(self.simpler.corners) - signed_area(self.shape.corners)) / (
            self.shape.points - self.simpler.points)

    def simplify(self) -> None:
        """Take the next simpler shape."""
        assert self._simpler is not None
        self.shape = self._simpler
        self._advance()

    def _advance(self) -> None:
        shape = next(self._rest, None)
        self._simpler = None if shape is None or self._space.enters(shape) else shape


def _fit(chosen: list[_Choice], budget: int, space: FlightSpace) -> tuple[str, ...]:
    """Simplify shapes until all fit, then remove the farthest; returns ids of those removed."""
    points, order = sum(choice.shape.points for choice in chosen), itertools.count()
    if points <= budget:
        return ()
    queue = [(c.price, next(order), c) for c in chosen if c.simpler is not None]
    heapq.heapify(queue)
    while points > budget and queue:
        _, _, choice = heapq.heappop(queue)
        points -= choice.shape.points
        choice.simplify()
        points += choice.shape.points
        if choice.simpler is not None:
            heapq.heappush(queue, (choice.price, next(order), choice))
    removed: list[str] = []
    far = sorted(chosen, key=lambda choice: _distance(choice.shape, space))
    while points > budget:
        choice = far.pop()
        points -= choice.shape.points
        chosen.remove(choice)
        removed.append(choice.zone.id)
    return tuple(removed)


def _distance(shape: FenceShape, space: FlightSpace) -> float:
    """Distance [m] of a shape from the points of the plan."""
    return min((shape.distance(p) for path in space.paths for p in path), default=0.0)
