# SPDX-License-Identifier: Apache-2.0
"""The dense reference: Dijkstra over a visibility graph of many corners around every zone met.

Each zone has rings of `ring` corners around it, on circumscribed polygons, at many heights, the
other zones' tops and bottoms among them; prisms also along their edges. Its paths are feasible, so
never too short. Around a zone it is too long by at most 1 / cos(pi / ring) - 1 of the arc (0.4 %
for 36), besides what heights in between would gain; a test checks that a denser graph gains less
than that. Only zones that are met take part, as a path past fewer zones is never longer.
"""
import math
from itertools import pairwise

import numba
import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from uav_task_alloc.model import Shape

OUT = 1e-3  # [m] corners keep this distance


@numba.njit(cache=True, nogil=True)
def _cuts(row, corners, p, q, under):
    """Whether the open segment pq meets the zone of a row; independent formulas on purpose."""
    kind, cx, cy, cz, radius, low, high, grow = row
    s, t = 0.0, 1.0
    d = q - p
    if kind == 0:
        low = cz - 1e-6 if not under else low
        high = np.inf
    if d[2] == 0.0:
        if p[2] <= low or p[2] >= high:
            s, t = 1.0, 0.0
    else:
        u, v = (low - p[2]) / d[2], (high - p[2]) / d[2]
        s, t = max(0.0, min(u, v)), min(1.0, max(u, v))
    if kind == 0 and not under and (p[2] < cz or q[2] < cz):
        return True  # the reference never goes beneath a dome's base
    if s >= t:
        return False
    a, e = p + s * d, (t - s) * d
    if kind == 2:
        n = len(corners)
        odd = False
        for i in range(n):
            c, g = corners[i], corners[(i + 1) % n]
            if (c[1] > a[1]) != (g[1] > a[1]) and a[0] < c[0] + (g[0] - c[0]) * (a[1] - c[1]) / (
                    g[1] - c[1]):
                odd = not odd
            if _between(a[0], a[1], a[0] + e[0], a[1] + e[1], c[0], c[1], g[0], g[1]) < max(
                    grow, 1e-9):
                return True
        return odd
    fx, fy, fz = cx - a[0], cy - a[1], cz - a[2]
    if kind == 1:
        fz, ez = 0.0, 0.0
    else:
        ez = e[2]
    size = e[0] * e[0] + e[1] * e[1] + ez * ez
    u = 0.0 if size == 0.0 else min(1.0, max(0.0, (fx * e[0] + fy * e[1] + fz * ez) / size))
    gap = math.sqrt((fx - u * e[0]) ** 2 + (fy - u * e[1]) ** 2 + (fz - u * ez) ** 2)
    return gap < radius


@numba.njit(cache=True, nogil=True)
def _between(ax, ay, bx, by, cx, cy, dx, dy):
    """Distance in plan of two segments."""
    best = np.inf
    det = (bx - ax) * (dy - cy) - (by - ay) * (dx - cx)
    if det != 0.0:
        s = ((cx - ax) * (dy - cy) - (cy - ay) * (dx - cx)) / det
        t = ((cx - ax) * (by - ay) - (cy - ay) * (bx - ax)) / det
        if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
            return 0.0 if det != 0.0 else best
    for px, py, sx, sy, ex, ey in ((ax, ay, cx, cy, dx, dy), (bx, by, cx, cy, dx, dy),
                                   (cx, cy, ax, ay, bx, by), (dx, dy, ax, ay, bx, by)):
        ux, uy = ex - sx, ey - sy
        size = ux * ux + uy * uy
        u = 0.0 if size == 0.0 else min(1.0, max(0.0, ((px - sx) * ux + (py - sy) * uy) / size))
        best = min(best, math.hypot(sx + u * ux - px, sy + u * uy - py))
    return best


@numba.njit(cache=True, nogil=True)
def _aside(box, p, q):
    """Whether the segment pq passes a box in plan (x0, y0, x1, y1)."""
    return ((p[0] < box[0] and q[0] < box[0]) or (p[0] > box[2] and q[0] > box[2])
            or (p[1] < box[1] and q[1] < box[1]) or (p[1] > box[3] and q[1] > box[3]))


@numba.njit(cache=True, nogil=True)
def _edges(x, rows, corners, first, count, under, boxes):
    n = len(x)
    i_of, j_of, metres = [0], [0], [0.0]
    for i in range(n):
        for j in range(i + 1, n):
            for k in range(len(rows)):
                if not _aside(boxes[k], x[i], x[j]) and _cuts(
                        rows[k], corners[first[k]:first[k] + count[k]], x[i], x[j], under[k]):
                    break
            else:
                i_of.append(i)
                j_of.append(j)
                d = x[i] - x[j]
                metres.append(math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]))
    return np.array(i_of[1:]), np.array(j_of[1:]), np.array(metres[1:])


def _row(zone, clearance):
    g = zone.margin + clearance
    low, high = zone.z_min, zone.z_max
    if zone.shape is Shape.HEMISPHERE:
        low, high = zone.center[2], np.inf
    return [zone.shape.value, *zone.center, zone.radius + g, low - g, high + g, g]


