# SPDX-License-Identifier: Apache-2.0
"""Map of a recorded flight: tracks of the vehicles and tasks reached, from the ground truth."""
from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import uav_task_alloc.plots.style as style
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.palette import RED, uav_colour
from uav_task_alloc.plots.flat import MapFigure
from uav_task_alloc.record.ground_truth import GroundTruth, read_run
from uav_task_alloc.record.piece_passes import piece_passes, served
from uav_task_alloc.record.run_state import RunState

_AT_START = 0.2  # [s] real time after the first task: announced later means in flight


def draw_flight(out_dir: str | Path, png: str | Path) -> None:
    """Draw the map of a recorded run.

    Args:
        out_dir: folder with record.jsonl and flight.jsonl.
        png: the file; its suffix selects the format.

    Raises:
        OSError: a file is missing or cannot be written.
    """
    out = Path(out_dir)
    state, truth = read_run(out)
    figure = MapFigure((point for task in state.tasks.values()
                        for point in (task.position, *task.path)), len(state.tasks))
    for interval in state.zones:
        late = interval.since > state.start() + _AT_START * state.scale.second
        note = f'from {state.clock(interval.since):.0f} s' if late else ''
        figure.zone(interval.zone, note, late)
    figure.fence_area(state.fence_area)
    indices = {uav: index for index, uav in enumerate(sorted(truth.tracks))}
    handles = _tracks(figure, state, truth, indices)
    handles += _tasks(figure, state, truth, indices)
    figure.finish(_title(state, truth), handles, png)


def _tracks(figure: MapFigure, state: RunState, truth: GroundTruth,
            indices: Mapping[str, int]) -> list[Any]:
    handles = []
    for uav, index in indices.items():
        points = [sample.point for sample in truth.tracks[uav]]
        figure.route(points, index)
        figure.home(points[0], uav, index)
        done = sum(status.state == 'COMPLETED' and status.uav == uav and not status.pieces
                   for status in (*state.statuses.known().values(),
                                  *state.statuses.known_pieces().values()))
        text = f'{uav}: {style.task_count(done)}, {polyline_length(points) / 1e3:.1f} km'
        handles.append(style.route_handle(index, text))
    for uav, sample in truth.died.items():
        figure.lost(sample.point, f'{uav} lost at {state.clock(sample.wall):.0f} s')
    return handles


def _tasks(figure: MapFigure, state: RunState, truth: GroundTruth,
           indices: Mapping[str, int]) -> list[Any]:
    reached = served(state, truth)
    for piece, rows in piece_passes(state, truth).items():
        if rows:
            figure.way(state.lists.ways[piece], uav_colour(indices[rows[0].uav]))
    for name, task in state.tasks.items():
        for outline in (task.path, *task.holes):
            figure.outline(outline, closed=task.work == 'AREA')
        marker = 'o' if task.wall <= state.start() + _AT_START * state.scale.second else 'D'
        if reached[name]:
            fill = uav_colour(indices[reached[name][0].uav])
            figure.task(task.position, fill, name, marker)
        else:
            figure.task(task.position, 'white', name, marker, RED)
    return [style.marker_handle('o', '#777777', 'black', 'task at the start'),
            style.marker_handle('D', '#777777', 'black', 'task announced in flight'),
            style.marker_handle('o', 'white', RED, 'task not flown')]


def _title(state: RunState, truth: GroundTruth) -> str:
    done, out = state.statuses.count('COMPLETED'), state.statuses.count('UNASSIGNED', 'REJECTED')
    return (f'{done} of {len(state.tasks)} tasks completed, {out} unassigned; '
            f'{len(truth.tracks)} UAVs, {truth.metres() / 1e3:.1f} km flown')
