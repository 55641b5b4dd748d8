# SPDX-License-Identifier: Apache-2.0
"""A plan from above: routes with their detours, tasks in order, zones, what is unassigned."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.lines import Line2D

from uav_task_alloc.model import Plan, Point, Task, ThreatZone, Uav
from uav_task_alloc.plots import style
from uav_task_alloc.plots.flat import Map
from uav_task_alloc.plots.style import RED


def draw_plan(uavs: Sequence[Uav], tasks: Sequence[Task], zones: Sequence[ThreatZone],
              plan: Plan, png: str | Path) -> None:
    """A map of the plan; the end of the name says the kind of file. Raises OSError."""
    places = {task.id: task.position for task in tasks}
    drawn = Map(places.values(), len(tasks))
    for zone in zones:
        drawn.zone(zone)
    for index, uav in enumerate(uavs):
        drawn.way(way_of(uav, plan, places), index, arrows=drawn.names)
        drawn.home(uav.position, uav.id, index)
        for number, name in enumerate(plan.routes.get(uav.id, ()), 1):
            drawn.task(places[name], style.colour(index), name, number=number)
    for name in plan.unassigned:
        drawn.task(places[name], 'white', name, edge=RED)
    drawn.finish(title_of(plan, len(tasks)), handles_of(uavs, plan), png)


def way_of(uav: Uav, plan: Plan, places: Mapping[str, Point]) -> list[Point]:
    """All points of a route, the start first [m]."""
    names, legs = plan.routes.get(uav.id, ()), plan.legs.get(uav.id, ())
    stops = [*(places[name] for name in names), uav.home or uav.position]
    way = [uav.position]
    for leg, stop in zip(legs, stops, strict=False):  # a leg home only where the plan returns
        way += [*leg.via, stop]
    return way


def title_of(plan: Plan, tasks: int) -> str:
    """What the plan achieves."""
    planned = sum(len(names) for names in plan.routes.values())
    return f'{planned} of {tasks} tasks planned, {plan.distance / 1e3:.1f} km'


def handles_of(uavs: Sequence[Uav], plan: Plan, rows: int = style.ROWS) -> list[Line2D]:
    """The legend: a line for each UAV with tasks, as many as `rows`, and what else there is."""
    busy = [(index, uav.id) for index, uav in enumerate(uavs) if plan.routes.get(uav.id)]
    handles = []
    for index, name in busy[:rows]:
        metres = sum(leg.length for leg in plan.legs.get(name, ()))
        handles.append(style.route(
            index, f'{name}: {style.count(len(plan.routes[name]))}, {metres:.0f} m'))
    for many, text in ((len(busy) - rows, 'more UAVs with tasks'),
                       (len(uavs) - len(busy), 'without tasks')):
        if many > 0:
            handles.append(Line2D([], [], ls='', label=f'{many} {text}'))
    if plan.unassigned:
        handles.append(style.mark('o', 'white', RED, f'unassigned: {len(plan.unassigned)}'))
    return handles
