# SPDX-License-Identifier: Apache-2.0
"""Placement of labels next to their markers, greedily at the side with the least overlap."""
from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from uav_task_alloc.plots.style import halo

# positions of a label around its marker, the best first: (right, up), alignment of the text
SIDES = ((1, 0, 'left', 'center'), (0, 1, 'center', 'bottom'), (0, -1, 'center', 'top'),
         (-1, 0, 'right', 'center'), (0.8, 0.8, 'left', 'bottom'), (0.8, -0.8, 'left', 'top'),
         (-0.8, 0.8, 'right', 'bottom'), (-0.8, -0.8, 'right', 'top'))
WITHIN = ((0, 0, 'center', 'center'), (0, -1, 'center', 'top'), (0, 1, 'center', 'bottom'),
          (1, 0, 'left', 'center'), (-1, 0, 'right', 'center'))
_LETTER_WIDTH, _LINE_HEIGHT = 0.62, 1.15  # in font sizes
_STEP = 6.0  # [px] between the points that sample a line

Box = tuple[float, float, float, float]  # [px] left, low, right, high


@dataclass(frozen=True, slots=True)
class Label:
    """A text and the marker that it belongs to."""

    text: str
    x: float  # in data coordinates
    y: float
    size: float  # [pt] of the letters
    offset: float  # [pt] from the center of the marker
    colour: str = 'black'
    bold: bool = False
    within: bool = False  # of an area: there is no marker to keep clear of


def place_labels(axes: Axes, labels: Sequence[Label],
                 lines: Iterable[Sequence[tuple[float, float]]]) -> None:
    """Annotate axes with labels. O(labels * (labels + points)).

    Args:
        axes: with final limits.
        labels: placed in this order.
        lines: polylines in data coordinates, which labels avoid.
    """
    scale = axes.figure.dpi / 72.0
    markers = [(*axes.transData.transform((label.x, label.y)), label.offset * scale)
               for label in labels]
    taken = [(x - r, y - r, x + r, y + r)
             for each, (x, y, r) in zip(labels, markers, strict=True) if not each.within]
    samples = np.vstack([np.empty((0, 2)), *(_sampled(axes.transData.transform(line))
                                             for line in lines)])
    for each, (x, y, offset) in zip(labels, markers, strict=True):
        sides = WITHIN if each.within else SIDES
        boxes = [_box(each, x, y, offset, side, scale) for side in sides]
        costs = [_overlap(box, taken, samples) + 0.01 * i for i, box in enumerate(boxes)]
        best = costs.index(min(costs))
        taken.append(boxes[best])
        right, up, ha, va = sides[best]
        axes.annotate(each.text, (each.x, each.y), (right * each.offset, up * each.offset),
                      textcoords='offset points', ha=ha, va=va, fontsize=each.size,
                      color=each.colour, fontweight='bold' if each.bold else 'normal',
                      path_effects=halo(), zorder=9, annotation_clip=False)


def _box(each: Label, x: float, y: float, offset: float, side: tuple[float, float, str, str],
         scale: float) -> Box:
    right, up, ha, va = side
    lines = each.text.split('\n')
    width = _LETTER_WIDTH * each.size * scale * max(map(len, lines))
    height = _LINE_HEIGHT * each.size * scale * len(lines)
    left = x + right * offset - width * {'left': 0.0, 'center': 0.5, 'right': 1.0}[ha]
    low = y + up * offset - height * {'bottom': 0.0, 'center': 0.5, 'top': 1.0}[va]
    return left, low, left + width, low + height


def _overlap(box: Box, taken: Iterable[Box], samples: NDArray[np.float64]) -> float:
    """Cost of a label here: the shares of it and of others that overlap, and of lines less."""
    left, low, right, high = box
    area = (right - left) * (high - low)
    shared = sum(max(0.0, min(right, r) - max(left, a)) * max(0.0, min(high, h) - max(low, b))
                 / min(area, (r - a) * (h - b)) for a, b, r, h in taken)
    covered = ((samples >= (left, low)) & (samples <= (right, high))).all(axis=1).sum()
    return 4.0 * shared + 0.1 * float(covered)


def _sampled(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points along a polyline, (n, 2) [px], at most _STEP apart."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
    at = np.arange(0.0, along[-1] + _STEP, _STEP)
    return np.column_stack([np.interp(at, along, line[:, k]) for k in (0, 1)])
