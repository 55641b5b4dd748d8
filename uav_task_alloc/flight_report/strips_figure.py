# SPDX-License-Identifier: Apache-2.0
"""Strips on the map of a report: areas, pieces flown, interrupted and not flown."""
from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from uav_task_alloc.flight_report.flight_history import FlightHistory
from uav_task_alloc.flight_report.strips import FlownPiece, piece_rows
from uav_task_alloc.palette import DARK_RED, uav_colour

_GREY = '#888888'


def add_pieces(figure: Any, history: FlightHistory, uavs: Sequence[str]) -> None:
    """Add the outlines of areas and the ways of pieces.

    A flown piece is a wide band in the colour of its UAV, one that is not flown thin and dotted,
    and one that was interrupted dashed in red.

    Args:
        figure: the map; is changed.
        history: of a whole flight.
        uavs: in the order of their colours.
    """
    for name, task in history.run.tasks.items():
        if task.work == 'AREA' and len(task.path) > 2:
            for ring in (task.path, *task.holes):
                _add_line(figure, [*ring, ring[0]], f'outline of {escape(name)}', _GREY, 'solid',
                          1.0, legend=ring is task.path)
    shown = set[str]()
    for row in piece_rows(history):
        if len(row.way) < 2:
            continue
        colour, dash, width, kind = _style(row, uavs)
        _add_line(figure, row.way, kind, colour, dash, width, text=_text(row),
                  legend=kind not in shown)
        shown.add(kind)


def _style(row: FlownPiece, uavs: Sequence[str]) -> tuple[str, str, float, str]:
    """Colour, dash, width [px] and entry of the legend of a piece."""
    if row.state == 'COMPLETED':
        owner = row.flown_by
        colour = uav_colour(uavs.index(owner)) if owner in uavs else _GREY
        return colour, 'solid', 9.0, f'strips flown by {escape(owner)}'
    if row.interrupted:
        return DARK_RED, 'dash', 4.0, 'strips interrupted'
    return _GREY, 'dot', 3.0, 'strips not flown'


def _text(row: FlownPiece) -> str:
    parts = [f'{row.piece}: {row.state.lower()}', f'planned for {", ".join(row.planned)}',
             f'flown by {row.flown_by}' if row.flown_by else '',
             f'interrupted: {row.interrupted}' if row.interrupted else '',
             '' if row.share is None else f'{100.0 * row.share:.0f} % of its way flown']
    return escape('; '.join(filter(None, parts)))


def _add_line(figure: Any, points: Sequence[Sequence[float]], name: str, colour: str, dash: str,
              width: float, text: str = '', legend: bool = True) -> None:
    figure.add_scatter(
        x=[round(point[0], 2) for point in points], y=[round(point[1], 2) for point in points],
        mode='lines', name=name, legendgroup=name, showlegend=legend, opacity=0.45,
        line={'color': colour, 'dash': dash, 'width': width}, hovertext=text,
        hoverinfo='text' if text else 'skip')
