# SPDX-License-Identifier: Apache-2.0
"""Map of a plan: routes with their detours, tasks in order, zones, unassigned tasks."""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.lines import Line2D

import uav_task_alloc.plots.style as style
from uav_task_alloc.geometry.fence_area import AreaCorners
from uav_task_alloc.model import Plan, Point, Task, ThreatZone, Uav
from uav_task_alloc.model.route_stops import route_points
from uav_task_alloc.palette import RED, uav_colour
from uav_task_alloc.plots.flat import MapFigure

_RESOLVED = '#202020'  # of the mark of a conflict


def draw_plan(uavs: Sequence[Uav], tasks: Sequence[Task], zones: Sequence[ThreatZone],
              plan: Plan, png: str | Path, fence_area: AreaCorners = ()) -> None:
    """Draw a map of a plan.

    Args:
        uavs: in the order of their colours.
        tasks: all tasks of the plan.
        zones: to draw.
        plan: routes by UAV, unassigned tasks.
        png: the file; its suffix selects the format.
        fence_area: to draw [m].

    Raises:
        OSError: the file cannot be written.
    """
    figure = MapFigure((task.position for task in tasks), len(tasks))
    figure.fence_area(fence_area)
    add_plan(figure, uavs, tasks, zones, plan)
    figure.finish(plan_title(plan, len(tasks)), legend_handles(uavs, tasks, plan), png)


def add_plan(figure: MapFigure, uavs: Sequence[Uav], tasks: Sequence[Task],
             zones: Sequence[ThreatZone], plan: Plan) -> None:
    """Add zones, routes, starts and tasks of a plan to a map.

    Args:
        figure: to draw on.
        uavs, tasks, zones, plan: as for `draw_plan`.
    """
    known = {task.id: task for task in tasks}
    for zone in zones:
        figure.zone(zone)
    for index, uav in enumerate(uavs):
        figure.route(route_points(uav, plan, known), index,
                     arrows=figure.shows_names)
        figure.home(uav.position, uav.id, index)
        for number, name in enumerate(plan.routes.get(uav.id, ()), 1):
            task = known[name]
            entry = task.end if name in plan.reversed else task.position
            figure.way(task.path, uav_colour(index))
            figure.task(entry, uav_colour(index), name, number=number)
    for name in plan.unassigned:
        figure.way(known[name].path, RED)
        figure.task(known[name].position, 'white', name, edge=RED)
    for point, colour in conflict_marks(plan):
        figure.conflict(point, colour)


def conflict_marks(plan: Plan) -> list[tuple[Point, str]]:
    """Return where conflicts of UAVs are, and their colours: red where one is not resolved.

    Args:
        plan: with conflicts.

    Returns:
        [m] ENU and `#rrggbb`.
    """
    return [(each.position, _RESOLVED if each.resolution else RED)
            for each in plan.conflicts if each.position is not None]


def plan_title(plan: Plan, tasks: int) -> str:
    """Number of planned tasks and total length."""
    planned = sum(len(names) for names in plan.routes.values())
    return f'{planned} of {tasks} tasks planned, {plan.distance / 1e3:.1f} km'


def legend_handles(uavs: Sequence[Uav], tasks: Sequence[Task], plan: Plan,
                   rows: int = style.LEGEND_ROWS) -> list[Line2D]:
    """The legend: at most `rows` UAVs with tasks, the numbers of others, unassigned tasks."""
    assigned = [(index, uav.id) for index, uav in enumerate(uavs) if plan.routes.get(uav.id)]
    handles = []
    for index, name in assigned[:rows]:
        metres = plan.route(name).distance
        handles.append(style.route_handle(
            index, f'{name}: {style.task_count(len(plan.routes[name]))}, {metres:.0f} m'))
    for count, text in ((len(assigned) - rows, 'more UAVs with tasks'),
                       (len(uavs) - len(assigned), 'without tasks')):
        if count > 0:
            handles.append(Line2D([], [], ls='', label=f'{count} {text}'))
    if plan.unassigned:
        text = f'unassigned: {len(plan.unassigned)}'
        handles.append(style.marker_handle('o', 'white', RED, text))
    colours = [colour for _, colour in conflict_marks(plan)]
    for colour, text in ((_RESOLVED, 'conflicts resolved'), (RED, 'conflicts NOT resolved')):
        if colour in colours:
            handles.append(style.marker_handle(style.CONFLICT, 'none', colour,
                                               f'{text}: {colours.count(colour)}'))
    return handles
