# SPDX-License-Identifier: Apache-2.0
"""Points among zones, and the kernel that finds the way from one to another."""
from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import carray  # type: ignore[attr-defined]

from uav_task_alloc.geometry.escape import way_out
from uav_task_alloc.geometry.numba_pointers import floats_at, ints_at
from uav_task_alloc.geometry.obstacles import Floats, Ints, Zones, first_around, zones_at
from uav_task_alloc.geometry.path_store import PathStore, recall, remember
from uav_task_alloc.geometry.search_budget import SearchBudget, is_over, new_work
from uav_task_alloc.geometry.shortest_path import is_clear, shortest
from uav_task_alloc.geometry.taut import MAX_CORNERS, copy_point, length_of
from uav_task_alloc.kernel import allocating_kernel

OUTSIDE, SNUG, INSIDE = 0, 1, 2
CAUGHT, EFFORT = 3, 7  # where `addresses` has those of Scene.caught and Scene.state


class PathScene(NamedTuple):
    """Points among zones, as kernels take them."""

    xyz: Floats  # (n, 3) [m]
    caught: Ints  # OUTSIDE, SNUG (less than the skin away) or INSIDE
    out: Floats  # (n, 3) [m], where a caught point is outside first; NaN: nowhere; inf: not sought
    limits: Floats  # altitude_min, altitude_max [m]
    zones: Zones
    state: Ints  # of Effort
    store: int  # address of a WayStore


def make_scene(xyz: Floats, zones: Zones, limits: Floats, effort: SearchBudget,
               store: PathStore) -> PathScene:
    """The scene; ways out of zones are found when they are asked for."""
    caught, out = np.zeros(len(xyz), np.int64), np.full((len(xyz), 3), np.inf)
    if zones.size:
        _catch(zones, xyz, caught)
    return PathScene(xyz, caught, out, limits, zones, effort.state, store.address)


@allocating_kernel
def how_caught(o: Zones, p: Floats) -> int:
    """Whether p is INSIDE a zone, SNUG at one or OUTSIDE all."""
    if first_around(o, p[0], p[1], p[2], False) < 0:
        return OUTSIDE
    return INSIDE if first_around(o, p[0], p[1], p[2], True) >= 0 else SNUG


@allocating_kernel
def _catch(o: Zones, xyz: Floats, caught: Ints) -> None:
    for i in range(xyz.shape[0]):
        caught[i] = how_caught(o, xyz[i])


@allocating_kernel
def _leave(scene: PathScene, i: int, work: Ints) -> Floats:
    """Where the caught point i is outside first; NaN: nowhere, or work[2]: not known."""
    if math.isinf(scene.out[i, 0]):
        free: Floats = way_out(scene.zones, scene.xyz[i], scene.limits, work)
        if work[2] == 0:  # x last, which others look at
            scene.out[i, 2], scene.out[i, 1], scene.out[i, 0] = free[2], free[1], free[0]
        return free
    first: Floats = scene.out[i]
    return first


def addresses(scene: PathScene) -> Ints:
    """Sizes and addresses of the scene's arrays, in the order that `_scene_at` reads."""
    return np.array([len(scene.xyz), len(scene.zones),
                     *(array.ctypes.data for array in scene[:6]), scene.store], np.int64)


@allocating_kernel
def _scene_at(address: int) -> PathScene:
    at = ints_at(address)
    n, k = at[0], at[1]
    return PathScene(
        carray(floats_at(at[2]), (n, 3)), carray(ints_at(at[3]), n),
        carray(floats_at(at[4]), (n, 3)), carray(floats_at(at[5]), 2),
        carray(zones_at(at[6]), k), carray(ints_at(at[7]), 5), at[8])


@allocating_kernel
def in_order(p: Floats, q: Floats, ends: Floats) -> bool:
    """Both into ends in one order, so that there and back are the same way; whether turned."""
    turned = bool(p[0] > q[0] or (
        p[0] == q[0] and (p[1] > q[1] or (p[1] == q[1] and p[2] > q[2]))))
    for m in range(3):
        ends[0, m], ends[1, m] = (q[m], p[m]) if turned else (p[m], q[m])
    return turned


