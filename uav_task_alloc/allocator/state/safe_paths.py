# SPDX-License-Identifier: Apache-2.0
"""What the allocator asks of the zones; `replanning.zone_paths` answers it, a test may fake it."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from uav_task_alloc.model import Leg, Point, ThreatZone
from uav_task_alloc.params import AllocatorParams


class SafePaths(Protocol):
    """Paths around one set of zones; all points are [m] ENU. Two are equal if identical.

    Arguments of methods:
        a: start [m] ENU.
        b: end [m] ENU.
        points: polyline [m] ENU.
        point: [m] ENU.
        position: of the UAV [m] ENU.
        leg: that is being flown.
        goal: its end [m] ENU.
    """

    margin: float  # share of its length that a path must be shorter to replace a published one

    def leg(self, a: Point, b: Point) -> Leg | None:
        """Return the shortest safe leg from a to b; None if none was found."""

    def why_none(self, a: Point, b: Point) -> str:
        """Return why there is no safe path from a to the home b."""

    def why_no_leg(self, a: Point, b: Point) -> str:
        """Return why the ground leaves no leg from a to b; '' where it is not the cause."""

    def around(self, point: Point, up: float = 0.0, wide: bool = False) -> str:
        """Return the id of the first zone around a point, or around one at most `up` [m] above.

        `wide`: the zone with half the clearance. '' if there is none.
        """

    def clear(self, *points: Point) -> bool:
        """Return whether a polyline enters no zone."""

    def leg_clear(self, *points: Point) -> bool:
        """Return whether a leg enters no zone and keeps clear of the ground."""

    def rest(self, position: Point, leg: Leg, goal: Point,
             velocity: Point | None = None) -> float | None:
        """Return the length [m] still to fly of a leg under way; None if a zone cuts it.

        `velocity` as in `points_passed`.
        """

    def rest_of_leg(self, position: Point, leg: Leg, goal: Point,
                    velocity: Point | None = None) -> float | None:
        """As `rest`, of a leg to a task or home; None also if it comes too near to the ground.

        `velocity` as in `points_passed`.
        """


MakeSafePaths = Callable[[Sequence[ThreatZone], AllocatorParams], SafePaths]
GetSafePaths = Callable[[], SafePaths]  # those around the present zones
