# SPDX-License-Identifier: Apache-2.0
"""Rings around polygons: enlarged by a distance, and with fewer corners, always outwards.

Plain Python, as the bridge must not wait for kernels.
"""
from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache

from uav_task_alloc.geometry.polygon import (
    XY,
    contains_point,
    edges,
    is_simple,
    orientation,
    segments_cross,
    signed_area,
)
from uav_task_alloc.geometry.polyline import segment_distance

Ring = tuple[XY, ...]  # [m], counter-clockwise, simple
LEAST_CORNERS = 3
_ARC_STEP = math.pi / 4  # [rad] of a round corner, as detours have it
_MOST_CORNERS = 120  # of a polygon before it is enlarged: the time for one grows with the square
_TANGENTS = 72  # sides of what replaces a convex polygon of more corners than that
_SAME = 1e-6  # [m] between corners that are one
_SHARP = 1e-6  # least cosine of half a turn


@lru_cache(maxsize=512)
def enlarged(corners: Ring, distance: float) -> Ring:
    """The ring that keeps a distance from a polygon; notches too narrow for it are filled.

    Args:
        corners: (x, y) [m] of a simple polygon, either way round.
        distance: [m] > 0.

    Returns:
        Counter-clockwise and simple; no point of it is nearer to the polygon than `distance`.
    """
    ring = corners if signed_area(corners) > 0.0 else tuple(reversed(corners))
    while len(ring) > _MOST_CORNERS:
        ring = _thinned(ring)
    outer = _offset(ring, distance)
    while not _keeps_distance(outer, ring, distance):
        if len(ring) == len(_hull(ring)):  # rounding alone: a convex ring can be enlarged
            break
        ring = _without_notch(ring)
        outer = _offset(ring, distance)
    return outer


def rings_of_fewer_corners(ring: Ring) -> Iterator[Ring]:
    """Rings of ever fewer corners, each of which contains the one before.

    Each step fills the notch or cuts off the edge that moves the ring outwards least; greedy.
    O(corners) rings, each in O(n log n) for n corners.

    Args:
        ring: counter-clockwise and simple.

    Returns:
        `ring` itself first; the last has three corners, or cannot be simplified outwards.
    """
    current: Ring | None = ring
    while current is not None:
        yield current
        current = _simplified(current)


def _thinned(ring: Ring) -> Ring:
    """Fill many notches at once; the convex hull where there are few, or they meet."""
    notches = sorted((_depth(a, corner, b), i) for i, (a, corner, b) in enumerate(_corners(ring))
                     if orientation(a, corner, b) <= 0.0)
    batch = len(ring) - _MOST_CORNERS
    while batch:
        removed: set[int] = set()
        for _, i in notches:
            if len(removed) < batch and not removed & {i - 1, (i + 1) % len(ring)}:
                removed.add(i)
        thinned = tuple(corner for i, corner in enumerate(ring) if i not in removed)
        if removed and is_simple(thinned):
            return thinned
        batch //= 2
    hull = _hull(ring)
    return hull if len(hull) <= _MOST_CORNERS else _tangents(hull)


def _tangents(ring: Ring) -> Ring:
    """The polygon of tangents in _TANGENTS directions around a convex ring."""
    step = 2 * math.pi / _TANGENTS
    reach = [max(x * math.cos(k * step) + y * math.sin(k * step) for x, y in ring)
             for k in range(_TANGENTS + 1)]
    corners: list[XY] = []
    for k in range(_TANGENTS):
        along = (reach[k + 1] - reach[k] * math.cos(step)) / math.sin(step)
        c, s = math.cos(k * step), math.sin(k * step)
        corner = reach[k] * c - along * s, reach[k] * s + along * c
        if not corners or min(math.dist(corner, corners[j]) for j in (0, -1)) > _SAME:
            corners.append(corner)  # tangents in one corner of the ring meet there
    return tuple(corners)


def _offset(ring: Ring, distance: float) -> Ring:
    """Move all edges outwards; round corners are circumscribed. It may cross itself."""
    outer: list[XY] = []
    for a, (x, y), b in _corners(ring):
        heading = math.atan2(y - a[1], x - a[0])
        turn = math.remainder(math.atan2(b[1] - y, b[0] - x) - heading, 2 * math.pi)
        parts = max(1, math.ceil(turn / _ARC_STEP - 1e-9))
        step = turn / parts
        far = distance / max(math.cos(step / 2), _SHARP)
        for i in range(parts):
            angle = heading - math.pi / 2 + (i + 0.5) * step
            outer.append((x + far * math.cos(angle), y + far * math.sin(angle)))
    return tuple(outer)


