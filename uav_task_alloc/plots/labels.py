# SPDX-License-Identifier: Apache-2.0
"""Names beside their marks: each at the side where it hides least of what is there already."""
from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from uav_task_alloc.plots.style import halo

# where a name stands from its mark, the best first: (right, up) and how the text is aligned
SIDES = ((1, 0, 'left', 'center'), (0, 1, 'center', 'bottom'), (0, -1, 'center', 'top'),
         (-1, 0, 'right', 'center'), (0.8, 0.8, 'left', 'bottom'), (0.8, -0.8, 'left', 'top'),
         (-0.8, 0.8, 'right', 'bottom'), (-0.8, -0.8, 'right', 'top'))
WITHIN = ((0, 0, 'center', 'center'), (0, -1, 'center', 'top'), (0, 1, 'center', 'bottom'),
          (1, 0, 'left', 'center'), (-1, 0, 'right', 'center'))
WIDE, TALL = 0.62, 1.15  # of a letter, in font sizes
_STEP = 6.0  # [px] between the points that stand for a line

Box = tuple[float, float, float, float]  # [px] left, low, right, high


@dataclass(frozen=True, slots=True)
class Label:
    """A name, and the mark that it belongs to."""

    text: str
    x: float  # in data
    y: float
    size: float  # [pt] of the letters
    away: float  # [pt] from the middle of the mark
    colour: str = 'black'
    bold: bool = False
    within: bool = False  # an area, and so no mark to keep clear of


def place_labels(axes: Axes, labels: Sequence[Label], ways: Iterable[Sequence[tuple[float, float]]]
          ) -> None:
    """Write labels; `ways` are lines in data, which names had better not cover.

    The limits of the axes must be final.
    """
    scale = axes.figure.dpi / 72.0
    marks = [(*axes.transData.transform((each.x, each.y)), each.away * scale) for each in labels]
    taken = [(x - r, y - r, x + r, y + r)
             for each, (x, y, r) in zip(labels, marks, strict=True) if not each.within]
    dots = np.vstack([np.empty((0, 2)), *(_dots(axes.transData.transform(way)) for way in ways)])
    for each, (x, y, away) in zip(labels, marks, strict=True):
        sides = WITHIN if each.within else SIDES
        boxes = [_box(each, x, y, away, side, scale) for side in sides]
        costs = [_hidden(box, taken, dots) + 0.01 * i for i, box in enumerate(boxes)]
        best = costs.index(min(costs))
        taken.append(boxes[best])
        right, up, ha, va = sides[best]
        axes.annotate(each.text, (each.x, each.y), (right * each.away, up * each.away),
                      textcoords='offset points', ha=ha, va=va, fontsize=each.size,
                      color=each.colour, fontweight='bold' if each.bold else 'normal',
                      path_effects=halo(), zorder=9, annotation_clip=False)


def _box(each: Label, x: float, y: float, away: float, side: tuple[float, float, str, str],
         scale: float) -> Box:
    right, up, ha, va = side
    lines = each.text.split('\n')
    width = WIDE * each.size * scale * max(map(len, lines))
    height = TALL * each.size * scale * len(lines)
    left = x + right * away - width * {'left': 0.0, 'center': 0.5, 'right': 1.0}[ha]
    low = y + up * away - height * {'bottom': 0.0, 'center': 0.5, 'top': 1.0}[va]
    return left, low, left + width, low + height


def _hidden(box: Box, taken: Iterable[Box], dots: NDArray[np.float64]) -> float:
    """How much a name would hide: other names and marks most, lines less."""
    left, low, right, high = box
    area = (right - left) * (high - low)
    shared = sum(max(0.0, min(right, r) - max(left, a)) * max(0.0, min(high, h) - max(low, b))
                 for a, b, r, h in taken)
    under = ((dots >= (left, low)) & (dots <= (right, high))).all(axis=1).sum()
    return 4.0 * shared / area + 0.1 * float(under)


def _dots(way: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points along a line, no further apart than STEP [px]."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))))
    at = np.arange(0.0, along[-1] + _STEP, _STEP)
    return np.column_stack([np.interp(at, along, way[:, k]) for k in (0, 1)])
