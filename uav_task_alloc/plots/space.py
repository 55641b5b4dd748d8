# SPDX-License-Identifier: Apache-2.0
"""Figure of a plan in three dimensions: zones as bodies, routes with ground projections."""
from __future__ import annotations

import itertools
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

import uav_task_alloc.plots.style as style
from uav_task_alloc.geometry.fence_area import AreaCorners
from uav_task_alloc.geometry.polygon import edges
from uav_task_alloc.model import Plan, Point, Shape, Task, ThreatZone, Uav
from uav_task_alloc.model.route_stops import route_points
from uav_task_alloc.palette import DARK_RED, RED, uav_colour
from uav_task_alloc.plots.labels import Label, place_labels
from uav_task_alloc.plots.plan import (
    conflict_marks,
    legend_handles,
    plan_title,
)
from uav_task_alloc.plots.style import ROUTE, SMALL

_STRETCH = (1, 2, 3, 5, 10, 20, 50, 100)  # factors of heights: routes are much longer than high
_MIN_HEIGHT = 0.3  # of the drawn box over its longer side
_MAX_ZONE_HEIGHT = 1.5  # over the height of all else; higher zones are cut
_VIEW = {'elev': 32.0, 'azim': -62.0}  # [deg]
_AXES, _ZOOM = (0.0, -0.22, 0.78, 1.4), 0.94  # (left, bottom, width, height): exceeds the figure
_LEGEND_ROWS = 6  # UAVs
_NOTE_X = 0.79  # of the figure's width
_FACETS = 48  # of a round body

TextLabel = tuple[str, Point, bool, str]  # text, position, bold, colour


def draw_plan_3d(uavs: Sequence[Uav], tasks: Sequence[Task], zones: Sequence[ThreatZone],
                 plan: Plan, png: str | Path, note: str = '',
                 fence_area: AreaCorners = ()) -> None:
    """Draw a plan seen from south-east and above; unbounded zones are cut.

    Args:
        uavs: in the order of their colours.
        tasks: all tasks of the plan.
        zones: to draw.
        plan: routes by UAV, unassigned tasks.
        png: the file; its suffix selects the format.
        note: text above the legend.
        fence_area: to draw on the ground [m].

    Raises:
        OSError: the file cannot be written.
    """
    positions = {task.id: task.position for task in tasks}
    known = {task.id: task for task in tasks}
    routes = [route_points(uav, plan, known) for uav in uavs]
    points = [*positions.values(), *itertools.chain.from_iterable(routes)]
    low, high = box_limits([*points, *((x, y, 0.0) for x, y in fence_area)], zones)
    figure = Figure(figsize=style.SIZE, dpi=style.DPI)
    axes = figure.add_axes(_AXES, projection='3d', computed_zorder=False)
    for (ax, ay), (bx, by) in edges(fence_area):
        axes.plot([ax, bx], [ay, by], [low[2], low[2]], '--', color=RED, lw=2.0)
    names = [_draw_zone(axes, zone, low[2], high[2]) for zone in zones]
    shows_names = len(tasks) <= style.MAX_NAMED_TASKS
    size = 10.0 if shows_names else 5.0
    for index, (uav, route) in enumerate(zip(uavs, routes, strict=True)):
        _draw_route(axes, route, index, low[2], ROUTE if shows_names else 0.6 * ROUTE)
        _draw_marker(axes, route[0], low[2], 's', 12.0, uav_colour(index), 'black')
        names.append((uav.id, route[0], True, 'black'))
        for name in plan.routes.get(uav.id, ()):
            _draw_marker(axes, positions[name], low[2], 'o', size, uav_colour(index), 'black')
    for name in plan.unassigned:
        _draw_marker(axes, positions[name], low[2], 'o', size, 'white', RED)
    for place, colour in conflict_marks(plan):
        _draw_marker(axes, place, low[2], style.CONFLICT, 11.0, 'none', colour)
    if shows_names:
        names += [(name, position, False, RED if name in plan.unassigned else 'black')
                  for name, position in positions.items()]
    _set_axes(axes, low, high)
    figure.text(0.03, 0.94, plan_title(plan, len(tasks)), fontsize=style.LARGE, fontweight='bold')
    figure.text(_NOTE_X, 0.97, note, fontsize=SMALL - 2.0, va='top')
    handles = [*legend_handles(uavs, tasks, plan, _LEGEND_ROWS), *_zone_handle(zones, high[2])]
    style.legend(figure, handles, 'lower right')
    _write_labels(axes, names, routes)
    figure.savefig(png)


def _zone_handle(zones: Sequence[ThreatZone], top: float) -> list[Any]:
    """The legend entry of zones, if there are any."""
    cut = any(zone.shape is not Shape.HEMISPHERE and zone.z_max > top for zone in zones)
    text = 'no-fly zone, no margin' + '\n(dashed: higher than drawn)' * cut
    return [style.zone_handle(text)] if zones else []


def box_limits(points: Iterable[Point], zones: Sequence[ThreatZone]) -> tuple[
        NDArray[np.float64], NDArray[np.float64]]:
    """The lower and upper corner [m] of the box around all points and bounded zones, padded."""
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
    limit = _MAX_ZONE_HEIGHT * high[2]
    high[2] = max([zone.z_max for zone in zones if zone.z_max <= limit] + [high[2]])
    pad = 0.03 * max(high - low) + 1.0
    high[2] += 0.15 * (high[2] - low[2]) + 1.0
    return low - (pad, pad, 0.0), high + (pad, pad, 0.0)


