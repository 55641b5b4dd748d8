# SPDX-License-Identifier: Apache-2.0
"""Upright boxes by the cells of a grid in plan view: which of them may a segment enter?"""
from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.model import Point

_MOST_SIDE = 64  # cells along a side
_MOST_CELLS = 16  # that a segment spans, else all boxes are compared at once
_MOST_SHARE = 0.25  # of the cells that a box covers; a larger one is near to every segment


class BoxGrid:
    """Boxes in a grid over all of them.

    Args:
        low, high: (n, 3) lowest and highest corners [m]; z may be infinite.
    """

    def __init__(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
        self._low, self._high = low, high
        self._side = min(_MOST_SIDE, 1 + 2 * math.isqrt(len(low)))
        self._corner = low[:, :2].min(axis=0).tolist() if len(low) else [0.0, 0.0]
        wide = (high[:, :2].max(axis=0) - self._corner).tolist() if len(low) else [1.0, 1.0]
        self._per_metre = [self._side / max(each, 1e-3) for each in wide]
        cells: dict[tuple[int, int], list[int]] = {}
        self._large: list[int] = []
        for k, (a, b) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
            i0, i1, j0, j1 = self._span(*a[:2], *b[:2])
            if (i1 - i0 + 1) * (j1 - j0 + 1) > _MOST_SHARE * self._side**2:
                self._large.append(k)
                continue
            for i in range(i0, i1 + 1):
                for j in range(j0, j1 + 1):
                    cells.setdefault((i, j), []).append(k)
        self._cells = cells

    def near(self, a: Point, b: Point) -> Iterable[int]:
        """Return the boxes that a segment may enter, by index; most others are left out.

        Args:
            a, b: its ends [m].

        Returns:
            Each box that touches that of the segment, and perhaps more.
        """
        (ax, ay, _), (bx, by, _) = a, b
        i0, i1, j0, j1 = self._span(min(ax, bx), min(ay, by), max(ax, bx), max(ay, by))
        if (i1 - i0 + 1) * (j1 - j0 + 1) > _MOST_CELLS:
            touch = (np.maximum(a, b) >= self._low) & (np.minimum(a, b) <= self._high)
            return np.flatnonzero(touch.all(axis=1)).tolist()
        if i0 == i1 and j0 == j1 and not self._large:
            return self._cells.get((i0, j0), ())
        found = set(self._large)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                found.update(self._cells.get((i, j), ()))
        return found

    def _span(self, x0: float, y0: float, x1: float, y1: float) -> tuple[int, int, int, int]:
        """First and last cell in x and y of a box; those beyond the grid are in its border."""
        (cx, cy), (px, py), last = self._corner, self._per_metre, self._side - 1
        return (max(0, min(last, int((x0 - cx) * px))), max(0, min(last, int((x1 - cx) * px))),
                max(0, min(last, int((y0 - cy) * py))), max(0, min(last, int((y1 - cy) * py))))
