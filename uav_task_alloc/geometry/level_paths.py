# SPDX-License-Identifier: Apache-2.0
"""Which zones a path between two heights enters: level flight, and a climb or descent in place.

Imports no numba, so that nodes start fast.
"""
from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from uav_task_alloc.geometry.zones_on_path import zone_across_path
from uav_task_alloc.model import Point, Shape, ThreatZone


def zone_at_heights(a: Point, b: Point, low: float, high: float,
                    zones: Iterable[ThreatZone]) -> ThreatZone | None:
    """Find the first zone that a path enters at any height of a range.

    Args:
        a, b: ends of the path [m] ENU; their heights are ignored.
        low, high: of the range [m] ENU.
        zones: each with its margin [m].

    Returns:
        The zone; None where the path is clear.
    """
    sections = ((zone, _section(zone, low, high)) for zone in zones)
    return next((zone for zone, section in sections if section is not None
                 and zone_across_path(a, b, (section,)) is not None), None)


def zone_on_return(place: Point, home: Point, height: float,
                   zones: Iterable[ThreatZone]) -> ThreatZone | None:
    """Find the first zone that a vehicle's own return enters.

    It climbs to its return height, flies level, and descends at home. Near home it climbs less
    (RTL_CONE_SLOPE, RTL_CONE_ANG): within that height from home all heights above its own count.

    Args:
        place: where it begins [m] ENU.
        home: [m] ENU.
        height: of the return above home [m]; it does not descend to it.
        zones: each with its margin [m].

    Returns:
        The zone; None where the return is clear.
    """
    zones, top = tuple(zones), max(place[2], home[2] + height)
    low = top if math.dist(place[:2], home[:2]) > top - home[2] else place[2]
    return (zone_at_heights(place, home, low, top, zones)
            or zone_at_heights(place, place, place[2], top, zones)
            or zone_at_heights(home, home, home[2], top, zones))


def _section(zone: ThreatZone, low: float, high: float) -> ThreatZone | None:
    """The zone in plan view between two heights, with its margin; None: it is not there."""
    if zone.shape is not Shape.HEMISPHERE:
        outside = high <= zone.z_min - zone.margin or low >= zone.z_max + zone.margin
        return None if outside else zone
    above, radius = max(0.0, low - zone.center[2]), zone.radius + zone.margin
    if above >= radius:
        return None
    return replace(zone, radius=math.sqrt(radius**2 - above**2), margin=0.0)