@allocating_kernel
def kept_as(scene: PathScene, i: int, j: int, ends: Floats) -> bool:
    """The ends by which the way from i to j is kept; whether it is kept the other way round.

    One out of a zone is no way back, and begins with the point outside.
    """
    if scene.caught[i] != INSIDE:
        return bool(in_order(scene.xyz[i], scene.xyz[j], ends))
    copy_point(scene.xyz, i, ends, 0)
    copy_point(scene.xyz, j, ends, 1)
    return False


@allocating_kernel
def kept_way(scene: PathScene, i: int, j: int, way: Floats) -> int:
    """The points of the way from i to j that is known, if it is clear; their number or 0."""
    ends, caught = np.empty((2, 3)), scene.caught[i] == INSIDE
    snug = scene.caught[i] == SNUG or scene.caught[j] == SNUG
    floor = min(scene.xyz[i, 2], scene.xyz[j, 2])
    turned = kept_as(scene, i, j, ends)
    copy_point(ends, 0, way, 0)
    copy_point(ends, 1, way, 1)
    n = 0 if caught or not is_clear(scene.zones, way, 2, floor, snug) else 2
    if n == 0:
        n = recall(scene.store, ends, way)
        first = 1 if caught else 0
        if caught:
            floor = min(way[1, 2], scene.xyz[j, 2])
        if n <= first or not is_clear(scene.zones, way[first:], n - first, floor, snug):
            return 0
    if turned:
        for m in range(n // 2):
            for c in range(3):
                way[m, c], way[n - 1 - m, c] = way[n - 1 - m, c], way[m, c]
    return n


def _join(address: int, i: int, between: int) -> float:
    """Keep the ways from i to k and on to j as one; its length [m] or inf.

    between: k << 32 | j.
    """
    scene, k, j = _scene_at(address), between >> 32, between & 0xFFFFFFFF
    way, onward = np.empty((2 * MAX_CORNERS, 3)), np.empty((MAX_CORNERS, 3))
    n, more = kept_way(scene, i, k, way), kept_way(scene, k, j, onward)
    if n == 0 or more == 0 or n + more > MAX_CORNERS or scene.caught[k] == INSIDE:
        return np.inf
    for m in range(1, more):
        copy_point(onward, m, way, n)
        n += 1
    found, ends = length_of(way, n), np.empty((2, 3))
    if kept_as(scene, i, j, ends):
        way[:n] = way[:n][::-1].copy()
    remember(scene.store, way, n, ends)
    return found


def _find(address: int, i: int, j: int) -> float:
    """Length [m] of the way from point i to point j of the scene; inf: none, NaN: not known."""
    scene = _scene_at(address)
    if i == j:
        return 0.0
    if scene.caught[j] == INSIDE:
        return np.inf
    effort = ints_at(address)[EFFORT]
    if is_over(effort):
        return np.nan
    work, p, q, first = new_work(effort), scene.xyz[i], scene.xyz[j], 0.0
    if scene.caught[i] == INSIDE:
        p = _leave(scene, i, work)
        if work[2] or math.isnan(p[0]):
            return np.nan if work[2] else np.inf
        first = math.hypot(math.hypot(p[0] - scene.xyz[i, 0], p[1] - scene.xyz[i, 1]),
                           p[2] - scene.xyz[i, 2])
    ends = np.empty((2, 3))
    turned = in_order(p, q, ends)
    snug = scene.caught[i] == SNUG or scene.caught[j] == SNUG
    way = np.empty((MAX_CORNERS + 1, 3))
    n, found = shortest(scene.zones, ends, scene.limits, snug, way[1:], work)
    if n > 2:
        if scene.caught[i] != INSIDE:
            remember(scene.store, way[1:], n, ends)
        elif n < MAX_CORNERS:
            if turned:
                way[1:n + 1] = way[1:n + 1][::-1].copy()
            copy_point(scene.xyz, i, way, 0)
            kept_as(scene, i, j, ends)
            remember(scene.store, way, n + 1, ends)
    return first + found


@functools.cache
def _compiled(join: bool) -> Any:
    signature = numba.float64(numba.int64, numba.int64, numba.int64)
    return numba.cfunc(signature, cache=True)(_join if join else _find)


def finder(zones: bool) -> int:
    """Address of `_find`, compiled apart so that its callers compile fast; 0 without zones."""
    return int(_compiled(False).address) if zones else 0


def joiner(zones: bool) -> int:
    """Address of `_join`; 0 without zones."""
    return int(_compiled(True).address) if zones else 0
