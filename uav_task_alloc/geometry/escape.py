# SPDX-License-Identifier: Apache-2.0
"""The shortest way out of the zones that a point is inside of, by rays."""
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
    squared_segment_distance,
)
from uav_task_alloc.geometry.search_budget import spend
from uav_task_alloc.kernel import inner_allocating_kernel

_DIRECTIONS = 24  # tried at first at each of two elevations: level and rising


@inner_allocating_kernel
def _depth(zone: Zone, x: float, y: float, z: float) -> float:
    """A lower bound [m] of the distance to the outside of a zone; <= 0: outside. O(corners)"""
    skin = 1.5 * zone.skin
    dx, dy, dz = x - zone.x, y - zone.y, z - zone.z
    ends = min(zone.high + skin - z, z - zone.low + skin)
    if zone.kind == DOME:
        inner = zone.radius + skin - math.sqrt(dx * dx + dy * dy + dz * dz)
        return float(inner if ends > 0.0 else ends)
    if zone.kind == CYLINDER:
        return float(min(ends, zone.radius + skin - math.hypot(dx, dy)))
    edge, n, c = np.inf, zone.corner_count, floats_at(zone.corners)
    for i in range(n):
        j = (i + 1) % n
        edge = min(edge, squared_segment_distance(
            x, y, c[2 * i], c[2 * i + 1], c[2 * j], c[2 * j + 1]))
    edge = math.sqrt(edge) if in_polygon(zone, x, y) else -math.sqrt(edge)
    return float(min(ends, edge + zone.grow + skin))


@inner_allocating_kernel
def _ray(zones: Zones, p: Floats, az: float, up: float, best: Floats, work: Ints) -> float:
    """Distance [m] along a ray at which the outside of all zones begins; inf: not before `best`.

    Where best[3] > 0 also inf if it leads deeper into a zone. Marches by the greatest depth, at
    most 400 steps of O(zones).
    """
    c = math.cos(up)
    dx, dy, dz = math.cos(az) * c, math.sin(az) * c, math.sin(up)
    t = 0.0
    for _ in range(400):
        if spend(work, zones.size):
            break
        deepest, least = 0.0, 0.0
        for k in range(zones.size):
            zone = zones[k]
            d = _depth(zone, p[0] + t * dx, p[1] + t * dy, p[2] + t * dz)
            if d > 0.0 and best[3] > 0.0 and d > zone.skin + max(
                    0.0, _depth(zone, p[0], p[1], p[2])):
                return np.inf
            if d > deepest:
                deepest, least = d, 0.25 * zone.skin
        if deepest <= 0.0:
            return t
        t += max(deepest, least)
        if t >= best[0]:
            break
    return np.inf


@inner_allocating_kernel
def _try_direction(zones: Zones, p: Floats, az: float, up: float, limits: Floats,
                   best: Floats, work: Ints) -> bool:
    """Put the direction (az, up) [rad] into best (4,) if it is nearer: see `escape_point`."""
    if work[2]:
        return False
    t = _ray(zones, p, az, up, best, work)
    z = p[2] + t * math.sin(up)
    if t >= best[0] or not min(limits[0], p[2]) <= z <= max(limits[1], p[2]):
        return False
    best[0], best[1], best[2] = t, az, up
    return True


@inner_allocating_kernel
def _initial_directions(zones: Zones, p: Floats, limits: Floats, best: Floats,
                        work: Ints) -> None:
    """Try up, down, outwards of each zone around p, and a fan about the first."""
    base = np.nan
    _try_direction(zones, p, 0.0, 0.5 * math.pi, limits, best, work)
    _try_direction(zones, p, 0.0, -0.5 * math.pi, limits, best, work)
    for k in range(zones.size):
        zone = zones[k]
        if _depth(zone, p[0], p[1], p[2]) <= 0.0:
            continue
        dx, dy, dz = p[0] - zone.x, p[1] - zone.y, p[2] - zone.z
        az = math.atan2(dy, dx)
        base = az if math.isnan(base) else base
        _try_direction(zones, p, az, 0.0, limits, best, work)
        if zone.kind == DOME:
            up = max(0.0, math.atan2(dz, math.hypot(dx, dy)))
            _try_direction(zones, p, az, up, limits, best, work)
        if zone.kind == PRISM:
            n, c = zone.corner_count, floats_at(zone.corners)
            for i in range(n):
                j = (i + 1) % n
                outwards = math.atan2(c[2 * i] - c[2 * j], c[2 * j + 1] - c[2 * i + 1])
                _try_direction(zones, p, outwards, 0.0, limits, best, work)
    for i in range(2 * _DIRECTIONS):
        az, up = 2.0 * math.pi * i / _DIRECTIONS, 0.25 * math.pi * (i // _DIRECTIONS)
        _try_direction(zones, p, base + az, up, limits, best, work)


@inner_allocating_kernel
def escape_point(zones: Zones, p: Floats, limits: Floats, work: Ints) -> Floats:
    """The nearest point outside all zones on a ray from p, which is inside some.

    Tries 50 directions and those outwards of each zone, then refines the best by a pattern search.
    A ray that leads deeper into a zone is taken only where there is no other: within the clearance
    of a zone the way out is not through it.

    Args:
        p: float64 (3,) [m].

    Returns:
        float64 (3,) [m]; NaN: there is none, or the search was cut short (work[2]).
    """
    best, out = np.zeros(4), np.empty(3)  # distance, az, up, and 1 for no deeper ray
    best[0], best[3] = np.inf, 1.0
    _initial_directions(zones, p, limits, best, work)
    if math.isinf(best[0]):
        best[3] = 0.0
        _initial_directions(zones, p, limits, best, work)
    if math.isinf(best[0]):
        for m in range(3):
            out[m] = np.nan
        return out
    step = math.pi / _DIRECTIONS
    for _ in range(24):
        az, up = best[1], best[2]
        if not (_try_direction(zones, p, az + step, up, limits, best, work)
                or _try_direction(zones, p, az - step, up, limits, best, work)
                or _try_direction(zones, p, az, up + step, limits, best, work)
                or _try_direction(zones, p, az, up - step, limits, best, work)):
            step *= 0.5
    t, c = best[0], math.cos(best[2])
    out[0] = math.cos(best[1]) * c * t + p[0]
    out[1] = math.sin(best[1]) * c * t + p[1]
    out[2] = math.sin(best[2]) * t + p[2]
    return out
