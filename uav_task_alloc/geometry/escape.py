# SPDX-License-Identifier: Apache-2.0
"""The shortest way out of the zones that a point is caught in."""
from __future__ import annotations

import math

import numpy as np

from uav_task_alloc.geometry.numba_pointers import floats_at
from uav_task_alloc.geometry.obstacles import (
    CYLINDER,
    DOME,
    PRISM,
    Floats,
    Ints,
    Zone,
    Zones,
    in_polygon,
    off_segment,
)
from uav_task_alloc.geometry.search_budget import spend
from uav_task_alloc.kernel import allocating_kernel

_AROUND = 24  # directions tried at first, level and rising


@allocating_kernel
def _depth(zone: Zone, x: float, y: float, z: float) -> float:
    """At least so far it is to the outside of zone k [m]; <= 0: outside. Not under a dome."""
    skin = 1.5 * zone.skin
    dx, dy, dz = x - zone.x, y - zone.y, z - zone.z
    ends = min(zone.high + skin - z, z - zone.low + skin)
    if zone.kind == DOME:
        inner = zone.radius + skin - math.sqrt(dx * dx + dy * dy + dz * dz)
        return float(inner if ends > 0.0 else ends)
    if zone.kind == CYLINDER:
        return float(min(ends, zone.radius + skin - math.hypot(dx, dy)))
    edge, n, c = np.inf, zone.count, floats_at(zone.corners)
    for i in range(n):
        j = (i + 1) % n
        edge = min(edge, off_segment(x, y, c[2 * i], c[2 * i + 1], c[2 * j], c[2 * j + 1]))
    edge = math.sqrt(edge) if in_polygon(zone, x, y) else -math.sqrt(edge)
    return float(min(ends, edge + zone.grow + skin))


@allocating_kernel
def _ray(o: Zones, p: Floats, az: float, up: float, best: float, work: Ints) -> float:
    """How far along a direction the outside begins [m]; inf: not before `best`."""
    c = math.cos(up)
    dx, dy, dz = math.cos(az) * c, math.sin(az) * c, math.sin(up)
    t = 0.0
    for _ in range(400):
        if spend(work, o.size):
            break
        deepest, least = 0.0, 0.0
        for k in range(o.size):
            zone = o[k]
            d = _depth(zone, p[0] + t * dx, p[1] + t * dy, p[2] + t * dz)
            if d > deepest:
                deepest, least = d, 0.25 * zone.skin
        if deepest <= 0.0:
            return t
        t += max(deepest, least)
        if t >= best:
            break
    return np.inf


@allocating_kernel
def _try(o: Zones, p: Floats, az: float, up: float, limits: Floats, best: Floats,
         work: Ints) -> bool:
    """Take the direction (az, up) into best = (distance, az, up) where it is shorter."""
    if work[2]:
        return False
    t = _ray(o, p, az, up, best[0], work)
    z = p[2] + t * math.sin(up)
    if t >= best[0] or not min(limits[0], p[2]) <= z <= max(limits[1], p[2]):
        return False
    best[0], best[1], best[2] = t, az, up
    return True


@allocating_kernel
def _first_tries(o: Zones, p: Floats, limits: Floats, best: Floats, work: Ints) -> None:
    """Straight outwards of each zone around p, up, down, and a fan about the first of them."""
    base = np.nan
    _try(o, p, 0.0, 0.5 * math.pi, limits, best, work)
    _try(o, p, 0.0, -0.5 * math.pi, limits, best, work)
    for k in range(o.size):
        zone = o[k]
        if _depth(zone, p[0], p[1], p[2]) <= 0.0:
            continue
        dx, dy, dz = p[0] - zone.x, p[1] - zone.y, p[2] - zone.z
        az = math.atan2(dy, dx)
        base = az if math.isnan(base) else base
        _try(o, p, az, 0.0, limits, best, work)
        if zone.kind == DOME:
            _try(o, p, az, max(0.0, math.atan2(dz, math.hypot(dx, dy))), limits, best, work)
        if zone.kind == PRISM:
            n, c = zone.count, floats_at(zone.corners)
            for i in range(n):
                j = (i + 1) % n
                _try(o, p, math.atan2(c[2 * i] - c[2 * j], c[2 * j + 1] - c[2 * i + 1]), 0.0,
                     limits, best, work)
    for i in range(2 * _AROUND):
        _try(o, p, base + 2.0 * math.pi * i / _AROUND, 0.25 * math.pi * (i // _AROUND), limits,
             best, work)


@allocating_kernel
def way_out(o: Zones, p: Floats, limits: Floats, work: Ints) -> Floats:
    """The nearest point outside all zones that p, inside some, sees; NaN: there is none.

    Or work[2] says that the search was cut short.
    """
    best = np.array([np.inf, 0.0, 0.0])
    _first_tries(o, p, limits, best, work)
    if math.isinf(best[0]):
        return np.full(3, np.nan)
    step = math.pi / _AROUND
    for _ in range(24):
        az, up = best[1], best[2]
        if not (_try(o, p, az + step, up, limits, best, work)
                or _try(o, p, az - step, up, limits, best, work)
                or _try(o, p, az, up + step, limits, best, work)
                or _try(o, p, az, up - step, limits, best, work)):
            step *= 0.5
    t, c = best[0], math.cos(best[2])
    out = np.array([math.cos(best[1]) * c, math.sin(best[1]) * c, math.sin(best[2])])
    out *= t
    out += p
    return out
