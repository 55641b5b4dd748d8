# SPDX-License-Identifier: Apache-2.0
"""Pull a coarse path taut: drop, slide and cut corners, never through a zone.

An autopilot flies a polyline, so this works on polylines: where a path bends around a curved
zone, the result circumscribes it, with as few corners as the tolerance allows.
"""
from __future__ import annotations

import math

import numpy as np

from uav_task_alloc.geometry.obstacles import Floats, Ints, Zones, blocked, box_distance
from uav_task_alloc.geometry.points import copy_point, path_length, point_distance
from uav_task_alloc.geometry.search_budget import spend
from uav_task_alloc.kernel import inner_allocating_kernel

MAX_CORNERS = 96  # of a path while it is shortened
CUT_GAIN = 1e-3  # share of the length by which a further corner must shorten a path
PULL_GAIN = 5e-4  # the same for a further round of pulling
PULL_WORK = 30  # tests of each zone near a corner that is pulled, about


@inner_allocating_kernel
def segment_clears(zones: Zones, near: Ints, px: float, py: float, pz: float, qx: float, qy: float,
                   qz: float, floor: float, no_skin: bool) -> bool:
    """Whether the segment pq enters none of the zones with indices `near`. O(near)"""
    for m in range(near.size):
        if blocked(zones[near[m]], px, py, pz, qx, qy, qz, floor, no_skin):
            return False
    return True


@inner_allocating_kernel
def zones_near(zones: Zones, among: Ints, p: Floats, i: int, j: int, length: float) -> Ints:
    """Those `among` the zones that a path of at most `length` [m] from p[i] to p[j] may meet."""
    near, n = np.empty(among.size, np.int64), 0
    for m in range(among.size):
        if (box_distance(zones[among[m]], p[i, 0], p[i, 1], p[i, 2])
                + box_distance(zones[among[m]], p[j, 0], p[j, 1], p[j, 2])) <= length:
            near[n] = among[m]
            n += 1
    return near[:n]


@inner_allocating_kernel
def drop_corners(zones: Zones, near: Ints, p: Floats, n: int, floor: float, no_skin: bool) -> int:
    """Remove every corner whose neighbours see each other; returns the new n. O(n^2 near)"""
    i = 1
    while i < n - 1:
        if segment_clears(zones, near, p[i - 1, 0], p[i - 1, 1], p[i - 1, 2], p[i + 1, 0],
                          p[i + 1, 1], p[i + 1, 2], floor, no_skin):
            for j in range(i, n - 1):
                copy_point(p, j + 1, p, j)
            n -= 1
            i = max(1, i - 1)
        else:
            i += 1
    return n


@inner_allocating_kernel
def _fits(zones: Zones, near: Ints, p: Floats, i: int, q: Floats, limits: Floats, floor: float,
          no_skin: bool) -> bool:
    """Whether corner i may move to q (3,)."""
    if q[2] < limits[0] or q[2] > limits[1]:
        return False
    x, y, z = q[0], q[1], q[2]
    for m in range(near.size):
        zone = zones[near[m]]
        if (blocked(zone, p[i - 1, 0], p[i - 1, 1], p[i - 1, 2], x, y, z, floor, no_skin)
                or blocked(zone, x, y, z, p[i + 1, 0], p[i + 1, 1], p[i + 1, 2], floor, no_skin)):
            return False
    return True


@inner_allocating_kernel
def _put(q: Floats, p: Floats, i: int, axes: Floats, t: float, turn: float, s: float) -> None:
    """q = the point t along the chord of corner i's neighbours, s off it, turned by `turn`."""
    c, d = math.cos(turn) * s, math.sin(turn) * s
    for m in range(3):
        q[m] = p[i - 1, m] + t * axes[0, m] + c * axes[1, m] + d * axes[2, m]


