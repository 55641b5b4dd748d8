# SPDX-License-Identifier: Apache-2.0
"""The figures of a report: map, timeline of tasks, solve times, what was not heard."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from uav_task_alloc.flight_report.story import ENDED, Story
from uav_task_alloc.geometry.zones import outline
from uav_task_alloc.model import Point, Shape, ThreatZone

# those of plots/style.py, which would take matplotlib
COLOURS = ('#0072b2', '#e69f00', '#009e73', '#cc79a7', '#56b4e9', '#000000', '#540078', '#c0b478')
RED, PLANNED = '#c62828', '#222222'
_STATES = {'PENDING': '#b0b0b0', 'ASSIGNED': '#56b4e9', 'ACTIVE': '#e69f00',
          'UNASSIGNED': '#cc79a7', 'COMPLETED': '#009e73', 'FAILED': '#d55e00',
          'CANCELLED': '#7f7f7f', 'REJECTED': '#5e3c99'}
SYMBOLS = {'COMPLETED': 'circle', 'FAILED': 'x', 'CANCELLED': 'line-ew-open',
           'REJECTED': 'x-thin-open'}
_MOST_POINTS = 5000  # of a track that is drawn
ROW = 16  # [px] of the timeline
TALLEST = 4000  # [px]
_TIME = 'mission time [s]'


def uav_colour(index: int) -> str:
    """The colour of the UAV with this place in the fleet."""
    return COLOURS[index % len(COLOURS)]


def flight_map(story: Story) -> Any:
    """As flown against as planned, from above."""
    figure = go.Figure()
    for seen in story.heard.zones:
        _zone(figure, seen.zone)
    for k, uav in enumerate(sorted(story.tracks.keys() | story.heard.lists.keys())):
        flown = [sample.point for sample in story.tracks.get(uav, ())]
        legs = [point for leg in story.planned.get(uav, ()) for point in (*leg, None)]
        for points, name, paint, dash, width in (
                (flown[::1 + len(flown) // _MOST_POINTS], 'flown', uav_colour(k), 'solid', 4.0),
                (legs, 'planned', PLANNED, 'dash', 1.2),
                (story.rest(uav), 'not flown yet', uav_colour(k), 'dot', 2.0)):
            if points:
                _way(figure, points, f'{escape(uav)} {name}', paint, dash, width)
        if flown:
            figure.add_scatter(
                x=[flown[0][0]], y=[flown[0][1]], mode='markers+text', text=[escape(uav)],
                textposition='bottom center', showlegend=False, hoverinfo='text',
                marker={'symbol': 'square', 'size': 12, 'color': uav_colour(k),
                        'line': {'width': 1, 'color': 'black'}})
    _tasks(figure, story)
    figure.update_xaxes(title='east [m]')
    figure.update_yaxes(title='north [m]', scaleanchor='x')
    return _laid_out(figure, 'Map: as flown against as planned', 750)


def _way(figure: Any, points: Sequence[Point | None], name: str, line: str, dash: str,
         width: float) -> None:
    figure.add_scatter(
        x=[point and round(point[0], 2) for point in points],
        y=[point and round(point[1], 2) for point in points],
        customdata=[point and round(point[2], 1) for point in points], mode='lines', name=name,
        line={'color': line, 'dash': dash, 'width': width},
        hovertemplate='%{x:.0f} east, %{y:.0f} north, %{customdata:.0f} m up')


def _tasks(figure: Any, story: Story) -> None:
    """One trace for each state, so that the legend switches it."""
    groups: dict[str, list[tuple[str, Point]]] = {}
    for name, point in story.tasks().items():
        if point is not None:
            groups.setdefault(story.status(name).state, []).append((name, point))
    for state, rows in sorted(groups.items()):
        names, points = zip(*rows, strict=True)
        figure.add_scatter(
            x=[point[0] for point in points], y=[point[1] for point in points],
            mode='markers' if len(story.tasks()) > 200 else 'markers+text',
            text=[escape(name) for name in names], textposition='top center',
            name=f'{len(rows)} {state.lower()}', textfont={'size': 10},
            hovertext=[_about(story, name) for name in names], hoverinfo='text',
            marker={'size': 9, 'color': _STATES.get(state, 'white'),
                    'line': {'width': 1, 'color': 'black'}})


def _about(story: Story, task: str) -> str:
    status = story.status(task)
    return escape(f'{task}: {status.state.lower()} {status.uav} {status.reason}')


def _zone(figure: Any, zone: ThreatZone) -> None:
    """Footprint, and its margin as a thin line."""
    if zone.shape is Shape.POLYGON:
        rims = [[*rim, rim[0]] for rim in (zone.vertices, outline(zone))]
    else:
        rims = [[(zone.center[0] + reach * math.cos(turn * math.pi / 24),
                  zone.center[1] + reach * math.sin(turn * math.pi / 24)) for turn in range(49)]
                for reach in (zone.radius, zone.radius + zone.margin)]
    for k, rim in enumerate(rims):
        figure.add_scatter(
            x=[x for x, _ in rim], y=[y for _, y in rim], mode='lines', name=escape(zone.id),
            line={'color': RED, 'width': 1.5 if k == 0 else 0.5}, hoverinfo='name',
            fill='toself' if k == 0 else 'none', fillcolor='rgba(198,40,40,0.18)',
            legendgroup='zones', showlegend=k == 0)


def timeline_figure(story: Story) -> Any:
    """A row for each task: a bar for each state it was in, a mark where it ended."""
    names = list(story.tasks())
    row = {name: k for k, name in enumerate(names)}
    figure = go.Figure()
    bars: dict[str, list[tuple[int, float, float, str]]] = {}
    marks: dict[str, list[tuple[int, float, str]]] = {}
    for name, spans in story.spans.items():
        ends = [*(span.since for span in spans[1:]), story.heard.last]
        for span, end in zip(spans, ends, strict=True):
            since, until = story.clock(span.since), story.clock(end)
            text = escape(f'{name}: {span.state.lower()} {span.uav}')
            if span.state in ENDED:
                marks.setdefault(span.state, []).append((row[name], since, text))
            else:
                bars.setdefault(span.state, []).append((row[name], since, until - since, text))
    for state, told in bars.items():
        rows, starts, lengths, texts = zip(*told, strict=True)
        figure.add_bar(
            y=rows, base=starts, x=lengths, orientation='h', name=state.lower(), hovertext=texts,
            hovertemplate='%{hovertext}<br>%{base:.1f} s for %{x:.1f} s<extra></extra>',
            marker={'color': _STATES.get(state, 'white'), 'line': {'width': 0}}, width=0.8)
    for state, ended in marks.items():
        at, when, said = zip(*ended, strict=True)
        figure.add_scatter(
            y=at, x=when, mode='markers', name=state.lower(), hovertext=said,
            hovertemplate='%{hovertext}<br>%{x:.1f} s<extra></extra>',
            marker={'symbol': SYMBOLS[state], 'size': 8, 'color': _STATES[state]})
    figure.update_layout(barmode='overlay')
    _rows(figure, names)
    return _laid_out(figure, 'Timeline of tasks', min(TALLEST, 160 + ROW * len(names)))


def solving(story: Story) -> Any:
    """Solve times, and how good each plan was."""
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.04)
    when = [story.clock(plan.wall) for plan in story.replans]
    text = [escape(f'plan {plan.revision}: {plan.trigger}') for plan in story.replans]
    for k, (title, values) in enumerate((
            ('solve time [ms]', [plan.milliseconds for plan in story.replans]),
            ('fit (smaller is better)', [plan.fit for plan in story.replans]),
            ('tasks listed', [plan.listed for plan in story.replans])), 1):
        figure.add_scatter(x=when, y=values, mode='lines+markers', hovertext=text, row=k, col=1,
                           line={'shape': 'hv' if k > 1 else 'linear', 'color': uav_colour(k - 1)},
                           hovertemplate='%{hovertext}<br>%{y}<extra></extra>')
        figure.update_yaxes(title=title, row=k, col=1, rangemode='tozero')
    figure.update_xaxes(title=_TIME, row=3, col=1)
    figure.update_layout(showlegend=False)
    return _laid_out(figure, 'Re-plans: time to solve, and how good', 600)


def silence(story: Story) -> Any:
    """A row for each UAV: grey while it was heard, red while it was not."""
    names = sorted(story.tracks)
    figure = go.Figure()
    for title, paint, spans in (
            ('heard', '#cfd8dc', [(uav, story.tracks[uav][0].wall, story.last_state[uav])
                                  for uav in names if story.tracks[uav]]),
            ('not heard', RED, [(gap.uav, gap.since, gap.until) for gap in story.gaps
                                if gap.uav in story.tracks])):
        figure.add_bar(
            y=[names.index(uav) for uav, _, _ in spans], orientation='h', name=title,
            base=[story.clock(since) for _, since, _ in spans],
            x=[(until - since) * story.heard.speedup for _, since, until in spans],
            hovertemplate='%{base:.1f} s for %{x:.1f} s<extra></extra>',
            marker={'color': paint}, width=0.6)
    figure.update_layout(barmode='overlay')
    _rows(figure, names)
    return _laid_out(figure, 'Gaps: who was not heard', min(TALLEST, 160 + 2 * ROW * len(names)))


def _rows(figure: Any, names: Sequence[str]) -> None:
    figure.update_yaxes(tickvals=list(range(len(names))), ticktext=[escape(n) for n in names],
                        autorange='reversed', tickfont={'size': 10})
    figure.update_xaxes(title=_TIME)


def _laid_out(figure: Any, title: str, height: int) -> Any:
    return figure.update_layout(
        title={'text': title, 'x': 0.01}, height=height, template='plotly_white',
        margin={'l': 70, 'r': 20, 't': 50, 'b': 50}, hovermode='closest')


def all_figures(story: Story) -> Iterable[tuple[str, Any]]:
    """(name, figure) in the order of the page."""
    yield from (('map', flight_map(story)), ('timeline', timeline_figure(story)),
                ('solving', solving(story)), ('gaps', silence(story)))
