# SPDX-License-Identifier: Apache-2.0
"""Maps as PNG files: a plan, and a flown scenario; drawn without a display."""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon

from uav_task_alloc.model import Plan, Point, Shape, Task, ThreatZone, Uav
from uav_task_alloc.record import heard, truth
from uav_task_alloc.record.heard import Heard
from uav_task_alloc.record.truth import Truth

# told apart also by those who see colours differently
COLOURS = ('#0072b2', '#e69f00', '#009e73', '#cc79a7', '#56b4e9', '#8c564b', '#5e3c99', '#7f7f7f')
RED = '#c62828'
AT_START = 0.2  # [s] wall: tasks announced this soon after the first were there from the start


def colour(index: int) -> str:
    """The colour of the UAV with this place in the fleet."""
    return COLOURS[index % len(COLOURS)]


def draw_plan(uavs: Sequence[Uav], tasks: Sequence[Task], zones: Sequence[ThreatZone],
              plan: Plan, png: str | Path) -> None:
    """A plan: routes with their detours, tasks in order, zones, what is unassigned."""
    figure, axes = _map()
    places = {task.id: task.position for task in tasks}
    height = _height(places.values())
    for zone in zones:
        _zone(axes, zone, zone.id, height)
    handles = [_route(axes, uav, plan, places, colour(i)) for i, uav in enumerate(uavs)]
    for name in plan.unassigned:
        _task(axes, places[name], 'o', 'white', name, RED)
    if plan.unassigned:
        handles.append(_mark('o', 'white', RED, 'unassigned'))
    planned = sum(len(names) for names in plan.routes.values())
    axes.set_title(f'{planned} of {len(tasks)} tasks planned, {plan.distance:.0f} m',
                   loc='left', fontsize=12, fontweight='bold')
    _finish(figure, axes, handles + _zone_handle(zones, height), png)


def _route(axes: Axes, uav: Uav, plan: Plan, places: Mapping[str, Point], line: str) -> Line2D:
    """One route with its tasks; its line of the legend."""
    names, legs = plan.routes.get(uav.id, ()), plan.legs.get(uav.id, ())
    stops = [*(places[name] for name in names), uav.home or uav.position]
    way = [uav.position]
    for leg, stop in zip(legs, stops, strict=False):  # a leg home only where the plan returns
        way += [*leg.via, stop]
    _way(axes, way, line)
    _home(axes, uav.position, uav.id, line)
    for order, name in enumerate(names, 1):
        _task(axes, places[name], 'o', line, f'{name} ({order})')
    metres = sum(leg.length for leg in legs)
    return Line2D([], [], color=line, lw=2, label=f'{uav.id}: {len(names)} tasks, {metres:.0f} m')


def draw_flight(out_dir: str | Path, png: str | Path) -> None:
    """The map of the run recorded in a folder; OSError when there is none."""
    out = Path(out_dir)
    said, flown = heard.read(out), truth.read(out)
    figure, axes = _map()
    height = _height(task.position for task in said.tasks.values())
    for seen in said.zones:
        late = seen.since > said.start() + AT_START
        when = f'\nfrom {said.clock(seen.since):.0f} s' if late else ''
        _zone(axes, seen.zone, seen.zone.id + when, height, late)
    colours = {uav: colour(i) for i, uav in enumerate(sorted(flown.tracks))}
    handles = _tracks(axes, said, flown, colours)
    handles += _tasks(axes, said, flown, colours)
    axes.set_title(_title(said, flown), loc='left', fontsize=12, fontweight='bold')
    zones = [seen.zone for seen in said.zones]
    _finish(figure, axes, handles + _zone_handle(zones, height), png)


def _tracks(axes: Axes, said: Heard, flown: Truth, colours: Mapping[str, str]) -> list[Any]:
    handles = []
    for uav, track in sorted(flown.tracks.items()):
        points = [sample.point for sample in track]
        _way(axes, points, colours[uav])
        _home(axes, points[0], uav, colours[uav])
        done = sum(status.state == 'COMPLETED' and status.uav == uav
                   for status in said.statuses.values())
        metres = math.fsum(math.dist(a, b) for a, b in pairwise(points))
        handles.append(Line2D([], [], color=colours[uav], lw=2,
                              label=f'{uav}: {done} tasks, {metres / 1e3:.1f} km'))
    for uav, sample in flown.died.items():
        x, y, _ = sample.point
        axes.plot(x, y, 'X', ms=15, color='black', mec='white', mew=1.2, zorder=9)
        axes.annotate(f'{uav} lost at {said.clock(sample.wall):.0f} s', (x, y), (12, -4),
                      textcoords='offset points', fontsize=10, fontweight='bold', zorder=9,
                      bbox={'boxstyle': 'round,pad=0.2', 'fc': 'white', 'ec': 'black', 'lw': 0.8})
    return handles


def _tasks(axes: Axes, said: Heard, flown: Truth, colours: Mapping[str, str]) -> list[Any]:
    visits = truth.visits(flown, {name: task.position for name, task in said.tasks.items()})
    for name, task in said.tasks.items():
        marker = 'o' if task.wall <= said.start() + AT_START else 'D'
        if visits[name]:
            _task(axes, task.position, marker, colours[visits[name][0].uav], name)
        else:
            _task(axes, task.position, marker, 'white', name, RED)
    return [_mark('o', '#555555', 'black', 'task at the start'),
            _mark('D', '#555555', 'black', 'task that arrived in flight'),
            _mark('o', 'white', RED, 'task not flown')]


