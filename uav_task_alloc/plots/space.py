# SPDX-License-Identifier: Apache-2.0
"""A plan in space: domes, cylinders and prisms as bodies, routes above their shadows."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.proj3d import proj_transform
from numpy.typing import NDArray

from uav_task_alloc.model import Plan, Point, Shape, Task, ThreatZone, Uav
from uav_task_alloc.plots import style
from uav_task_alloc.plots.labels import Label, place_labels
from uav_task_alloc.plots.plan import handles_of, title_of, way_of
from uav_task_alloc.plots.style import RED, ROUTE, SMALL

STRETCH = (1, 2, 3, 5, 10, 20, 50, 100)  # of heights, as routes are much longer than high
FLATTEST = 0.3  # height of the picture's box against its longer side
HIGHEST = 1.5  # times the rest, that a zone may reach and is not cut
VIEW = {'elev': 32.0, 'azim': -62.0}  # [deg]
PLACE, ZOOM = (0.0, -0.22, 0.78, 1.4), 0.94  # its square reaches beyond the figure
ROWS = 6  # UAVs in the legend, which has but a corner
RIGHT = 0.79  # of the picture, where there is room above the legend
FACETS = 48  # of a round body

Name = tuple[str, Point, bool, str]  # text, where, bold, colour


def draw_plan_3d(uavs: Sequence[Uav], tasks: Sequence[Task], zones: Sequence[ThreatZone],
                 plan: Plan, png: str | Path, note: str = '') -> None:
    """The plan seen from south-east and above; zones without an end are cut. Raises OSError.

    `note` stands above the legend: how the plan was made, say.
    """
    places = {task.id: task.position for task in tasks}
    ways = [way_of(uav, plan, places) for uav in uavs]
    low, high = limits([*places.values(), *(point for way in ways for point in way)], zones)
    figure = Figure(figsize=style.SIZE, dpi=style.DPI)
    axes = figure.add_axes(PLACE, projection='3d', computed_zorder=False)
    names = [_body(axes, zone, low[2], high[2]) for zone in zones]
    few = len(tasks) <= style.CROWD
    size = 10.0 if few else 5.0
    for index, (uav, way) in enumerate(zip(uavs, ways, strict=True)):
        _way(axes, way, index, low[2], ROUTE if few else 0.6 * ROUTE)
        _mark(axes, way[0], low[2], 's', 12.0, style.colour(index), 'black')
        names.append((uav.id, way[0], True, 'black'))
        for name in plan.routes.get(uav.id, ()):
            _mark(axes, places[name], low[2], 'o', size, style.colour(index), 'black')
    for name in plan.unassigned:
        _mark(axes, places[name], low[2], 'o', size, 'white', RED)
    if few:
        names += [(name, place_labels, False, RED if name in plan.unassigned else 'black')
                  for name, place_labels in places.items()]
    _frame(axes, low, high)
    figure.text(0.03, 0.94, title_of(plan, len(tasks)), fontsize=style.LARGE, fontweight='bold')
    figure.text(RIGHT, 0.97, note, fontsize=SMALL - 2.0, va='top')
    style.legend(figure, [*handles_of(uavs, plan, ROWS), *_zone_handle(zones, high[2])],
                 'lower right')
    _write(axes, names, ways)
    figure.savefig(png)


def _zone_handle(zones: Sequence[ThreatZone], top: float) -> list[Any]:
    """The line of the legend for zones, where there are any."""
    cut = any(zone.shape is not Shape.HEMISPHERE and zone.z_max > top for zone in zones)
    text = 'no-fly zone, no margin' + '\n(dashed: higher than drawn)' * cut
    return [style.zone_handle(text)] if zones else []


def limits(points: Iterable[Point], zones: Sequence[ThreatZone]) -> tuple[
        NDArray[np.float64], NDArray[np.float64]]:
    """The corners [m] of the box that is drawn: all points, all zones as far as they end."""
    corners = [*points, (0.0, 0.0, 0.0)]
    for zone in zones:
        if zone.shape is Shape.POLYGON:
            corners += [(x, y, 0.0) for x, y in zone.vertices]
        else:
            x, y, z = zone.center
            corners += [(x - zone.radius, y - zone.radius, z), (x + zone.radius, y + zone.radius,
                                                                z)]
        if zone.shape is Shape.HEMISPHERE:
            corners.append((*zone.center[:2], zone.center[2] + zone.radius))
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    high[2] = max([zone.z_max for zone in zones if zone.z_max <= HIGHEST * high[2]] + [high[2]])
    pad = 0.03 * max(high - low) + 1.0
    high[2] += 0.15 * (high[2] - low[2]) + 1.0
    return low - (pad, pad, 0.0), high + (pad, pad, 0.0)


def _body(axes: Any, zone: ThreatZone, floor: float, ceiling: float) -> Name:
    """A zone, cut at what is drawn; its name, and where that belongs."""
    low, high = max(zone.z_min, floor), min(zone.z_max, ceiling)
    if zone.shape is Shape.HEMISPHERE:
        x, y, low = zone.center
        high = low + zone.radius
        _dome(axes, zone)
    else:
        corners = np.array(zone.vertices) if zone.shape is Shape.POLYGON else _circle(zone)[:-1]
        x, y = corners.mean(axis=0)
        if low < high:
            _prism(axes, corners, low, high, cut=zone.z_max > ceiling)
    text = '\n'.join(filter(None, (zone.id, style.heights(zone))))
    return text, (x, y, max(low, high)), True, style.DARK_RED


def _dome(axes: Any, zone: ThreatZone) -> None:
    around, up = np.meshgrid(np.linspace(0.0, math.tau, FACETS + 1),
                             np.linspace(0.0, math.pi / 2.0, FACETS // 4))
    x = zone.center[0] + zone.radius * np.cos(up) * np.cos(around)
    y = zone.center[1] + zone.radius * np.cos(up) * np.sin(around)
    z = zone.center[2] + zone.radius * np.sin(up)
    axes.plot_surface(x, y, z, rstride=1, cstride=1, color=(*style.ZONE[:3], 0.25), shade=False,
                      lw=0.0, antialiased=False, zorder=2)
    axes.plot_wireframe(x, y, z, rcount=3, ccount=8, color=RED, lw=0.6, alpha=0.6, zorder=2.1)
    _ring(axes, _circle(zone), zone.center[2])


def _prism(axes: Any, corners: NDArray[np.float64], low: float, high: float, cut: bool) -> None:
    after = np.roll(corners, -1, axis=0)
    walls = [[(*a, low), (*b, low), (*b, high), (*a, high)]
             for a, b in zip(corners, after, strict=True)]
    lids = [[(*corner, z) for corner in corners] for z in (low, high)]
    axes.add_collection3d(Poly3DCollection([*walls, *lids], facecolor=(*style.ZONE[:3], 0.13),
                                           lw=0.0, zorder=2))
    closed = np.vstack((corners, corners[:1]))
    _ring(axes, closed, low)
    _ring(axes, closed, high, '--' if cut else '-')
    for x, y in corners[::max(1, len(corners) // 8)]:
        axes.plot([x, x], [y, y], [low, high], color=RED, lw=0.8, zorder=2.1)


def _circle(zone: ThreatZone) -> NDArray[np.float64]:
    around = np.linspace(0.0, math.tau, FACETS + 1)
    return np.column_stack((zone.center[0] + zone.radius * np.cos(around),
                            zone.center[1] + zone.radius * np.sin(around)))


def _ring(axes: Any, corners: NDArray[np.float64], height: float, ls: str = '-') -> None:
    axes.plot(*corners.T, height, color=RED, lw=1.6, ls=ls, zorder=2.1)


def _way(axes: Any, way: Sequence[Point], index: int, ground: float, width: float) -> None:
    """A route, and its shadow, without which nobody sees where it is."""
    xs, ys, zs = zip(*way, strict=True)
    axes.plot(xs, ys, ground, color='#9e9e9e', lw=1.4, zorder=1)
    axes.plot(xs, ys, zs, color=style.colour(index), ls=style.line(index), lw=width, zorder=4)


def _mark(axes: Any, place: Point, ground: float, marker: str, size: float, fill: str,
          edge: str) -> None:
    """A place, and a line down to where it stands."""
    x, y, z = place
    axes.plot([x, x], [y, y], [ground, z], color='#9e9e9e', lw=0.9, zorder=1.1)
    axes.plot([x], [y], [z], marker, ms=size, color=fill, mec=edge,
              mew=2.2 if edge == RED else 1.0, zorder=5)


def _write(axes: Any, names: Iterable[Name], ways: Iterable[Sequence[Point]]) -> None:
    """Names where they hide least, once the view is final."""
    axes.figure.draw_without_rendering()
    view = axes.get_proj()

    def flat(points: Sequence[Point]) -> list[tuple[float, float]]:
        x, y, _ = proj_transform(*np.transpose(points), view)
        return list(zip(x, y, strict=True))

    labels = [Label(text, *flat([spot])[0], style.PLAIN if bold and ink == 'black' else SMALL,
                    9.0, ink, bold) for text, spot, bold, ink in names]
    place_labels(axes, labels, map(flat, ways))


def _frame(axes: Any, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
    """Axes in metres, heights stretched by a round factor, which is told."""
    size = high - low
    wanted = FLATTEST * max(size[:2]) / size[2]
    factor = max((each for each in STRETCH if each <= wanted), default=1)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect((size[0], size[1], factor * size[2]), zoom=ZOOM)
    axes.view_init(**VIEW)
    axes.set_xlabel('east [m]', fontsize=style.PLAIN, labelpad=12)
    axes.set_ylabel('north [m]', fontsize=style.PLAIN, labelpad=12)
    axes.set_zlabel('up [m]' + (f', drawn {factor} times' if factor > 1 else ''),
                    fontsize=style.PLAIN, labelpad=8)
    axes.tick_params(labelsize=SMALL)
    axes.zaxis.set_major_locator(MaxNLocator(5))
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((0.97, 0.97, 0.97, 1.0))