@inner_allocating_kernel
def _axes(p: Floats, i: int, axes: Floats) -> tuple[float, float, float]:
    """Chord direction, direction off it to corner i, third axis; chord, foot and offset [m]."""
    chord = point_distance(p, i - 1, p, i + 1)
    if chord < 1e-9:
        return 0.0, 0.0, 0.0
    foot = 0.0
    for m in range(3):
        axes[0, m] = (p[i + 1, m] - p[i - 1, m]) / chord
        foot += axes[0, m] * (p[i, m] - p[i - 1, m])
    off = 0.0
    for m in range(3):
        axes[1, m] = p[i, m] - p[i - 1, m] - foot * axes[0, m]
        off += axes[1, m] * axes[1, m]
    off = math.sqrt(off)
    if off > 0.0:
        for m in range(3):
            axes[1, m] /= off
    for m in range(3):
        a, b = (m + 1) % 3, (m + 2) % 3
        axes[2, m] = axes[0, a] * axes[1, b] - axes[0, b] * axes[1, a]
    return chord, foot, off


@inner_allocating_kernel
def _on_ellipse(chord: float, foot: float, off: float, t: float) -> float:
    """The offset [m] at t of a path as long as that over (foot, off); negative: none."""
    total = math.hypot(foot, off) + math.hypot(chord - foot, off)
    across = 1.0 - ((2.0 * t - chord) / total) ** 2
    wide = (total * total - chord * chord) * across
    return 0.5 * math.sqrt(wide) if wide > 0.0 and across > 0.0 else -1.0


@inner_allocating_kernel
def _press(zones: Zones, near: Ints, p: Floats, i: int, axes: Floats, q: Floats, t: float,
           turn: float, s: float, limits: Floats, floor: float, no_skin: bool) -> float:
    """The least offset [m], from the valid one s inwards, at which corner i fits; bisection."""
    low, high = 0.0, s
    for _ in range(6):
        middle = 0.5 * (low + high)
        _put(q, p, i, axes, t, turn, middle)
        if _fits(zones, near, p, i, q, limits, floor, no_skin):
            high = middle
        else:
            low = middle
    return high


@inner_allocating_kernel
def pull(zones: Zones, near: Ints, p: Floats, i: int, limits: Floats, floor: float, no_skin: bool,
         rounds: int) -> None:
    """Move corner i to where both its legs are shortest: inwards, along and around its chord.

    Args:
        near: indices of the zones to keep clear of.
        rounds: of the pattern search; O(near) each.
    """
    axes, q = np.empty((3, 3)), np.empty(3)
    chord, t, s = _axes(p, i, axes)
    if s < 1e-6:
        return
    legs = point_distance(p, i - 1, p, i) + point_distance(p, i, p, i + 1)
    near = zones_near(zones, near, p, i - 1, i + 1, legs)
    s = _press(zones, near, p, i, axes, q, t, 0.0, s, limits, floor, no_skin)
    turn, step_t, step_turn = 0.0, 0.25 * min(chord, 4.0 * s), 0.4
    for _ in range(rounds):
        moved = False
        for side in range(4):
            sign = 1.0 if side % 2 else -1.0
            u = t + sign * step_t if side < 2 else t
            v = turn + sign * step_turn if side >= 2 else turn
            r = 0.998 * _on_ellipse(chord, t, s, u)
            if r <= 0.0:
                continue
            _put(q, p, i, axes, u, v, r)
            if _fits(zones, near, p, i, q, limits, floor, no_skin):
                t, turn, moved = u, v, True
                s = _press(zones, near, p, i, axes, q, t, turn, r, limits, floor, no_skin)
        if not moved:
            step_t, step_turn = 0.4 * step_t, 0.4 * step_turn
    _put(q, p, i, axes, t, turn, s)
    p[i, 0], p[i, 1], p[i, 2] = q[0], q[1], q[2]


@inner_allocating_kernel
def pull_all(zones: Zones, near: Ints, p: Floats, n: int, limits: Floats, floor: float,
             no_skin: bool, rounds: int, work: Ints) -> int:
    """Drop and pull corners until a round gains less than PULL_GAIN; returns the new n."""
    before = np.inf
    for _ in range(rounds):
        n = drop_corners(zones, near, p, n, floor, no_skin)
        total = path_length(p, n)
        if n <= 2 or total > before * (1.0 - PULL_GAIN):
            break
        before = total
        for i in range(1, n - 1):
            if spend(work, PULL_WORK * near.size):
                return n
            pull(zones, near, p, i, limits, floor, no_skin, 1 + rounds)
    return n