def _title(said: Heard, flown: Truth) -> str:
    done, out = said.count('COMPLETED'), said.count('UNASSIGNED', 'REJECTED')
    return (f'{done} of {len(said.tasks)} tasks completed, {out} unassigned; '
            f'{len(flown.tracks)} UAVs, {flown.metres() / 1e3:.1f} km flown')


def _map() -> tuple[Figure, Axes]:
    figure = Figure(figsize=(11.0, 8.0), dpi=120, layout='constrained')
    axes = figure.add_subplot()
    axes.set_aspect('equal', adjustable='datalim')
    axes.grid(color='#e8e8e8', lw=0.7, zorder=0)
    axes.set_axisbelow(True)
    axes.set_xlabel('east [m]')
    axes.set_ylabel('north [m]')
    for side in ('top', 'right'):
        axes.spines[side].set_visible(False)
    return figure, axes


def _height(points: Iterable[Point]) -> float:
    """The height [m] most is flown at, where a dome is narrower than on the ground."""
    return median([point[2] for point in points] or [0.0])


def _zone(axes: Axes, zone: ThreatZone, label: str, height: float, late: bool = False) -> None:
    """The footprint with its margin; dashed where the zone came late."""
    if zone.shape is Shape.POLYGON:
        shape: Any = Polygon(zone.vertices)
        x, y = (sum(values) / len(values) for values in zip(*zone.vertices, strict=True))
        south = min(corner[1] for corner in zone.vertices)
    else:
        x, y, _ = zone.center
        shape, south = Circle((x, y), zone.radius), y - zone.radius
        axes.add_patch(Circle((x, y), zone.radius + zone.margin, fill=False, ec=RED, lw=0.6,
                              ls=':', zorder=2))
        above = height - zone.center[2]
        if zone.shape is Shape.HEMISPHERE and abs(above) < zone.radius:
            axes.add_patch(Circle((x, y), math.sqrt(zone.radius ** 2 - above ** 2),
                                  fc=(0.78, 0.16, 0.16, 0.15), ec=RED, lw=0.8, zorder=2))
    shape.set(fc=(0.78, 0.16, 0.16, 0.2), ec=RED, lw=1.6, ls='--' if late else '-', zorder=2)
    axes.add_patch(shape)
    axes.annotate(label, (x, 0.55 * south + 0.45 * y), ha='center', va='center', fontsize=9,
                  color='#8e0000', zorder=3)


def _way(axes: Axes, points: Iterable[Point], line: str) -> None:
    xs, ys, _ = zip(*points, strict=True)
    axes.plot(xs, ys, color='white', lw=3.6, zorder=4, solid_capstyle='round')
    axes.plot(xs, ys, color=line, lw=1.8, zorder=4.1, solid_capstyle='round')


def _home(axes: Axes, point: Point, name: str, fill: str) -> None:
    axes.plot(point[0], point[1], 's', ms=12, color=fill, mec='black', mew=1.2, zorder=7)
    axes.annotate(name, point[:2], (0, -17), textcoords='offset points', ha='center',
                  fontsize=10, fontweight='bold', zorder=8)


def _task(axes: Axes, point: Point, marker: str, fill: str, label: str,
          edge: str = 'black') -> None:
    missed = edge == RED
    axes.plot(point[0], point[1], marker, ms=9 if marker == 'o' else 8, color=fill, mec=edge,
              mew=2.2 if missed else 0.9, zorder=6)
    axes.annotate(label, point[:2], (6, 5), textcoords='offset points', fontsize=8, zorder=8,
                  color=RED if missed else 'black')


def _mark(marker: str, fill: str, edge: str, label: str) -> Line2D:
    return Line2D([], [], ls='', marker=marker, ms=9, color=fill, mec=edge,
                  mew=2.2 if edge == RED else 0.9, label=label)


def _zone_handle(zones: Sequence[ThreatZone], height: float) -> list[Any]:
    dome = any(zone.shape is Shape.HEMISPHERE for zone in zones)
    label = 'zone' + f' (dome: inner ring at {height:.0f} m)' * dome
    return [Patch(fc='#f1c4c4', ec=RED, lw=1.6, label=label)] if zones else []


def _finish(figure: Figure, axes: Axes, handles: Sequence[Any], png: str | Path) -> None:
    """Legend below, scale bar, file."""
    axes.margins(0.06)
    figure.legend(handles=handles, loc='outside lower center', ncols=4, frameon=False, fontsize=10)
    figure.draw_without_rendering()  # only now the limits are what they will be
    low, high = axes.get_xlim()
    metres = max(factor * 10.0 ** power for power in range(-3, 9) for factor in (1, 2, 5)
                 if factor * 10.0 ** power <= (high - low) / 6.0)
    width, height = metres / (high - low), 1.015
    axes.plot([1.0 - width, 1.0], [height, height], color='black', lw=4, clip_on=False,
              transform=axes.transAxes, solid_capstyle='butt')
    axes.annotate(f'{metres:g} m', (1.0 - width - 0.01, height), ha='right', va='center',
                  xycoords='axes fraction', fontsize=10)
    figure.savefig(png)
