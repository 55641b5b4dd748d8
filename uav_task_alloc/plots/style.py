# SPDX-License-Identifier: Apache-2.0
"""Colours, sizes and words of all pictures, for a projector and for every kind of eye."""
from __future__ import annotations

import math
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from uav_task_alloc.model import Shape, ThreatZone

# Okabe and Ito, "Color Universal Design", and two more; test_plots.py measures that all stay
# apart, from RED as well, also where red, green or blue is not seen
COLOURS = ('#0072b2', '#e69f00', '#009e73', '#cc79a7', '#56b4e9', '#000000', '#540078', '#c0b478')
_LINES: tuple[Any, ...] = ('-', (0, (4, 1.2)), (0, (1, 1)))  # once all colours are used up
RED, DARK_RED = '#c62828', '#8e0000'
ZONE = (0.78, 0.16, 0.16, 0.16)
SIZE = (12.8, 7.2)  # [in] 16:9
DPI = 150  # full HD
SMALL, PLAIN, LARGE = 11.0, 13.0, 17.0  # [pt]
ROUTE = 2.8  # [pt]
CROWD = 60  # tasks; more are dots without names
ROWS = 14  # UAVs in the legend


def colour(index: int) -> str:
    """The colour of the UAV with this place in the fleet."""
    return COLOURS[index % len(COLOURS)]


def line(index: int) -> Any:
    """Its line style, which tells apart UAVs that share a colour."""
    return _LINES[index // len(COLOURS) % len(_LINES)]


def halo(width: float = 3.0) -> list[Any]:
    """White around letters, so that they are read on any ground."""
    return [withStroke(linewidth=width, foreground='white')]


def ink(fill: str) -> str:
    """Black or white, whichever is read better on a colour."""
    red, green, blue = (int(fill[i:i + 2], 16) for i in (1, 3, 5))
    return 'black' if 0.299 * red + 0.587 * green + 0.114 * blue > 140 else 'white'


def heights(zone: ThreatZone) -> str:
    """From where to where a zone reaches, in words; empty where it has no end."""
    if zone.shape is Shape.HEMISPHERE:
        return f'to {zone.center[2] + zone.radius:.0f} m'
    low, high = math.isfinite(zone.z_min), math.isfinite(zone.z_max)
    if low and high:
        return f'{zone.z_min:.0f} to {zone.z_max:.0f} m'
    return f'to {zone.z_max:.0f} m' if high else f'from {zone.z_min:.0f} m' if low else ''


def count(tasks: int) -> str:
    """So many tasks, in words."""
    return '1 task' if tasks == 1 else f'{tasks} tasks'


def route(index: int, text: str) -> Line2D:
    """The line of the legend for a UAV."""
    return Line2D([], [], color=colour(index), ls=line(index), lw=ROUTE, label=text)


def zone_handle(text: str = 'no-fly zone') -> Patch:
    """Its line of the legend."""
    return Patch(fc=ZONE, ec=RED, lw=1.6, hatch='///', label=text)


def mark(marker: str, fill: str, edge: str, text: str) -> Line2D:
    """A line of the legend for a kind of task."""
    return Line2D([], [], ls='', marker=marker, ms=11, color=fill, mec=edge,
                  mew=2.4 if edge == RED else 1.0, label=text)


def legend(figure: Figure, handles: list[Any], place: Any = 'outside right upper') -> None:
    """What is what."""
    figure.legend(handles=handles, loc=place, frameon=False, fontsize=PLAIN, handlelength=1.8)
