# SPDX-License-Identifier: Apache-2.0
"""The figures of a report: map, timeline of tasks, heights, solve times, gaps in reception."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from uav_task_alloc.flight_report.flight_history import FlightHistory
from uav_task_alloc.flight_report.strips_figure import add_pieces
from uav_task_alloc.flight_report.times_figure import services_figure
from uav_task_alloc.flight_report.waiting import demand_figure
from uav_task_alloc.geometry.zones import outline
from uav_task_alloc.model import Point, Shape, ThreatZone
from uav_task_alloc.palette import DARK_RED, RED, STATE_COLOURS, rgb, uav_colour
from uav_task_alloc.piece_ids import split_piece
from uav_task_alloc.record.reported import END_STATES

_PLANNED = '#222222'
_ZONE_FILL = 'rgba({:.0f},{:.0f},{:.0f},0.18)'.format(*(255.0 * v for v in rgb(RED)))
_SYMBOLS = {'COMPLETED': 'circle', 'FAILED': 'x', 'CANCELLED': 'line-ew-open',
            'REJECTED': 'x-thin-open'}
_MAX_POINTS = 5000  # drawn of a track
_ROW = 16  # [px] of the timeline
_MAX_HEIGHT = 4000  # [px] of a figure
_TIME = 'mission time [s]'
_LEGEND = 110  # [px] high at most; a longer one scrolls


def flight_map(history: FlightHistory) -> Any:
    """Map of tracks as flown, legs as planned, zones and tasks."""
    figure = go.Figure()
    for interval in history.run.zones:
        _add_zone(figure, interval.zone)
    if corners := history.run.fence_area:
        x, y = zip(*corners, corners[0], strict=True)
        figure.add_scatter(x=x, y=y, mode='lines', name='fence_area', hoverinfo='name',
                           line={'color': RED, 'width': 2.0, 'dash': 'dash'})
    for k, uav in enumerate(sorted(history.tracks.keys() | history.run.lists.newest.keys())):
        flown = [sample.point for sample in history.tracks.get(uav, ())]
        legs = [point for leg in history.planned.get(uav, ()) for point in (*leg, None)]
        for points, name, colour, dash, width in (
                (flown[::1 + len(flown) // _MAX_POINTS], 'flown', uav_colour(k), 'solid', 4.0),
                (legs, 'planned', _PLANNED, 'dash', 1.2),
                (history.remaining(uav), 'not flown yet', uav_colour(k), 'dot', 2.0)):
            if points:
                _add_route(figure, points, f'{escape(uav)} {name}', colour, dash, width)
        if flown:
            figure.add_scatter(
                x=[flown[0][0]], y=[flown[0][1]], mode='markers+text', text=[escape(uav)],
                textposition='bottom center', showlegend=False, hoverinfo='text',
                marker={'symbol': 'square', 'size': 12, 'color': uav_colour(k),
                        'line': {'width': 1, 'color': 'black'}})
    add_pieces(figure, history, sorted(history.tracks.keys() | history.run.lists.newest.keys()))
    _add_tasks(figure, history)
    _add_lost(figure, history)
    figure.update_xaxes(title='east [m]')
    figure.update_yaxes(title='north [m]', scaleanchor='x')
    return _with_layout(figure, 750)


def _add_route(figure: Any, points: Sequence[Point | None], name: str, colour: str, dash: str,
               width: float) -> None:
    figure.add_scatter(
        x=[point and round(point[0], 2) for point in points],
        y=[point and round(point[1], 2) for point in points],
        customdata=[point and round(point[2], 1) for point in points], mode='lines', name=name,
        line={'color': colour, 'dash': dash, 'width': width},
        hovertemplate='%{x:.0f} east, %{y:.0f} north, %{customdata:.0f} m up')


def _add_tasks(figure: Any, history: FlightHistory) -> None:
    """One trace for each state, so that the legend can hide it."""
    groups: dict[str, list[tuple[str, Point]]] = {}
    for name, point in history.tasks().items():
        if point is not None:
            groups.setdefault(history.status(name).state, []).append((name, point))
    for state, rows in sorted(groups.items()):
        names, points = zip(*rows, strict=True)
        figure.add_scatter(
            x=[point[0] for point in points], y=[point[1] for point in points],
            mode='markers' if len(history.tasks()) > 200 else 'markers+text',
            text=[escape(name) for name in names], textposition='top center',
            name=f'{len(rows)} {state.lower()}', textfont={'size': 10}, meta='tasks',
            hovertext=[_task_text(history, name) for name in names], hoverinfo='text',
            marker={'size': 9, 'color': STATE_COLOURS.get(state, 'white'),
                    'line': {'width': 1, 'color': 'black'}})


def _add_lost(figure: Any, history: FlightHistory) -> None:
    """A cross where a UAV was last, if it was lost."""
    lost = history.lost()
    if lost:
        texts = [escape(f'{uav} lost at {history.clock(sample.wall):.0f} s')
                 for uav, sample in lost.items()]
        figure.add_scatter(
            x=[sample.point[0] for sample in lost.values()],
            y=[sample.point[1] for sample in lost.values()], mode='markers+text', text=texts,
            textposition='bottom center', textfont={'color': DARK_RED, 'size': 13}, name='lost',
            hovertext=[f'{text}, {sample.point[2]:.0f} m up' for text, sample in zip(
                texts, lost.values(), strict=True)], hoverinfo='text',
            marker={'symbol': 'x', 'size': 14, 'color': DARK_RED,
                    'line': {'width': 1, 'color': 'white'}})


def level_figure(history: FlightHistory) -> Any:
    """Height and battery of each UAV over time."""
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    above_home = history.levels.keys() <= history.homes.keys()
    for k, uav in enumerate(sorted(history.levels)):
        levels = history.levels[uav]
        levels = levels[::1 + len(levels) // _MAX_POINTS]
        when = [round(history.clock(level.wall), 1) for level in levels]
        home = history.homes[uav] if above_home else 0.0
        heights = [None if level.up is None else round(level.up - home, 1) for level in levels]
        batteries = [None if level.battery is None else round(100.0 * level.battery, 1)
                     for level in levels]
        for row, values, unit in ((1, heights, 'm'), (2, batteries, '%')):
            figure.add_scatter(
                x=when, y=values, mode='lines', name=escape(uav), legendgroup=escape(uav),
                showlegend=row == 1, line={'color': uav_colour(k)}, row=row, col=1,
                hovertemplate=f'%{{x:.0f}} s: %{{y:.1f}} {unit}')
    for uav, sample in history.lost().items():
        figure.add_vline(x=history.clock(sample.wall), line={'color': DARK_RED, 'dash': 'dot'},
                         annotation={'text': f'{escape(uav)} lost', 'font': {'color': DARK_RED}},
                         row=1, col=1)
    above = 'above home' if above_home and history.homes else 'above the origin'
    figure.update_yaxes(title=f'height {above} [m]', row=1, col=1)
    figure.update_yaxes(title='battery [%]', range=[0, 105], row=2, col=1)
    figure.update_xaxes(title=_TIME, row=2, col=1)
    return _with_layout(_with_mission(figure, history), 520)


def _task_text(history: FlightHistory, task: str) -> str:
    status = history.status(task)
    return escape(f'{task}: {status.state.lower()} {status.uav} {status.reason}')


def _add_zone(figure: Any, zone: ThreatZone) -> None:
    """The footprint, and its margin as a thin line."""
    if zone.shape is Shape.POLYGON:
        rims = [[*rim, rim[0]] for rim in (zone.vertices, outline(zone))]
    else:
        rims = [[(zone.center[0] + radius * math.cos(turn * math.pi / 24),
                  zone.center[1] + radius * math.sin(turn * math.pi / 24)) for turn in range(49)]
                for radius in (zone.radius, zone.radius + zone.margin)]
    for k, rim in enumerate(rims):
        figure.add_scatter(
            x=[x for x, _ in rim], y=[y for _, y in rim], mode='lines', name=escape(zone.id),
            line={'color': RED, 'width': 1.5 if k == 0 else 0.5}, hoverinfo='name',
            fill='toself' if k == 0 else 'none', fillcolor=_ZONE_FILL,
            legendgroup=f'zone {escape(zone.id)}', showlegend=k == 0)


def _order(history: FlightHistory) -> Callable[[str], tuple[int, int]]:
    """The order of rows: tasks as announced, each with its pieces below it."""
    number = {name: k for k, name in enumerate(history.tasks())}

    def key(name: str) -> tuple[int, int]:
        whole, piece = split_piece(name)
        return number.get(whole, len(number)), piece
    return key


def timeline_figure(history: FlightHistory) -> Any:
    """A row for each task: a bar for each state, a marker at its end."""
    names = sorted({**history.tasks(), **history.spans}, key=_order(history))
    row = {name: k for k, name in enumerate(names)}
    figure = go.Figure()
    bars: dict[str, list[tuple[int, float, float, str]]] = {}
    marks: dict[str, list[tuple[int, float, str]]] = {}
    for name, spans in history.spans.items():
        ends = [*(span.since for span in spans[1:]), history.run.last]
        for span, end in zip(spans, ends, strict=True):
            since, until = history.clock(span.since), history.clock(end)
            text = escape(f'{name}: {span.state.lower()} {span.uav}')
            if span.state in END_STATES:
                marks.setdefault(span.state, []).append((row[name], since, text))
            else:
                bars.setdefault(span.state, []).append((row[name], since, until - since, text))
    for state, row_bars in bars.items():
        rows, starts, lengths, texts = zip(*row_bars, strict=True)
        figure.add_bar(
            y=rows, base=starts, x=lengths, orientation='h', name=state.lower(), hovertext=texts,
            hovertemplate='%{hovertext}<br>%{base:.1f} s for %{x:.1f} s<extra></extra>',
            marker={'color': STATE_COLOURS.get(state, 'white'), 'line': {'width': 0}}, width=0.8)
    for state, row_marks in marks.items():
        rows, starts, texts = zip(*row_marks, strict=True)
        figure.add_scatter(
            y=rows, x=starts, mode='markers', name=state.lower(), hovertext=texts,
            hovertemplate='%{hovertext}<br>%{x:.1f} s<extra></extra>',
            marker={'symbol': _SYMBOLS[state], 'size': 8, 'color': STATE_COLOURS[state]})
    figure.update_layout(barmode='overlay')
    _set_rows(figure, names)
    return _with_layout(_with_mission(figure, history), min(_MAX_HEIGHT, 160 + _ROW * len(names)))


def solve_figure(history: FlightHistory) -> Any:
    """Solve time, fit and number of tasks of each plan over time."""
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.04)
    when = [history.clock(plan.wall) for plan in history.replans]
    text = [escape(f'plan {plan.revision}: {plan.trigger}') for plan in history.replans]
    for k, (title, values) in enumerate((
            ('solve time [ms]', [plan.milliseconds for plan in history.replans]),
            ('fit (smaller is better)', [plan.fit for plan in history.replans]),
            ('tasks listed', [plan.listed for plan in history.replans])), 1):
        figure.add_scatter(x=when, y=values, mode='lines+markers', hovertext=text, row=k, col=1,
                           line={'shape': 'hv' if k > 1 else 'linear', 'color': uav_colour(k - 1)},
                           hovertemplate='%{hovertext}<br>%{y}<extra></extra>')
        figure.update_yaxes(title=title, row=k, col=1, rangemode='tozero')
    figure.update_xaxes(title=_TIME, row=3, col=1)
    figure.update_layout(showlegend=False)
    return _with_layout(_with_mission(figure, history), 600)


def reception_figure(history: FlightHistory) -> Any:
    """A row for each UAV: grey while its states were received, red in gaps."""
    names = sorted(history.tracks)
    figure = go.Figure()
    for title, colour, spans in (
            ('received', '#cfd8dc', [(uav, history.tracks[uav][0].wall, history.last_state[uav])
                                  for uav in names if history.tracks[uav]]),
            ('not received', RED, [(gap.uav, gap.since, gap.until) for gap in history.gaps
                                if gap.uav in history.tracks])):
        figure.add_bar(
            y=[names.index(uav) for uav, _, _ in spans], orientation='h', name=title,
            base=[history.clock(since) for _, since, _ in spans],
            x=[(until - since) * history.run.scale.speedup for _, since, until in spans],
            hovertemplate='%{base:.1f} s for %{x:.1f} s<extra></extra>',
            marker={'color': colour}, width=0.6)
    figure.update_layout(barmode='overlay')
    _set_rows(figure, names)
    return _with_layout(_with_mission(figure, history),
                        min(_MAX_HEIGHT, 160 + 2 * _ROW * len(names)))


def _set_rows(figure: Any, names: Sequence[str]) -> None:
    figure.update_yaxes(tickvals=list(range(len(names))), ticktext=[escape(n) for n in names],
                        autorange='reversed', tickfont={'size': 10})
    figure.update_xaxes(title=_TIME)


def _with_mission(figure: Any, history: FlightHistory) -> Any:
    """Shade the seconds of the recording that are before the mission and after it."""
    first, last = history.clock(history.run.first), history.clock(history.run.last)
    end = history.clock(history.mission_end())
    for since, until in ((first, 0.0), (end, last)):
        if until > since and math.isfinite(until - since):
            figure.add_vrect(x0=since, x1=until, fillcolor='#9e9e9e', opacity=0.15, line_width=0,
                             layer='below', row='all', col=1)
    return figure


def _with_layout(figure: Any, height: int) -> Any:
    """One look for all figures; the legend is below, so that a phone has the width."""
    return figure.update_layout(
        height=height, template='plotly_white', hovermode='closest',
        margin={'l': 55, 'r': 12, 't': 30, 'b': 40},
        legend={'orientation': 'h', 'yref': 'container', 'y': 0.0, 'yanchor': 'bottom',
                'maxheight': _LEGEND, 'font': {'size': 11}})


def all_figures(history: FlightHistory) -> Iterable[tuple[str, str, Any]]:
    """The figures of a report.

    Args:
        history: of the flight.

    Returns:
        (name, title, figure) in the order of the page.
    """
    yield 'map', 'Map: as flown and as planned', flight_map(history)
    yield 'timeline', 'Timeline of tasks', timeline_figure(history)
    services = services_figure(history)
    if services is not None:
        figure, height = services
        yield ('services', 'Services: planned, flown and windows',
               _with_layout(_with_mission(figure, history), min(_MAX_HEIGHT, height)))
    demand = demand_figure(history)
    if demand is not None:
        figure, height = demand
        yield 'demand', 'Demand: tasks announced, and waiting places', _with_layout(figure, height)
    yield 'levels', 'Height and battery', level_figure(history)
    yield 'solving', 'Plans: solve time and fit', solve_figure(history)
    yield 'gaps', 'Gaps: UAVs not received', reception_figure(history)
