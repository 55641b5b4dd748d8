# SPDX-License-Identifier: Apache-2.0
"""Times of a plan beside its map: a bar for each task, in its window, or for each UAV."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import Patch

import uav_task_alloc.plots.style as style
from uav_task_alloc.geometry.fence_area import AreaCorners
from uav_task_alloc.model import Plan, Task, ThreatZone, Uav, turned_tasks
from uav_task_alloc.palette import RED, uav_colour
from uav_task_alloc.plots.flat import MapFigure
from uav_task_alloc.plots.plan import add_plan, legend_handles, plan_title
from uav_task_alloc.timetable import Timetable

MAX_TASK_ROWS = 45  # more tasks: a row for each UAV
_WINDOW, _FLIGHT, _WAIT = '#d9d9d9', '#9a9a9a', '///'


def draw_plan_times(uavs: Sequence[Uav], tasks: Sequence[Task], zones: Sequence[ThreatZone],
                    plan: Plan, png: str | Path, fence_area: AreaCorners = ()) -> None:
    """Draw the map of a plan and, beside it, when each task is flown to and served.

    Args:
        uavs: in the order of their colours.
        tasks: all tasks of the plan.
        zones: to draw.
        plan: routes by UAV, times, unassigned tasks.
        png: the file; its suffix selects the format.
        fence_area: to draw [m].

    Raises:
        OSError: the file cannot be written.
    """
    positions = [task.position for task in tasks]
    figure = MapFigure(positions, len(tasks), beside=True)
    figure.fence_area(fence_area)
    add_plan(figure, uavs, tasks, zones, plan)
    axes = figure.beside
    assert axes is not None
    served = sum(len(row) for row in plan.routes.values())
    rows = _task_rows if served <= MAX_TASK_ROWS else _uav_rows
    rows(axes, uavs, {task.id: task for task in turned_tasks(tasks, plan.reversed)}, plan)
    axes.set_xlabel('time [s]', fontsize=style.PLAIN)
    axes.set_title(f'ends at {plan.finish:.0f} s', loc='left', fontsize=style.LARGE, pad=12)
    title = plan_title(plan, len(tasks))
    figure.finish(title, [*legend_handles(uavs, tasks, plan, rows=5), *_handles()], png)


def _handles() -> list[Any]:
    return [Patch(fc=_WINDOW, label='window of the start'),
            Patch(fc='white', ec=_FLIGHT, hatch=_WAIT, label='waiting'),
            style.marker_handle('|', RED, RED, 'start after the window')]


def _task_rows(axes: Axes, uavs: Sequence[Uav], tasks: Mapping[str, Task], plan: Plan) -> None:
    """A row for each task served, by UAV in the order of the route."""
    times, names, row = plan.timetable(), list[str](), 0
    for index, uav in enumerate(uavs):
        for trip, departure in zip(times.trips.get(uav.id, ()), times.departures.get(uav.id, ()),
                                   strict=True):
            left = departure
            for name in trip:
                _window(axes, tasks[name], row, plan.finish)
                left = _visit(axes, uav, tasks[name], times, left, row, index)
                names.append(name)
                row += 1
    axes.set_yticks(range(row), names, fontsize=style.SMALL)
    axes.set_ylim(max(row, 1) - 0.5, -0.5)  # the first at the top


def _uav_rows(axes: Axes, uavs: Sequence[Uav], tasks: Mapping[str, Task], plan: Plan) -> None:
    """A row for each UAV with tasks."""
    times = plan.timetable()
    flown = [(index, uav) for index, uav in enumerate(uavs) if times.trips.get(uav.id)]
    for row, (index, uav) in enumerate(flown):
        for trip, departure in zip(times.trips[uav.id], times.departures[uav.id], strict=True):
            left = departure
            for name in trip:
                left = _visit(axes, uav, tasks[name], times, left, row, index)
    few = len(flown) <= MAX_TASK_ROWS
    axes.set_yticks(range(len(flown)) if few else [],
                    [uav.id for _, uav in flown] if few else [], fontsize=style.SMALL)
    axes.set_ylim(max(len(flown), 1) - 0.5, -0.5)


def _window(axes: Axes, task: Task, row: int, finish: float) -> None:
    """The window of a task, to the end of the plan where it has no latest start."""
    if math.isinf(task.latest) and task.earliest <= 0.0:
        return
    left, right = max(0.0, task.earliest), min(task.latest, max(finish, task.earliest))
    axes.barh(row, max(right - left, 0.0), 0.9, left, color=_WINDOW, zorder=1)


def _visit(axes: Axes, uav: Uav, task: Task, times: Timetable, left: float, row: int,
           index: int) -> float:
    """The leg to a task, waiting, and service along its path; when the UAV leaves it [s]."""
    from uav_task_alloc.geometry.flight_time import service_seconds  # imports numba
    arrival, start = times.arrivals[task.id], times.starts[task.id]
    colour, end = uav_colour(index), start + service_seconds(uav, task)
    axes.plot([left, arrival], [row, row], color=colour, lw=1.6, zorder=2, solid_capstyle='butt')
    if start > arrival:
        axes.barh(row, start - arrival, 0.5, arrival, fc='white', ec=_FLIGHT, hatch=_WAIT,
                  zorder=3)
    axes.barh(row, end - start, 0.5, start, color=colour, zorder=4)
    axes.plot([start], [row], '|', ms=13, mew=2.4, zorder=5,
              color=RED if task.id in times.late else colour)
    return end