def _corners(ring: Ring) -> Iterator[tuple[XY, XY, XY]]:
    """Each corner between its neighbours."""
    for i, corner in enumerate(ring):
        yield ring[i - 1], corner, ring[(i + 1) % len(ring)]


def _keeps_distance(outer: Ring, ring: Ring, distance: float) -> bool:
    """Whether `outer` is simple, and all of it at that distance around `ring`."""
    least = distance * (1.0 - 1e-9) - 1e-6
    return (is_simple(outer) and contains_point(outer, ring[0]) and not any(
        _nearer(a, b, c, d, least) for a, b in edges(outer) for c, d in edges(ring)))


def _nearer(a: XY, b: XY, c: XY, d: XY, distance: float) -> bool:
    """Whether two segments are nearer to each other than `distance`."""
    for k in (0, 1):  # boxes apart
        if (min(a[k], b[k]) - max(c[k], d[k]) > distance
                or min(c[k], d[k]) - max(a[k], b[k]) > distance):
            return False
    return segments_cross(a, b, c, d) or min(
        segment_distance(a, c, d), segment_distance(b, c, d),
        segment_distance(c, a, b), segment_distance(d, a, b)) < distance


def _without_notch(ring: Ring) -> Ring:
    """Fill the notch that is filled with the least move outwards."""
    notches = sorted((_depth(a, corner, b), i) for i, (a, corner, b) in enumerate(_corners(ring))
                     if orientation(a, corner, b) <= 0.0)
    for _, i in notches:
        filled = ring[:i] + ring[i + 1:]
        if is_simple(filled):
            return filled
    return _hull(ring)


def _simplified(ring: Ring) -> Ring | None:
    """Fewer corners with the least move outwards; None where there is no such ring."""
    if len(ring) <= LEAST_CORNERS:
        return None
    for _, i, tip in sorted(_steps(ring), key=lambda step: step[0]):
        if tip is None:
            candidate = ring[:i] + ring[i + 1:]
        else:
            candidate = (*ring[:i], tip, *ring[i + 2:]) if i + 1 < len(ring) else (
                tip, *ring[1:i])
        if is_simple(candidate):
            return candidate
    hull = _hull(ring)
    return hull if len(hull) < len(ring) else None


def _steps(ring: Ring) -> Iterator[tuple[float, int, XY | None]]:
    """Move outwards [m] and index of each notch; of an edge also the tip that replaces it."""
    count = len(ring)
    for i in range(count):
        before, a, b, after = (ring[(i + k) % count] for k in (-1, 0, 1, 2))
        if orientation(before, a, b) <= 0.0:
            yield _depth(before, a, b), i, None
        elif orientation(a, b, after) > 0.0:
            tip = _meeting_point(before, a, b, after)
            if tip is not None:
                yield _depth(a, tip, b), i, tip


def _hull(ring: Ring) -> Ring:
    """The convex hull, by monotone chains."""
    chains: list[list[XY]] = []
    for points in (sorted(ring), sorted(ring, reverse=True)):
        chain: list[XY] = []
        for point in points:
            while len(chain) > 1 and orientation(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        chains.append(chain[:-1])
    return tuple(chains[0] + chains[1])


def _meeting_point(before: XY, a: XY, b: XY, after: XY) -> XY | None:
    """Where the edges on both sides of ab meet beyond it; None where they do not."""
    ax, ay = a[0] - before[0], a[1] - before[1]
    bx, by = b[0] - after[0], b[1] - after[1]
    cross = ax * by - ay * bx
    if cross >= -1e-9 * math.hypot(ax, ay) * math.hypot(bx, by):
        return None
    along = ((b[0] - a[0]) * by - (b[1] - a[1]) * bx) / cross
    return a[0] + along * ax, a[1] + along * ay


def _depth(a: XY, corner: XY, b: XY) -> float:
    """Distance [m] of a corner from the line through its neighbours."""
    length = math.dist(a, b)
    return abs(orientation(a, corner, b)) / length if length > 0.0 else math.dist(a, corner)