@inner_allocating_kernel
def _cut(zones: Zones, near: Ints, p: Floats, i: int, limits: Floats, floor: float,
         no_skin: bool) -> float:
    """The distance [m] from corner i, on both its legs, at which the corner can be cut off."""
    before, after = point_distance(p, i - 1, p, i), point_distance(p, i, p, i + 1)
    low, high = 0.0, 0.98 * min(before, after)
    for j, leg in ((i - 1, before), (i + 1, after)):  # an end may lie beyond the limits
        if not limits[0] <= p[j, 2] <= limits[1]:
            edge = limits[0] if p[j, 2] < limits[0] else limits[1]
            high = min(high, leg * (edge - p[i, 2]) / (p[j, 2] - p[i, 2]))
    for _ in range(7):
        d = 0.5 * (low + high)
        f, g = d / before, d / after
        if segment_clears(zones, near, p[i, 0] + f * (p[i - 1, 0] - p[i, 0]),
                p[i, 1] + f * (p[i - 1, 1] - p[i, 1]), p[i, 2] + f * (p[i - 1, 2] - p[i, 2]),
                p[i, 0] + g * (p[i + 1, 0] - p[i, 0]), p[i, 1] + g * (p[i + 1, 1] - p[i, 1]),
                p[i, 2] + g * (p[i + 1, 2] - p[i, 2]), floor, no_skin):
            low = d
        else:
            high = d
    return low


@inner_allocating_kernel
def _chord(p: Floats, i: int, before: float, after: float) -> float:
    """Distance [m] of the points 1 m before and after corner i, on legs of these lengths."""
    total = 0.0
    for m in range(3):
        d = (p[i - 1, m] - p[i, m]) / before - (p[i + 1, m] - p[i, m]) / after
        total += d * d
    return math.sqrt(total)


@inner_allocating_kernel
def cut_corners(zones: Zones, near: Ints, p: Floats, n: int, limits: Floats, floor: float,
                no_skin: bool) -> int:
    """Replace a corner by two where that shortens the path enough; returns the new n."""
    least = CUT_GAIN * path_length(p, n)
    i = 1
    while i < n - 1 and n < MAX_CORNERS - 1:
        before, after = point_distance(p, i - 1, p, i), point_distance(p, i, p, i + 1)
        bend = before + after - point_distance(p, i - 1, p, i + 1)
        if bend < least:
            i += 1
            continue
        d = _cut(zones, near, p, i, limits, floor, no_skin)
        if d * (2.0 - _chord(p, i, before, after)) < least:
            i += 1
            continue
        for j in range(n, i, -1):
            copy_point(p, j - 1, p, j)
        for m in range(3):
            x = p[i, m]
            p[i, m] += d / before * (p[i - 1, m] - x)
            p[i + 1, m] += d / after * (p[i + 2, m] - x)
        n, i = n + 1, i + 2
    return n


@inner_allocating_kernel
def tauten(zones: Zones, near: Ints, p: Floats, n: int, limits: Floats, floor: float,
           no_skin: bool, work: Ints) -> int:
    """Shorten the clear path p[:n] in place and keep it clear.

    Args:
        near: indices of the zones that a shorter path can meet, int64.
        p: float64 (MAX_CORNERS, 3) [m].
        n: number of points.

    Returns:
        The new n. The path is clear also where the search was cut short.
    """
    n = pull_all(zones, near, p, n, limits, floor, no_skin, 3, work)
    for _ in range(4):
        if work[2]:
            break
        more = cut_corners(zones, near, p, n, limits, floor, no_skin)
        if more == n:
            break
        n = pull_all(zones, near, p, more, limits, floor, no_skin, 2, work)
    return n
