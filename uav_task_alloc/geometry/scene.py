# SPDX-License-Identifier: Apache-2.0
"""Points among zones, and the kernel that finds the way from one to another."""
from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import carray  # type: ignore[attr-defined]

from uav_task_alloc.geometry.exits import way_out
from uav_task_alloc.geometry.memory import floats_at, ints_at
from uav_task_alloc.geometry.obstacles import Floats, Ints, Zones, first_around, zones_at
from uav_task_alloc.geometry.taut import MAX_CORNERS, span
from uav_task_alloc.geometry.ways import next_hit, shortest

OUTSIDE, SNUG, INSIDE = 0, 1, 2
CAUGHT = 3  # where `addresses` has that of Scene.caught


class Scene(NamedTuple):
    """Points among zones, as kernels take them."""

    xyz: Floats  # (n, 3) [m]
    caught: Ints  # OUTSIDE, SNUG (less than the skin away) or INSIDE
    out: Floats  # (n, 3) [m], where a caught point is outside first; NaN: nowhere
    limits: Floats  # altitude_min, altitude_max [m]
    zones: Zones


def make_scene(xyz: Floats, zones: Zones, limits: Floats) -> Scene:
    """The scene, with the way out of every caught point."""
    caught, out = np.zeros(len(xyz), np.int64), np.full((len(xyz), 3), np.nan)
    if zones.size:
        _catch(zones, xyz, limits, caught, out)
    return Scene(xyz, caught, out, limits, zones)


@numba.njit(cache=True, nogil=True)
def how_caught(o: Zones, p: Floats) -> int:
    """Whether p is INSIDE a zone, SNUG at one or OUTSIDE all."""
    if first_around(o, p[0], p[1], p[2], False) < 0:
        return OUTSIDE
    return INSIDE if first_around(o, p[0], p[1], p[2], True) >= 0 else SNUG


@numba.njit(cache=True, nogil=True)
def _catch(o: Zones, xyz: Floats, limits: Floats, caught: Ints, out: Floats) -> None:
    for i in range(xyz.shape[0]):
        caught[i] = how_caught(o, xyz[i])
        if caught[i] == INSIDE:
            free = way_out(o, xyz[i], limits)
            out[i, 0], out[i, 1], out[i, 2] = free[0], free[1], free[2]


def addresses(scene: Scene) -> Ints:
    """Sizes and addresses of the scene's arrays, in the order that `_scene_at` reads."""
    return np.array([len(scene.xyz), len(scene.zones),
                     *(array.ctypes.data for array in scene)], np.int64)


@numba.njit(cache=True, nogil=True)
def _scene_at(address: int) -> Scene:
    at = ints_at(address)
    n, k = at[0], at[1]
    return Scene(
        carray(floats_at(at[2]), (n, 3)), carray(ints_at(at[3]), n),
        carray(floats_at(at[4]), (n, 3)), carray(floats_at(at[5]), 2),
        carray(zones_at(at[6]), k))


def _find(address: int, i: int, j: int) -> float:
    """Length [m] of the way from point i to point j of the scene; inf: none."""
    scene = _scene_at(address)
    if i == j:
        return 0.0
    if scene.caught[j] == INSIDE:
        return np.inf
    p, q, first = scene.xyz[i], scene.xyz[j], 0.0
    if scene.caught[i] == INSIDE:
        p = scene.out[i]
        if math.isnan(p[0]):
            return np.inf
        first = math.hypot(math.hypot(p[0] - scene.xyz[i, 0], p[1] - scene.xyz[i, 1]),
                           p[2] - scene.xyz[i, 2])
    ends = np.empty((2, 3))  # in one order, so that there and back are the same way
    backwards = p[0] > q[0] or (p[0] == q[0] and (p[1] > q[1] or (p[1] == q[1] and p[2] > q[2])))
    for m in range(3):
        ends[0, m], ends[1, m] = (q[m], p[m]) if backwards else (p[m], q[m])
    snug = scene.caught[i] == SNUG or scene.caught[j] == SNUG
    if next_hit(scene.zones, 0, ends, 0, 1, min(p[2], q[2]), snug) == scene.zones.size:
        return first + span(ends, 0, 1)
    return first + shortest(scene.zones, ends, scene.limits, snug,
                            np.empty((MAX_CORNERS, 3)))[1]


@functools.cache
def _compiled() -> Any:
    signature = numba.float64(numba.int64, numba.int64, numba.int64)
    return numba.cfunc(signature, cache=True)(_find)


def finder(zones: bool) -> int:
    """Address of `_find`, compiled apart so that its callers compile fast; 0 without zones."""
    return int(_compiled().address) if zones else 0
