# SPDX-License-Identifier: Apache-2.0
"""A map built step by step: shapes are added at once, labels placed when all shapes are known."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

import uav_task_alloc.plots.style as style
from uav_task_alloc.model import Point, Shape, ThreatZone
from uav_task_alloc.palette import DARK_RED, RED, uav_colour
from uav_task_alloc.plots.labels import Label, place_labels
from uav_task_alloc.plots.style import ROUTE, SMALL


class MapFigure:
    """A map of zones, routes and tasks: east to the right, north up, in metres.

    Args:
        points: of the tasks [m]; rings show hemispheres at their median height.
        tasks: how many will be drawn.
        beside: leave half of the figure to other axes, `beside`.
    """

    def __init__(self, points: Iterable[Point], tasks: int, beside: bool = False) -> None:
        self.figure = Figure(figsize=style.SIZE, dpi=style.DPI, layout='constrained')
        self.axes = self.figure.add_subplot(1, 1 + beside, 1)
        self.beside = self.figure.add_subplot(1, 2, 2) if beside else None
        self.height = median([point[2] for point in points] or [0.0])
        self.shows_names = tasks <= style.MAX_NAMED_TASKS
        self._labels: list[Label] = []
        self._routes: list[list[tuple[float, float]]] = []
        self._rings = 0
        self._zones = 0
        self.axes.set_aspect('equal', adjustable='datalim')
        self.axes.set_xlabel('east [m]', fontsize=style.PLAIN)
        self.axes.set_ylabel('north [m]', fontsize=style.PLAIN)
        for axes in self.figure.axes:
            axes.grid(color='#e4e4e4', lw=0.8, zorder=0)
            axes.set_axisbelow(True)
            axes.tick_params(labelsize=style.PLAIN)
            for side in ('top', 'right'):
                axes.spines[side].set_visible(False)

    def zone(self, zone: ThreatZone, note: str = '', late: bool = False) -> None:
        """Add the footprint of a zone, dashed where `late`; dotted: the margin of a round one."""
        self._zones += 1
        hatch = {'fill': False, 'lw': 0.0, 'hatch': '///', 'ec': (*style.ZONE_FILL[:3], 0.3)}
        area = {'fc': style.ZONE_FILL, 'ec': RED, 'lw': 2.0, 'ls': '--' if late else '-'}
        for options in (hatch, area):
            self.axes.add_patch(_footprint(zone, **options))
        if zone.shape is Shape.POLYGON:
            x, y = (sum(values) / len(values) for values in zip(*zone.vertices, strict=True))
        else:
            x, y, _ = zone.center
            self.axes.add_patch(Circle((x, y), zone.radius + zone.margin, fill=False, ec=RED,
                                       lw=1.0, ls=':', zorder=2))
            self._ring(zone)
        text = '\n'.join(filter(None, (zone.id, style.height_text(zone), note)))
        self._labels.append(Label(text, x, y, SMALL, 12.0, DARK_RED, bold=True, within=True))

    def fence_area(self, corners: Sequence[tuple[float, float]]) -> None:
        """Add the area [m] that plans stay in, if there is one."""
        if corners:
            x, y = zip(*corners, corners[0], strict=True)
            self.axes.plot(x, y, '--', color=RED, lw=2.0, zorder=2)

    def _ring(self, zone: ThreatZone) -> None:
        """The section of a hemisphere at the median height of the tasks."""
        above = self.height - zone.center[2]
        if zone.shape is Shape.HEMISPHERE and 0.0 < above < zone.radius:
            self._rings += 1
            self.axes.add_patch(Circle(zone.center[:2], math.sqrt(zone.radius ** 2 - above ** 2),
                                       fc=style.ZONE_FILL, ec=RED, lw=1.0, zorder=2))

    def route(self, points: Sequence[Point], index: int, arrows: bool = False) -> None:
        """Add the route or track of a UAV, with arrows in flight direction if asked for."""
        flat = [(point[0], point[1]) for point in points]
        self._routes.append(flat)
        width = ROUTE if self.shows_names else 0.6 * ROUTE
        xs, ys = zip(*flat, strict=True)
        self.axes.plot(xs, ys, color='white', lw=width + 2.0, zorder=4, solid_capstyle='round')
        self.axes.plot(xs, ys, color=uav_colour(index), ls=style.line_style(index), lw=width,
                       zorder=4.1, solid_capstyle='round')
        for (x0, y0), (x1, y1) in pairwise(flat) if arrows else ():
            self.axes.annotate('', (0.4 * x0 + 0.6 * x1, 0.4 * y0 + 0.6 * y1),
                               (0.45 * x0 + 0.55 * x1, 0.45 * y0 + 0.55 * y1), zorder=4.2,
                               arrowprops={'arrowstyle': '-|>', 'mutation_scale': 24.0, 'lw': 0.0,
                                           'color': uav_colour(index)})

    def way(self, points: Sequence[Point], colour: str) -> None:
        """Add the path of a task as a wide pale line; nothing for a point."""
        if points:
            xs, ys, _ = zip(*points, strict=True)
            self.axes.plot(xs, ys, color=colour, lw=2.5 * ROUTE, alpha=0.25, zorder=3,
                           solid_capstyle='butt')

    def outline(self, points: Sequence[Point], closed: bool) -> None:
        """Add the outline of an area, or a line as it was announced, dashed."""
        if points:
            xs, ys, _ = zip(*points, *points[:closed], strict=True)
            self.axes.plot(xs, ys, color='#555555', lw=1.4, ls=(0, (5, 4)), zorder=3.5)

    def home(self, point: Point, name: str, index: int) -> None:
        """Add the start of a UAV."""
        self.axes.plot(point[0], point[1], 's', ms=14, color=uav_colour(index), mec='black',
                       mew=1.4, zorder=7)
        self._labels.append(Label(name, point[0], point[1], style.PLAIN, 11.0, bold=True))

    def task(self, point: Point, fill: str, name: str, marker: str = 'o', edge: str = 'black',
             number: int | None = None) -> None:
        """Add a task, with its position in the route if it has one."""
        is_missed = edge == RED
        size = (17.0 if number is not None else 12.0) if self.shows_names else 5.0
        self.axes.plot(point[0], point[1], marker, ms=size, color=fill, mec=edge,
                       mew=2.6 if is_missed else 1.0, zorder=6)
        if not self.shows_names:
            return
        if number is not None:
            self.axes.annotate(str(number), point[:2], ha='center', va='center_baseline',
                               fontsize=SMALL, fontweight='bold', color=style.ink(fill), zorder=8)
        self._labels.append(Label(name, point[0], point[1], SMALL, size / 2.0 + 3.0,
                                  RED if is_missed else 'black'))

    def conflict(self, point: Point, colour: str) -> None:
        """Add a place where two UAVs would not have been apart."""
        self.axes.plot(point[0], point[1], style.CONFLICT, ms=15, color='none', mec=colour,
                       mew=2.4, zorder=8.5)

    def lost(self, point: Point, text: str) -> None:
        """Add the position at which a UAV was lost."""
        self.axes.plot(point[0], point[1], 'X', ms=18, color='black', mec='white', mew=1.4,
                       zorder=9)
        self._labels.append(Label(text, point[0], point[1], style.PLAIN, 13.0, bold=True))

    def finish(self, title: str, handles: Sequence[Any], png: str | Path) -> None:
        """Add title, legend, labels and scale bar, save. Raises OSError."""
        zone = 'no-fly zone' + f'\n(inner ring: at {self.height:.0f} m)' * bool(self._rings)
        self.axes.set_title(title, loc='left', fontsize=style.LARGE, fontweight='bold', pad=12)
        entries = [*handles, *[style.zone_handle(zone)] * bool(self._zones)]
        if self.beside:
            style.legend(self.figure, entries, 'outside lower left', columns=4)
        else:
            style.legend(self.figure, entries)
        self.axes.margins(0.07)
        self.figure.draw_without_rendering()  # makes the limits final
        low, high = self.axes.get_xlim()
        place_labels(self.axes, self._labels, self._routes)
        if handles and not self.beside:
            self._scale_bar(high - low)
        self.figure.savefig(png)

    def _scale_bar(self, width: float) -> None:
        """Below the legend; `width` [m] of the map."""
        metres = max(factor * 10.0 ** power for power in range(-3, 9) for factor in (1, 2, 5)
                     if factor * 10.0 ** power <= width / 6.0)
        left, share = 1.03, metres / width
        bar, = self.axes.plot([left, left + share], [0.0, 0.0], color='black', lw=5, clip_on=False,
                              transform=self.axes.transAxes, solid_capstyle='butt')
        text = self.axes.annotate(
            f'{metres:g} m', (left + share / 2.0, 0.015), ha='center', va='bottom',
            xycoords='axes fraction', fontsize=style.PLAIN, annotation_clip=False)
        for each in (bar, text):
            each.set_in_layout(False)  # outside the axes on purpose


def _footprint(zone: ThreatZone, **options: Any) -> Polygon | Circle:
    if zone.shape is Shape.POLYGON:
        return Polygon(zone.vertices, zorder=2, **options)
    return Circle(zone.center[:2], zone.radius, zorder=2, **options)
