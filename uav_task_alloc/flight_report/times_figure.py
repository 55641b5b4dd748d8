# SPDX-License-Identifier: Apache-2.0
"""The figure of services in a report: a row for each UAV, as planned, as flown, and windows."""
from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any, NamedTuple

import plotly.graph_objects as go

from uav_task_alloc.flight_report.flight_history import FlightHistory
from uav_task_alloc.palette import uav_colour

_ROW = 46  # [px]
_OPEN = 30.0  # [s] drawn of a window without one of its ends


class _Bar(NamedTuple):
    """One bar of the figure; times are of the mission [s]."""

    kind: str  # planned, flown or window
    uav: str
    task: str
    since: float
    until: float


def services_figure(history: FlightHistory) -> tuple[Any, int] | None:
    """Return the services of each UAV over mission time.

    Args:
        history: of the flight.

    Returns:
        A plotly figure and its height [px]; None where no list had times.
    """
    bars = list(_bars(history))
    if not any(bar.kind == 'planned' for bar in bars):
        return None
    names = sorted({bar.uav for bar in bars})
    figure = go.Figure()
    for kind, width, shift in (('planned', 0.4, 0.0), ('flown', 0.24, 0.0),
                               ('window', 0.08, 0.34)):
        chosen = [bar for bar in bars if bar.kind == kind]
        colours = [uav_colour(names.index(bar.uav)) for bar in chosen]
        figure.add_bar(
            y=[names.index(bar.uav) + shift for bar in chosen], base=[bar.since for bar in chosen],
            x=[bar.until - bar.since for bar in chosen], orientation='h', name=kind, width=width,
            hovertext=[escape(f'{bar.task} {kind}') for bar in chosen],
            hovertemplate='%{hovertext}<br>%{base:.1f} s for %{x:.1f} s<extra></extra>',
            marker={'color': {'flown': colours, 'planned': 'rgba(0,0,0,0)'}.get(kind, '#9e9e9e'),
                    'line': {'width': 1 if kind == 'planned' else 0, 'color': '#222222'}})
    figure.update_layout(barmode='overlay')
    figure.update_yaxes(tickvals=list(range(len(names))), ticktext=[escape(n) for n in names],
                        autorange='reversed')
    figure.update_xaxes(title='mission time [s]')
    return figure, 160 + _ROW * len(names)


def _bars(history: FlightHistory) -> Iterable[_Bar]:
    run = history.run

    def bar(kind: str, uav: str, task: str, since: float, until: float) -> _Bar:
        return _Bar(kind, uav, task, history.clock(since), history.clock(until))

    owners = {task: flown.uav for task, flown in run.flown.items()}
    for task, flown in run.flown.items():
        planned = run.planned.get(task)
        if planned is not None:
            yield bar('planned', flown.uav, task, planned.begin, planned.end)
        yield bar('flown', flown.uav, task, flown.begin, flown.end)
    for uav, line in run.lists.newest.items():
        for row in line['tasks']:
            service = run.service(line, row)
            if service is not None and row['id'] not in run.flown:
                owners[row['id']] = uav
                yield bar('planned', uav, row['id'], service.begin, service.end)
    for task, uav in owners.items():
        known = run.tasks.get(task)
        early, late = (known.earliest, known.latest) if known else (None, None)
        if late is not None or early is not None:
            since = early if early is not None else (late or 0.0) - _OPEN
            yield bar('window', uav, task, since, since + _OPEN if late is None else late)