def _draw_zone(axes: Any, zone: ThreatZone, floor: float, ceiling: float) -> TextLabel:
    """Draw a zone, cut at the box; returns its label."""
    low, high = max(zone.z_min, floor), min(zone.z_max, ceiling)
    if zone.shape is Shape.HEMISPHERE:
        x, y, low = zone.center
        high = low + zone.radius
        _draw_hemisphere(axes, zone)
    else:
        corners = (np.array(zone.vertices) if zone.shape is Shape.POLYGON
                   else _circle_points(zone)[:-1])
        x, y = corners.mean(axis=0)
        if low < high:
            _draw_prism(axes, corners, low, high, cut=zone.z_max > ceiling)
    text = '\n'.join(filter(None, (zone.id, style.height_text(zone))))
    return text, (x, y, max(low, high)), True, DARK_RED


def _draw_hemisphere(axes: Any, zone: ThreatZone) -> None:
    around, up = np.meshgrid(np.linspace(0.0, math.tau, _FACETS + 1),
                             np.linspace(0.0, math.pi / 2.0, _FACETS // 4))
    x = zone.center[0] + zone.radius * np.cos(up) * np.cos(around)
    y = zone.center[1] + zone.radius * np.cos(up) * np.sin(around)
    z = zone.center[2] + zone.radius * np.sin(up)
    axes.plot_surface(x, y, z, rstride=1, cstride=1, color=(*style.ZONE_FILL[:3], 0.25),
                      shade=False, lw=0.0, antialiased=False, zorder=2)
    axes.plot_wireframe(x, y, z, rcount=3, ccount=8, color=RED, lw=0.6, alpha=0.6, zorder=2.1)
    _draw_ring(axes, _circle_points(zone), zone.center[2])


def _draw_prism(axes: Any, corners: NDArray[np.float64], low: float, high: float,
                cut: bool) -> None:
    after = np.roll(corners, -1, axis=0)
    walls = [[(*a, low), (*b, low), (*b, high), (*a, high)]
             for a, b in zip(corners, after, strict=True)]
    lids = [[(*corner, z) for corner in corners] for z in (low, high)]
    axes.add_collection3d(Poly3DCollection([*walls, *lids], facecolor=(*style.ZONE_FILL[:3], 0.13),
                                           lw=0.0, zorder=2))
    closed = np.vstack((corners, corners[:1]))
    _draw_ring(axes, closed, low)
    _draw_ring(axes, closed, high, '--' if cut else '-')
    for x, y in corners[::max(1, len(corners) // 8)]:
        axes.plot([x, x], [y, y], [low, high], color=RED, lw=0.8, zorder=2.1)


def _circle_points(zone: ThreatZone) -> NDArray[np.float64]:
    around = np.linspace(0.0, math.tau, _FACETS + 1)
    return np.column_stack((zone.center[0] + zone.radius * np.cos(around),
                            zone.center[1] + zone.radius * np.sin(around)))


def _draw_ring(axes: Any, corners: NDArray[np.float64], height: float, ls: str = '-') -> None:
    axes.plot(*corners.T, height, color=RED, lw=1.6, ls=ls, zorder=2.1)


def _draw_route(axes: Any, route: Sequence[Point], index: int, ground: float,
                width: float) -> None:
    """A route and its projection on the ground."""
    xs, ys, zs = zip(*route, strict=True)
    axes.plot(xs, ys, ground, color='#9e9e9e', lw=1.4, zorder=1)
    axes.plot(xs, ys, zs, color=uav_colour(index), ls=style.line_style(index), lw=width, zorder=4)


def _draw_marker(axes: Any, point: Point, ground: float, marker: str, size: float, fill: str,
          edge: str) -> None:
    """A marker, and a line from it down to the ground."""
    x, y, z = point
    axes.plot([x, x], [y, y], [ground, z], color='#9e9e9e', lw=0.9, zorder=1.1)
    axes.plot([x], [y], [z], marker, ms=size, color=fill, mec=edge,
              mew=2.2 if edge == RED else 1.0, zorder=5)


def _write_labels(axes: Any, names: Iterable[TextLabel],
                  routes: Iterable[Sequence[Point]]) -> None:
    """Place labels in the projection; the view must be final."""
    axes.figure.draw_without_rendering()
    view = axes.get_proj()

    def flat(points: Sequence[Point]) -> list[tuple[float, float]]:
        x, y, _ = proj_transform(*np.transpose(points), view)
        return list(zip(x, y, strict=True))

    labels = [Label(text, *flat([spot])[0], style.PLAIN if bold and ink == 'black' else SMALL,
                    9.0, ink, bold) for text, spot, bold, ink in names]
    place_labels(axes, labels, map(flat, routes))


def _set_axes(axes: Any, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
    """Axes in metres; heights are stretched by a round factor, which the axis label names."""
    size = high - low
    wanted = _MIN_HEIGHT * max(size[:2]) / size[2]
    factor = max((factor for factor in _STRETCH if factor <= wanted), default=1)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect((size[0], size[1], factor * size[2]), zoom=_ZOOM)
    axes.view_init(**_VIEW)
    axes.set_xlabel('east [m]', fontsize=style.PLAIN, labelpad=12)
    axes.set_ylabel('north [m]', fontsize=style.PLAIN, labelpad=12)
    axes.set_zlabel('up [m]' + (f', drawn {factor} times' if factor > 1 else ''),
                    fontsize=style.PLAIN, labelpad=8)
    axes.tick_params(labelsize=SMALL)
    axes.zaxis.set_major_locator(MaxNLocator(5))
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((0.97, 0.97, 0.97, 1.0))
