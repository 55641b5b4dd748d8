# SPDX-License-Identifier: Apache-2.0
"""Lists of a fleet by response time and cover: plain values to the kernels, and back."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.anticipation.cover import COVER_PRICES, CoverPrices, make_cover
from uav_task_alloc.anticipation.response_lists import (
    Lists,
    Tasks,
    cover_price,
    spread_lists,
)

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Outlook:
    """Where the next task is expected."""

    x: _Floats  # (k) [m] east
    y: _Floats  # (k) [m] north
    weight: _Floats  # (k) probability of the next task there, times its value; the sum is 1
    value: float = 1.0  # mean value of a task, > 0
    prices: CoverPrices = COVER_PRICES  # of cover


class ListEnd(NamedTuple):
    """A UAV from where the part of its list on ends that stays as it is."""

    free_in: float  # [s] until then; 0.0: it has no tasks there
    x: float  # [m] east, where it will be then
    y: float  # [m] north
    waiting: tuple[float, float]  # [m] where it waits while it has no task
    speed: float  # [m/s]


class PlainTask(NamedTuple):
    """A point to be served; it may move between lists."""

    x: float  # [m] east
    y: float  # [m] north
    service: float  # [s]
    value: float  # > 0


def spread(outlook: Outlook, ends: Sequence[ListEnd], tasks: Sequence[PlainTask],
           rows: Sequence[Sequence[int]], allowed: NDArray[np.bool_]) -> list[list[int]]:
    """Move tasks between lists, by the sum of waits and cover.

    Args:
        outlook: where the next task is expected.
        ends: of m UAVs.
        tasks: n.
        rows: of each UAV its tasks in the order of flight, by index.
        allowed: (m, n) whether a task may be in the list of a UAV.

    Returns:
        As `rows`.
    """
    some, lists = _arrays(outlook, ends, tasks, rows, allowed)
    spread_lists(some, lists)
    return [[int(k) for k in lists.task[u, :lists.length[u]]] for u in range(len(ends))]


def price(outlook: Outlook, ends: Sequence[ListEnd], idle: int) -> float:
    """What the next tasks will wait after all lists [s], in sums of waits.

    Args:
        outlook: where the next task is expected.
        ends: of all lists.
        idle: UAVs for each of which a task counts.

    Returns:
        The expected response time, times the tasks that count; 0.0 without UAVs.
    """
    if not ends:
        return 0.0
    tasks, lists = _arrays(outlook, ends, (), [()] * len(ends), np.zeros((len(ends), 0), bool))
    prices = outlook.prices
    return float(cover_price(tasks, lists, max(prices.least, prices.tasks * idle)))


def _arrays(outlook: Outlook, ends: Sequence[ListEnd], tasks: Sequence[PlainTask],
            rows: Sequence[Sequence[int]], allowed: NDArray[np.bool_]) -> tuple[Tasks, Lists]:
    """All of it as the kernels take it."""
    m, n = len(ends), len(tasks)
    x, y, service, value = np.array(tasks, float).reshape(n, 4).T.copy()
    none = np.full(n, math.nan)
    row = np.full((m, n + 1), -1)
    for u, each in enumerate(rows):
        row[u, :len(each)] = each
    cover = make_cover(outlook.prices, outlook.x, outlook.y,
                       np.array([each.waiting for each in ends]))
    cover.weight[:] = outlook.weight
    free_in, at_x, at_y = np.array([each[:3] for each in ends], float).T.copy()
    return Tasks(x, y, none, service, none, value / outlook.value), Lists(
        row, np.array([len(each) for each in rows]), at_x, at_y, free_in,
        np.array([each.speed for each in ends]), np.ascontiguousarray(allowed), cover)


def load_spread_kernels() -> None:
    """Load the kernels, compile those not on disk yet."""
    outlook = Outlook(np.zeros(1), np.zeros(1), np.ones(1))
    ends = [ListEnd(0.0, 0.0, 0.0, (0.0, 0.0), 1.0)] * 2
    spread(outlook, ends, [PlainTask(1.0, 0.0, 0.0, 1.0)], [[0], []], np.ones((2, 1), bool))
    price(outlook, ends, 1)