class Dense:
    """Shortest paths by brute force, for both ends outside all zones."""

    def __init__(self, zones, clearance=0.0, low=-np.inf, high=np.inf, ring=36, tiers=7):
        self.rows = np.array([_row(zone, clearance) for zone in zones]).reshape(-1, 8)
        flat = [zone.vertices for zone in zones]
        self.count = np.array([len(v) for v in flat], np.int64)
        self.first = np.cumsum(self.count) - self.count
        self.corners = np.array([c for v in flat for c in v], float).reshape(-1, 2)
        self.low, self.high, self.ring, self.tiers = low, high, ring, tiers
        self.boxes = np.array([self._box(k) for k in range(len(zones))]).reshape(-1, 4)

    def length(self, a, b):
        """Length [m] of the shortest path over the corners; inf: none."""
        a, b = np.asarray(a, float), np.asarray(b, float)
        met = self._met(a, b, np.zeros(len(self.rows), bool), a, b)
        while True:
            levels = self._levels(met, a, b)
            x = np.vstack([a, b, *(self._around(k, levels) for k in np.flatnonzero(met))])
            total, path = self._dijkstra(x, met, a, b)
            if not math.isfinite(total):
                return total
            known = met.sum()
            for p, q in pairwise(path):
                met = self._met(p, q, met, a, b)
            if met.sum() == known:
                return total

    def _may_pass_under(self, a, b):
        return (self.rows[:, 0] == 0) & (min(a[2], b[2]) < self.rows[:, 5])

    def _met(self, p, q, met, a, b):
        under = self._may_pass_under(a, b)
        return met | np.array([
            _cuts(row, self.corners[f:f + c], p, q, d)
            for row, f, c, d in zip(self.rows, self.first, self.count, under, strict=True)], bool)

    def _dijkstra(self, x, met, a, b):
        keep = np.flatnonzero(met)
        i, j, metres = _edges(x, self.rows[keep], self.corners, self.first[keep],
                              self.count[keep], self._may_pass_under(a, b)[keep], self.boxes[keep])
        graph = csr_array((metres, (i, j)), shape=(len(x), len(x)))
        cost, parent = dijkstra(graph, directed=False, indices=0, return_predecessors=True)
        path = [1]
        while math.isfinite(cost[1]) and path[-1] != 0:
            path.append(parent[path[-1]])
        return cost[1], x[path]

    def _box(self, k):
        flat = self.corners[self.first[k]:self.first[k] + self.count[k]]
        reach = self.rows[k, 7] if len(flat) else self.rows[k, 4]
        flat = flat if len(flat) else self.rows[k:k + 1, 1:3]
        return [*(flat.min(0) - reach), *(flat.max(0) + reach)]

    def _levels(self, met, a, b):
        """Heights that count: of both ends, in between, of the limits and of the zones met."""
        ends = self.rows[met, 5] - OUT, self.rows[met, 6] + OUT
        z = np.unique(np.concatenate([np.linspace(a[2], b[2], 4), [self.low, self.high], *ends]))
        return z[np.isfinite(z) & (z >= self.low) & (z <= self.high)]

    def _around(self, k, levels):
        kind, cx, cy, cz, radius, low, high = self.rows[k, :7]
        angle = np.arange(self.ring) * 2 * np.pi / self.ring
        wide = (radius + OUT) / math.cos(math.pi / self.ring)
        circle = np.column_stack([np.cos(angle), np.sin(angle)])
        if kind == 0:
            tiers = cz + wide * np.sin(np.linspace(0, np.pi / 2, self.tiers))
            z = np.unique(np.concatenate([tiers, levels[(levels > cz) & (levels < cz + wide)]]))
            z = z[(z >= self.low) & (z <= self.high)]
            share = np.sqrt(np.maximum(0.0, wide * wide - (z - cz) ** 2))
            plans = [circle * s + np.array([cx, cy]) for s in share]
        else:
            z = levels[(levels >= low - OUT) & (levels <= high + OUT)]
            plan = self._polygon(k) if kind == 2 else circle * wide + np.array([cx, cy])
            plans = [plan] * len(z)
        rings = [np.column_stack([plan, np.full(len(plan), h)])
                 for plan, h in zip(plans, z, strict=True)]
        return np.vstack([np.empty((0, 3)), *rings])

    def _polygon(self, k):
        """Corners around the enlarged polygon and along its edges."""
        c = self.corners[self.first[k]:self.first[k] + self.count[k]]
        if np.sum(c[:, 0] * np.roll(c[:, 1], -1) - c[:, 1] * np.roll(c[:, 0], -1)) < 0:
            c = c[::-1]
        reach, out = self.rows[k, 7] + OUT, []
        for i in range(len(c)):
            p, q, r = c[i - 1], c[i], c[(i + 1) % len(c)]
            start = math.atan2(*(q - p)[::-1])
            turn = (math.atan2(*(r - q)[::-1]) - start + math.pi) % (2 * math.pi) - math.pi
            normal = np.array([math.sin(math.atan2(*(r - q)[::-1])),
                               -math.cos(math.atan2(*(r - q)[::-1]))])
            out += [q + t * (r - q) + reach * normal for t in np.linspace(0.0, 1.0, 9)]
            parts = max(1, math.ceil(turn / 0.35)) if turn > 0 else 0
            for m in range(parts):
                far = reach / math.cos(turn / parts / 2)
                at = start - math.pi / 2 + (m + 0.5) * turn / parts
                out.append(q + far * np.array([math.cos(at), math.sin(at)]))
        return np.array(out)
