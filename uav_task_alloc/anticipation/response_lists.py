# SPDX-License-Identifier: Apache-2.0
"""Lists of the event simulation: insertion, then moves of single tasks, by response and cover."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.anticipation.cover import (
    Cover,
    expected,
    expected_after,
    leave_out,
    set_times,
)
from uav_task_alloc.kernel import inner_kernel, kernel

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]
_Bools = NDArray[np.bool_]
_LEAST_GAIN = 1e-6  # [s] of a move, so that rounding cannot move a task to and fro
_LARGEST_COVER = 60.0  # [s] by which cover is taken to change the order of two insertions


class Tasks(NamedTuple):
    """The tasks of a run; n tasks in the order of their announcements."""

    x: _Floats  # (n) [m]
    y: _Floats  # (n) [m]
    announced: _Floats  # (n) [s]
    service: _Floats  # (n) [s]
    started: _Floats  # (n) [s] start of the service; nan before it
    value: _Floats  # (n) of each task; a wait counts that often


class Lists(NamedTuple):
    """Tasks whose service has not begun, in the order in which each of m UAVs flies them."""

    task: _Ints  # (m, n)
    length: _Ints  # (m) tasks of each UAV
    x: _Floats  # (m) [m] where the UAV is, or will be when its service ends
    y: _Floats  # (m) [m]
    free_in: _Floats  # (m) [s] until the service under way ends; 0.0: none is
    speed: _Floats  # (m) [m/s]
    allowed: _Bools  # (m, n) whether a task may be in the list of a UAV
    cover: Cover  # what the lists leave for the tasks to come


@inner_kernel
def add_task(tasks: Tasks, lists: Lists, task: int) -> None:
    """Insert a task where the sum of response times and the price of cover grow least. O(n^2)"""
    _set_cover(tasks, lists)
    uav, at, _ = _best_insertion(tasks, lists, task)
    _insert(lists, uav, at, task)


@inner_kernel
def improve_lists(tasks: Tasks, lists: Lists) -> None:
    """Move single tasks while the sum of response times and cover falls. O(n^3) a pass"""
    _set_cover(tasks, lists)
    moved = True
    while moved:
        moved = False
        for u in range(lists.length.size):
            i = 0
            while i < lists.length[u]:
                moved = _move(tasks, lists, u, i) or moved
                i += 1


@inner_kernel
def _move(tasks: Tasks, lists: Lists, u: int, i: int) -> bool:
    """Move task i of UAV u to its best position; whether the sum fell. O(n^2)"""
    task, before = lists.task[u, i], _cost(tasks, lists, u)
    _remove(lists, u, i)
    _cover_uav(tasks, lists, u)
    gain = before - _cost(tasks, lists, u)
    uav, at, more = _best_insertion(tasks, lists, task)
    better = more < gain - _LEAST_GAIN
    if better:
        _insert(lists, uav, at, task)
        _cover_uav(tasks, lists, uav)
    else:
        _insert(lists, u, i, task)
        _cover_uav(tasks, lists, u)
    return better


@inner_kernel
def _covers(lists: Lists) -> bool:
    """Whether cover counts. O(1)"""
    return bool(lists.cover.tasks[0] > 0.0)


@inner_kernel
def _set_cover(tasks: Tasks, lists: Lists) -> None:
    """Set how much cover counts, and the times of all UAVs. O(m k)"""
    idle, prices = 0, lists.cover.prices
    for u in range(lists.length.size):
        idle += lists.length[u] == 0 and lists.free_in[u] <= 0.0
    lists.cover.tasks[0] = max(prices.least, prices.tasks * idle)
    for u in range(lists.length.size):
        _cover_uav(tasks, lists, u)


@inner_kernel
def _cover_uav(tasks: Tasks, lists: Lists, u: int) -> None:
    """Set the times of UAV u after its list has changed. O(n + k)"""
    if _covers(lists):
        t, x, y = end_of_list(tasks, lists, u)
        if t <= 0.0:
            x, y = lists.cover.waiting[u, 0], lists.cover.waiting[u, 1]
        set_times(lists.cover, u, t, x, y, lists.speed[u])


@inner_kernel
def _cost(tasks: Tasks, lists: Lists, u: int) -> float:
    """The waits [s] of UAV u and the price of cover. O(n + m k)"""
    waits = _waits(tasks, lists, u, -1, -1)
    if _covers(lists):
        leave_out(lists.cover, u)
        waits += expected(lists.cover, u)
    return waits


@inner_kernel
def _best_insertion(tasks: Tasks, lists: Lists, task: int) -> tuple[int, int, float]:
    """The UAV, the position and the growth of waits and cover [s]. O(n^2 + m^2 k)

    Cover is computed only where it may decide.
    """
    uav, at, least, here = -1, -1, math.inf, 0.0
    margin = _LARGEST_COVER * lists.cover.tasks[0]
    for u in range(lists.length.size):
        if not lists.allowed[u, task]:
            continue
        now, known = _waits(tasks, lists, u, -1, -1), False
        for i in range(lists.length[u] + 1):
            more = _waits(tasks, lists, u, i, task) - now
            if _covers(lists) and more < least + margin:
                if not known:
                    leave_out(lists.cover, u)
                    here, known = expected(lists.cover, u), True
                t, x, y = _end_with(tasks, lists, u, i, task)
                more += expected_after(lists.cover, t, x, y, lists.speed[u]) - here
            if more < least:
                uav, at, least = u, i, more
    return uav, at, least


@inner_kernel
def _waits(tasks: Tasks, lists: Lists, u: int, at: int, task: int) -> float:
    """Sum of value times time [s] until each service of UAV u, with a task at a position. O(n)"""
    t, x, y, total = lists.free_in[u], lists.x[u], lists.y[u], 0.0
    for i in range(lists.length[u] + (task >= 0)):
        k = task
        if task < 0 or i != at:
            k = lists.task[u, i - (task >= 0 and i > at)]
        t += math.hypot(tasks.x[k] - x, tasks.y[k] - y) / lists.speed[u]
        total += tasks.value[k] * t
        t += tasks.service[k]
        x, y = tasks.x[k], tasks.y[k]
    return total


@inner_kernel
def _insert(lists: Lists, u: int, at: int, task: int) -> None:
    """Insert a task into the list of UAV u. O(n)"""
    for i in range(lists.length[u], at, -1):
        lists.task[u, i] = lists.task[u, i - 1]
    lists.task[u, at] = task
    lists.length[u] += 1


@inner_kernel
def _remove(lists: Lists, u: int, at: int) -> None:
    """Remove a task from the list of UAV u. O(n)"""
    lists.length[u] -= 1
    for i in range(at, lists.length[u]):
        lists.task[u, i] = lists.task[u, i + 1]


@inner_kernel
def take_first(lists: Lists, u: int) -> int:
    """Remove the first task of UAV u, whose service begins, and return it. O(n)"""
    task = int(lists.task[u, 0])
    _remove(lists, u, 0)
    return task


@inner_kernel
def end_of_list(tasks: Tasks, lists: Lists, u: int) -> tuple[float, float, float]:
    """The time [s] until UAV u has flown its list, and where it will be [m]. O(n)"""
    return _end_with(tasks, lists, u, -1, -1)


@inner_kernel
def _end_with(tasks: Tasks, lists: Lists, u: int, at: int,
              task: int) -> tuple[float, float, float]:
    """As `end_of_list` with a task at a position; -1, -1: none. O(n)"""
    t, x, y = lists.free_in[u], lists.x[u], lists.y[u]
    for i in range(lists.length[u] + (task >= 0)):
        k = task
        if task < 0 or i != at:
            k = lists.task[u, i - (task >= 0 and i > at)]
        t += math.hypot(tasks.x[k] - x, tasks.y[k] - y) / lists.speed[u] + tasks.service[k]
        x, y = tasks.x[k], tasks.y[k]
    return t, x, y


@kernel
def spread_lists(tasks: Tasks, lists: Lists) -> None:
    """Move single tasks of lists as the simulation does. O(n^3) a pass

    Args:
        tasks: in the lists.
        lists: are changed.
    """
    improve_lists(tasks, lists)


@kernel
def cover_price(tasks: Tasks, lists: Lists, count: float) -> float:
    """The expected response times of the next tasks, after all lists.

    Args:
        tasks: in the lists.
        lists: of one UAV at least.
        count: tasks to come that are counted.

    Returns:
        [s], the sum over these tasks. O(m k)
    """
    _set_cover(tasks, lists)
    lists.cover.tasks[0] = count
    leave_out(lists.cover, 0)
    return expected(lists.cover, 0)
