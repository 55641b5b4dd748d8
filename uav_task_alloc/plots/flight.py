# SPDX-License-Identifier: Apache-2.0
"""A flown scenario from above: who flew where and which tasks, as the vehicles really were."""
from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.plots import style
from uav_task_alloc.plots.flat import Map
from uav_task_alloc.plots.style import RED
from uav_task_alloc.record import ground_truth as truth, run_state as heard
from uav_task_alloc.record.ground_truth import Truth
from uav_task_alloc.record.run_state import RunState

AT_START = 0.2  # [s] wall: tasks announced this soon after the first were there from the start


def draw_flight(out_dir: str | Path, png: str | Path) -> None:
    """The map of the run recorded in a folder; OSError when there is none."""
    out = Path(out_dir)
    said, flown = heard.read_record(out), truth.read_truth(out)
    drawn = Map((task.position for task in said.tasks.values()), len(said.tasks))
    for seen in said.zones:
        late = seen.since > said.start() + AT_START
        drawn.zone(seen.zone, f'from {said.clock(seen.since):.0f} s' if late else '', late)
    places = {uav: index for index, uav in enumerate(sorted(flown.tracks))}
    handles = _tracks(drawn, said, flown, places)
    handles += _tasks(drawn, said, flown, places)
    drawn.finish(_title(said, flown), handles, png)


def _tracks(drawn: Map, said: RunState, flown: Truth, places: Mapping[str, int]) -> list[Any]:
    handles = []
    for uav, index in places.items():
        points = [sample.point for sample in flown.tracks[uav]]
        drawn.way(points, index)
        drawn.home(points[0], uav, index)
        done = sum(status.state == 'COMPLETED' and status.uav == uav
                   for status in said.statuses.values())
        metres = polyline_length(points)
        handles.append(style.route(index, f'{uav}: {style.count(done)}, {metres / 1e3:.1f} km'))
    for uav, sample in flown.died.items():
        drawn.lost(sample.point, f'{uav} lost at {said.clock(sample.wall):.0f} s')
    return handles


def _tasks(drawn: Map, said: RunState, flown: Truth, places: Mapping[str, int]) -> list[Any]:
    visits = truth.visits(flown, {name: task.position for name, task in said.tasks.items()})
    for name, task in said.tasks.items():
        marker = 'o' if task.wall <= said.start() + AT_START else 'D'
        if visits[name]:
            fill = style.colour(places[visits[name][0].uav])
            drawn.task(task.position, fill, name, marker)
        else:
            drawn.task(task.position, 'white', name, marker, RED)
    return [style.mark('o', '#777777', 'black', 'task at the start'),
            style.mark('D', '#777777', 'black', 'task that came in flight'),
            style.mark('o', 'white', RED, 'task not flown')]


def _title(said: RunState, flown: Truth) -> str:
    done, out = said.count('COMPLETED'), said.count('UNASSIGNED', 'REJECTED')
    return (f'{done} of {len(said.tasks)} tasks completed, {out} unassigned; '
            f'{len(flown.tracks)} UAVs, {flown.metres() / 1e3:.1f} km flown')
