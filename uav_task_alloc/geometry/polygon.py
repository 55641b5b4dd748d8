# SPDX-License-Identifier: Apache-2.0
"""Predicates of plane polygons in plain Python: orientation, area, simplicity, containment.

Kernels compile `orientation`, `segments_cross` and `crosses_ray` (see outline.py), so that both
sides of the package decide alike. Imports nothing of the package: the model checks zones with it.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

XY = tuple[float, float]  # [m]


def orientation(a: XY, b: XY, c: XY) -> float:
    """Return the orientation of three points. Compiled by kernels, too.

    Args:
        a, b, c: (x, y) [m].

    Returns:
        Twice the signed area [m2] of the triangle abc: positive where c lies to the left of the
        line from a to b, 0.0 on it.
    """
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def segments_cross(a: XY, b: XY, c: XY, d: XY) -> bool:
    """Return whether two segments cross in a point that is an end of neither.

    Compiled by kernels, too.

    Args:
        a, b: (x, y) [m], ends of one segment.
        c, d: (x, y) [m], ends of the other.

    Returns:
        False where they only touch or overlap.
    """
    return (orientation(c, d, a) * orientation(c, d, b) < 0.0
            and orientation(a, b, c) * orientation(a, b, d) < 0.0)


def crosses_ray(point: XY, a: XY, b: XY) -> bool:
    """Whether the edge ab crosses the ray from a point in the direction +x (even-odd rule).

    Of both ends of an edge the lower one belongs to it. Compiled by kernels.
    """
    x, y = point
    return (a[1] > y) != (b[1] > y) and x < (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) + a[0]


def edges(corners: Sequence[XY]) -> Iterator[tuple[XY, XY]]:
    """Return the edges of a closed polygon, the last one back to the first corner.

    Args:
        corners: (x, y) [m].

    Returns:
        (corner, next corner) each; none for no corners.
    """
    return pairwise((*corners, *corners[:1]))


def contains_point(corners: Sequence[XY], point: XY) -> bool:
    """Whether a point lies inside a polygon (even-odd rule); O(corners).

    Args:
        corners: [m], either way round.
        point: [m].

    Returns:
        On the boundary either.
    """
    return sum(crosses_ray(point, b, a) for a, b in edges(corners)) % 2 == 1


def signed_area(corners: Sequence[XY]) -> float:
    """Return the signed area of a simple polygon; O(corners).

    Taken from the first corner, as products of large coordinates would swallow a small area.

    Args:
        corners: (x, y) [m], at least one.

    Returns:
        [m2]; negative where the corners are clockwise.
    """
    return 0.5 * sum(orientation(corners[0], a, b) for a, b in pairwise(corners[1:]))


def is_simple(corners: Sequence[XY]) -> bool:
    """Whether no two edges cross, touch or fold back, and no corner is repeated.

    A sweep from left to right that compares only edges whose boxes overlap: an edge meets none of
    those that end before it begins. O(n log n + n k) for n corners, k edges above one another.

    Args:
        corners: (x, y) [m], at least 3.

    Returns:
        True where it bounds one area without touching itself.
    """
    ring = list(edges(corners))
    last = len(ring) - 1
    boxes = sorted((min(a[0], b[0]), max(a[0], b[0]), min(a[1], b[1]), max(a[1], b[1]), i)
                   for i, (a, b) in enumerate(ring))
    active: list[tuple[float, float, float, int]] = []  # highest x, lowest and highest y, edge
    for x0, x1, y0, y1, i in boxes:
        active = [other for other in active if other[0] >= x0]
        for _, low, high, j in active:
            if y0 <= high and low <= y1 and edges_meet(
                    *ring[i], *ring[j], adjacent=abs(i - j) in (1, last)):
                return False
        active.append((x1, y0, y1, i))
    return True


def edges_meet(a: XY, b: XY, c: XY, d: XY, adjacent: bool) -> bool:
    """Whether the edges ab and cd of a polygon cross, touch or fold back on each other.

    Args:
        adjacent: they share a corner, which alone does not count.

    Returns:
        True also where an edge has no length.
    """
    if a == b or c == d:
        return True
    if adjacent:
        shared, other, own = (b, d, a) if b == c else (a, c, b)
        dot = ((other[0] - shared[0]) * (own[0] - shared[0])
               + (other[1] - shared[1]) * (own[1] - shared[1]))
        return orientation(own, shared, other) == 0.0 and dot > 0.0
    return segments_cross(a, b, c, d) or any(
        orientation(p, q, r) == 0.0 and _in_box(p, q, r)
        for p, q, r in ((a, b, c), (a, b, d), (c, d, a), (c, d, b)))


def _in_box(a: XY, b: XY, point: XY) -> bool:
    """Whether a point lies in the box that the segment ab spans."""
    return (min(a[0], b[0]) <= point[0] <= max(a[0], b[0])
            and min(a[1], b[1]) <= point[1] <= max(a[1], b[1]))
