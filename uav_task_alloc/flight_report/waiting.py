# SPDX-License-Identifier: Apache-2.0
"""Waiting in a flight: response times, moves of idle UAVs to places, and where tasks came from."""
from __future__ import annotations

import math
from bisect import bisect_right
from html import escape
from itertools import pairwise
from typing import Any, NamedTuple

import plotly.graph_objects as go

from uav_task_alloc.flight_report.flight_history import FlightHistory

_CELLS = 16  # of the map of demand, in each direction
_HEIGHT = 560  # [px]


class WaitingRow(NamedTuple):
    """What one UAV flew to wait."""

    uav: str  # id
    moves: int  # to other places
    metres: float  # flown while it had a place and no task


def waiting_rows(history: FlightHistory) -> list[WaitingRow]:
    """Return what each UAV flew to wait for tasks.

    Args:
        history: of the flight.

    Returns:
        By id, of the UAVs that were sent to a place.
    """
    return [WaitingRow(uav, sum(after is not None and after != before for (_, before), (_, after)
                                in pairwise([(0.0, None), *places])),
                       _metres(history, uav))
            for uav, places in sorted(history.waits.items())]


def _metres(history: FlightHistory, uav: str) -> float:
    """Length [m] of the track of a UAV in flight between samples at which it had a place."""
    changes = history.waits[uav]
    since, waits = [wall for wall, _ in changes], [False, *(p is not None for _, p in changes)]
    return math.fsum(math.dist(a.point, b.point) for a, b in history.steps(uav)
                     if all(waits[bisect_right(since, sample.wall)] for sample in (a, b)))


def mean_response(history: FlightHistory) -> float | None:
    """Return the mean time from the announcements to the starts of the services.

    Args:
        history: of the flight.

    Returns:
        [s] of mission time, over the tasks that were served; None where none was.
    """
    tasks = history.run.tasks
    times = [max(0.0, history.clock(service.begin) - history.clock(tasks[name].wall))
             for name, service in history.run.flown.items() if name in tasks]
    return sum(times) / len(times) if times else None


def waiting_figures(history: FlightHistory) -> list[tuple[str, float | int | None]]:
    """Return the key figures of waiting.

    Args:
        history: of the flight.

    Returns:
        (name, value) each, with units in the names; those of places only where there were any.
    """
    response, rows = mean_response(history), waiting_rows(history)
    return [('response, mean [s]', None if response is None else round(response, 1)),
            *((('moves to waiting places', sum(row.moves for row in rows)),
               ('metres flown for waiting', round(sum(row.metres for row in rows))))
              if rows else ())]


def demand_figure(history: FlightHistory) -> tuple[Any, int] | None:
    """Return a map of where tasks were announced, and of the places where UAVs waited.

    Args:
        history: of the flight.

    Returns:
        A plotly figure and its height [px]; None where no UAV was sent to a place.
    """
    points = [point for point in history.tasks().values() if point is not None]
    places = [(uav, place) for uav, changes in sorted(history.waits.items())
              for _, place in changes if place is not None]
    if not points or not places:
        return None
    x, y = ([point[axis] for point in points] for axis in (0, 1))
    figure = go.Figure()
    figure.add_histogram2d(x=x, y=y, nbinsx=_CELLS, nbinsy=_CELLS, colorscale='YlOrRd',
                           name='tasks', colorbar={'title': 'tasks'},
                           hovertemplate='%{z} tasks<extra></extra>')
    figure.add_scatter(x=[place[0] for _, place in places], y=[place[1] for _, place in places],
                       mode='markers', name='waiting places', showlegend=True,
                       marker={'symbol': 'circle-open', 'size': 12, 'color': '#222222'},
                       text=[escape(uav) for uav, _ in places], hoverinfo='text')
    figure.update_xaxes(title='east [m]')
    figure.update_yaxes(title='north [m]', scaleanchor='x')
    return figure, _HEIGHT
