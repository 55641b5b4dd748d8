# SPDX-License-Identifier: Apache-2.0
"""Sizes, line styles and legend entries of all figures, made for a full HD projector."""
from __future__ import annotations

import math
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from uav_task_alloc.model import Shape, ThreatZone
from uav_task_alloc.palette import RED, UAV_COLOURS, rgb, uav_colour

_LINE_STYLES: tuple[Any, ...] = ('-', (0, (4, 1.2)), (0, (1, 1)))  # for more UAVs than colours
ZONE_FILL = (*rgb(RED), 0.16)
SIZE = (12.8, 7.2)  # [in] 16:9
DPI = 150  # full HD
SMALL, PLAIN, LARGE = 11.0, 13.0, 17.0  # [pt]
ROUTE = 2.8  # [pt]
MAX_NAMED_TASKS = 60  # more are drawn as dots without names
LEGEND_ROWS = 14  # UAVs
CONFLICT = 'D'  # mark


def line_style(index: int) -> Any:
    """The line style of a UAV by its position in the fleet: UAVs of one colour differ in it."""
    return _LINE_STYLES[index // len(UAV_COLOURS) % len(_LINE_STYLES)]


def halo(width: float = 3.0) -> list[Any]:
    """Path effects that outline text in white, readable on any background."""
    return [withStroke(linewidth=width, foreground='white')]


def ink(fill: str) -> str:
    """The text colour, black or white, of higher contrast on a fill `#rrggbb` (luma, BT.601)."""
    red, green, blue = rgb(fill)
    return 'black' if 0.299 * red + 0.587 * green + 0.114 * blue > 0.55 else 'white'


def height_text(zone: ThreatZone) -> str:
    """The heights [m] of a zone; empty where it is unbounded."""
    if zone.shape is Shape.HEMISPHERE:
        return f'to {zone.center[2] + zone.radius:.0f} m'
    low, high = math.isfinite(zone.z_min), math.isfinite(zone.z_max)
    if low and high:
        return f'{zone.z_min:.0f} to {zone.z_max:.0f} m'
    return f'to {zone.z_max:.0f} m' if high else f'from {zone.z_min:.0f} m' if low else ''


def task_count(tasks: int) -> str:
    """`1 task`, `2 tasks`."""
    return '1 task' if tasks == 1 else f'{tasks} tasks'


def route_handle(index: int, text: str) -> Line2D:
    """The legend entry of a UAV."""
    return Line2D([], [], color=uav_colour(index), ls=line_style(index), lw=ROUTE, label=text)


def zone_handle(text: str = 'no-fly zone') -> Patch:
    """The legend entry of zones."""
    return Patch(fc=ZONE_FILL, ec=RED, lw=1.6, hatch='///', label=text)


def marker_handle(marker: str, fill: str, edge: str, text: str) -> Line2D:
    """The legend entry of a kind of task."""
    return Line2D([], [], ls='', marker=marker, ms=11, color=fill, mec=edge,
                  mew=2.4 if edge == RED else 1.0, label=text)


def legend(figure: Figure, handles: list[Any], place: Any = 'outside right upper',
           columns: int = 1) -> None:
    """Add the legend."""
    figure.legend(handles=handles, loc=place, frameon=False, fontsize=PLAIN, handlelength=1.8,
                  ncols=columns)
