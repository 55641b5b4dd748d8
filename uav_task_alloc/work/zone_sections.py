# SPDX-License-Identifier: Apache-2.0
"""Horizontal sections of enlarged zones, and the parts of ways that are outside them."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

from uav_task_alloc.geometry.polygon import XY, edges
from uav_task_alloc.geometry.polyline import point_at, polyline_length
from uav_task_alloc.model import Point, Shape, ThreatZone

# corners [m], counter-clockwise; it may cross itself: winding numbers above 0 are inside
PlaneRing = Sequence[XY]
Span = tuple[float, float]
_CORNERS = 72  # of a circle: its polygon exceeds it by 0.1 % of the radius
_FEW_CORNERS = 16  # of a circle around a corner: exceeds it by 2 %
_SKIN = 0.03  # [m] further out, so that rounding never puts a way inside


def sections(zones: Iterable[ThreatZone], low: float, high: float,
             clearance: float = 0.0) -> list[PlaneRing]:
    """What zones cover in plan view at any height of a range.

    Args:
        zones: each is enlarged by its margin and `clearance`.
        low, high: [m] ENU.
        clearance: [m].

    Returns:
        Rings for each zone that reaches into the range, which enclose it together.
    """
    return [ring for zone in zones for ring in _section(zone, low, high, clearance)]


def _section(zone: ThreatZone, low: float, high: float, clearance: float) -> list[PlaneRing]:
    """The rings of one zone; none where it does not reach into the range."""
    grow = zone.margin + clearance
    if zone.shape is Shape.HEMISPHERE:
        base, reach = zone.center[2], zone.radius + grow
        if high < base - grow or low >= base + reach:
            return []
        return [_circle(zone.center, math.sqrt(reach**2 - max(0.0, low - base)**2))]
    if high <= zone.z_min - grow or low >= zone.z_max + grow:
        return []
    if zone.shape is Shape.CYLINDER:
        return [_circle(zone.center, zone.radius + grow)]
    from uav_task_alloc.geometry.zones import outline  # imports numba
    return [outline(zone, clearance), *_around_edges(zone.vertices, grow)]


def _around_edges(corners: Sequence[XY], grow: float) -> list[PlaneRing]:
    """Rings around what is near the edges of a polygon that is not convex; else none.

    In a notch that is narrower than twice `grow` [m] the rim of the polygon crosses itself, and
    leaves out a part of what it should enclose.
    """
    turns = {_turns_left(a, b, c) for a, b, c in zip(
        corners, [*corners[1:], corners[0]], [*corners[2:], *corners[:2]], strict=True)}
    if len(turns) == 1:
        return []
    boxes: list[PlaneRing] = []
    for a, b in edges(corners):
        length = math.dist(a, b)
        aside = [(grow + _SKIN) * (a[1] - b[1]) / length, (grow + _SKIN) * (b[0] - a[0]) / length]
        boxes.append([(x + sign * aside[0], y + sign * aside[1])
                      for (x, y), sign in ((a, -1.0), (b, -1.0), (b, 1.0), (a, 1.0))])
    return boxes + [_circle(corner, grow, _FEW_CORNERS) for corner in corners]


def _turns_left(a: XY, b: XY, c: XY) -> bool:
    return (b[0] - a[0]) * (c[1] - b[1]) > (b[1] - a[1]) * (c[0] - b[0])


def _circle(center: Sequence[float], radius: float, corners: int = _CORNERS) -> PlaneRing:
    """A polygon around a circle, counter-clockwise."""
    reach = (radius + _SKIN) / math.cos(math.pi / corners)
    return [(center[0] + reach * math.cos(angle), center[1] + reach * math.sin(angle))
            for angle in (2 * math.pi * k / corners for k in range(corners))]


def free_parts(a: Point, b: Point, zones: Iterable[ThreatZone],
               clearance: float = 0.0) -> list[Span]:
    """The parts of a straight way that enter no zone.

    Args:
        a, b: its ends [m] ENU.
        zones: each is enlarged by its margin and `clearance`.
        clearance: [m].

    Returns:
        (from, to) as shares of the way, in order; none where all of it is inside.
    """
    return remaining((0.0, 1.0), [
        span for zone in zones for span in _inside(a, b, zone, clearance)])


def remaining(whole: Span, barred: Iterable[Span]) -> list[Span]:
    """What is left of a span without others, in order."""
    left, at = [], whole[0]
    for start, end in sorted(barred):
        if start > at:
            left.append((at, min(start, whole[1])))
        at = max(at, end)
        if at >= whole[1]:
            return left
    return [*left, (at, whole[1])]


def _inside(a: Point, b: Point, zone: ThreatZone, clearance: float) -> list[Span]:
    """The parts of ab in one zone, as shares."""
    grow = zone.margin + clearance
    if zone.shape is Shape.HEMISPHERE:
        low, high = zone.center[2] - grow, math.inf
    else:
        low, high = zone.z_min - grow, zone.z_max + grow
    start, end = _between(a[2], b[2], low, high)
    if start >= end:
        return []
    if zone.shape is Shape.HEMISPHERE:
        spans = _in_ball(a, b, zone.center, zone.radius + grow + _SKIN)
    else:
        rings = _section(zone, -math.inf, math.inf, clearance)
        spans = ring_spans((a[0], a[1]), (b[0], b[1]), rings)
    return [(max(s, start), min(t, end)) for s, t in spans if s < end and t > start]


def _between(az: float, bz: float, low: float, high: float) -> Span:
    """The part of a way that is between two heights; (1, 0) for none."""
    if az == bz:
        return (0.0, 1.0) if low < az < high else (1.0, 0.0)
    s, t = sorted(((low - az) / (bz - az), (high - az) / (bz - az)))
    return max(0.0, s), min(1.0, t)


def _in_ball(a: Point, b: Point, center: Point, radius: float) -> list[Span]:
    along = [q - p for p, q in zip(a, b, strict=True)]
    off = [p - c for p, c in zip(a, center, strict=True)]
    square = sum(d * d for d in along)
    if square == 0.0:
        return [(0.0, 1.0)] if math.dist(a, center) < radius else []
    half = sum(d * o for d, o in zip(along, off, strict=True)) / square
    root = half * half - (sum(o * o for o in off) - radius * radius) / square
    return [(-half - math.sqrt(root), -half + math.sqrt(root))] if root > 0.0 else []


def ring_spans(a: XY, b: XY, rings: Iterable[PlaneRing]) -> list[Span]:
    """The parts of a straight way in plan view that are inside rings.

    Args:
        a, b: its ends [m].
        rings: winding numbers decide.

    Returns:
        (from, to) as shares of the way, which may be beyond its ends; of different rings they may
        overlap.
    """
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    spans = []
    for ring in rings:
        turned = [((x - a[0]) * dx + (y - a[1]) * dy, (y - a[1]) * dx - (x - a[0]) * dy)
                  for x, y in ring] if square else [(x - a[0], y - a[1]) for x, y in ring]
        crossings = sorted(_crossings(turned))
        spans += [(s / square, t / square) if square else (s, t)
                  for s, t in _wound(crossings)]
    return spans if square else [(0.0, 1.0) for s, t in spans if s < 0.0 < t]


def _crossings(ring: PlaneRing) -> Iterable[tuple[float, int]]:
    """Where the edges of a ring cross the x axis, and whether up (+1) or down (-1)."""
    for (ax, ay), (bx, by) in edges(ring):
        if (ay > 0.0) != (by > 0.0):
            yield ax - ay * (bx - ax) / (by - ay), 1 if by > ay else -1


def _wound(crossings: Iterable[tuple[float, int]]) -> Iterable[Span]:
    """The spans in which the winding number is not 0."""
    winding, start = 0, 0.0
    for at, sign in crossings:
        if winding == 0:
            start = at
        winding += sign
        if winding == 0:
            yield start, at


def segment_point(start: Point, end: Point, share: float) -> Point:
    """Return the point at a share of a segment, which is exact at both of its ends.

    Args:
        start, end: [m].
        share: 0.0 at `start`, 1.0 at `end`.

    Returns:
        [m].
    """
    if share in (0.0, 1.0):
        return end if share else start
    x, y, z = point_at(start, end, share)
    return x, y, z


def joined_parts(way: Sequence[Point],
                 shares_of: Callable[[Point, Point], Iterable[Span]],
                 shortest: float) -> list[tuple[Point, ...]]:
    """Return parts of a polyline, of which those that touch at its points are one.

    Args:
        way: [m], at least two points.
        shares_of: returns the shares of a segment, from and to, that are in a part, in order;
            called once for each segment, in order.
        shortest: [m] shorter parts are left out.

    Returns:
        [m] in the order of `way`.
    """
    parts: list[list[Point]] = []
    open_end = False  # the last part ends at the next point
    for a, b in pairwise(way):
        high = 0.0
        for low, high in shares_of(a, b):
            end = segment_point(a, b, high)
            if low == 0.0 and open_end:
                parts[-1].append(end)
            else:
                parts.append([segment_point(a, b, low), end])
        open_end = high == 1.0
    return [tuple(part) for part in parts if polyline_length(part) >= shortest]
