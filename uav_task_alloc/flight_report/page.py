# SPDX-License-Identifier: Apache-2.0
"""The report as one HTML file without network access: interactive figures and tables."""
from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from datetime import datetime, timezone
from html import escape
from pathlib import Path
from statistics import median

from plotly.offline import get_plotlyjs

from uav_task_alloc.errors import InvalidValue, counted
from uav_task_alloc.flight_report.figures import all_figures
from uav_task_alloc.flight_report.flight_history import FlightHistory, StateSpan, read_history
from uav_task_alloc.flight_report.strips import covered_shares, piece_rows
from uav_task_alloc.flight_report.waiting import waiting_figures, waiting_rows
from uav_task_alloc.geometry.frames import to_geodetic
from uav_task_alloc.record.bag_reader import BagReader
from uav_task_alloc.record.reported import END_STATES

# names of tasks and UAVs come from the network: no other script may run, nothing is loaded
POLICY = ("default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
          "img-src data: blob:")
STYLE = """body { font: 15px/1.45 sans-serif; margin: 1.5em auto; max-width: 1300px;
  padding: 0 1em; color: #222 }
table { border-collapse: collapse; margin: 0.5em 0 2em }
th, td { border-bottom: 1px solid #ddd; padding: 3px 10px; text-align: left; vertical-align: top }
th { background: #f4f6f8 } td.n { text-align: right; font-variant-numeric: tabular-nums }
.warning { background: #fff3cd; border-left: 5px solid #e69f00; padding: 0.6em 1em }
details { margin: 1em 0 } summary { cursor: pointer }
summary, h2 { font-size: 1.3em; font-weight: bold } h2 { margin: 1em 0 0 }
.scroll { overflow-x: auto } table { width: max-content; max-width: none }
td { overflow-wrap: break-word; max-width: 24em }
@media (max-width: 600px) { body { margin: .5em auto; padding: 0 .5em } h1 { font-size: 1.4em }
  th, td { padding: 3px 6px; font-size: 13px } }"""
# a finger scrolls the page, the buttons of a figure zoom; where names of tasks have no room, a tap
# shows them
ON_PHONES = """if (matchMedia('(pointer: coarse)').matches) {
  for (const plot of document.querySelectorAll('.js-plotly-plot')) {
    Plotly.relayout(plot, {dragmode: false});
  }
}
if (innerWidth < 600) {
  const map = document.getElementById('map');
  const tasks = map.data.flatMap((trace, k) => trace.meta === 'tasks' ? [k] : []);
  if (tasks.length) Plotly.restyle(map, {mode: 'markers'}, tasks);
}"""
CONFIG = {'displaylogo': False, 'responsive': True,
          'showSendToCloud': False}  # a default button of plotly's toolbar
Cell = str | float | int | None


def write_report(bag: Path, html: Path,
                 namespace: str | None = None) -> tuple[FlightHistory, list[str]]:
    """Write the report of an MCAP file.

    Args:
        bag: the MCAP file.
        html: the report.
        namespace: of the fleet; None: the only one in the file.

    Returns:
        The flight, and warnings on damage and undecodable messages.

    Raises:
        OSError: a file cannot be read or written.
        InvalidValue: the MCAP file has no messages of a fleet, or those of several.
    """
    reader = BagReader(bag, namespace)
    history = read_history(reader)
    warnings = [f'{bag.name}: {reader.damage}; the report covers what is before'] * bool(
        reader.damage)
    warnings += [f'{counted(count, "message")} of {topic} could not be decoded'
                for topic, count in reader.undecodable.items()]
    warnings += [f'left out: {counted(len(reader.unplaced), "task")} in degrees, as there '
                 'is no fleet_origin'] * bool(reader.unplaced)
    if not history.tasks() and not history.tracks:
        raise InvalidValue('file', str(bag), 'messages of a fleet in it, found '
                           f'{reader.counted.total()} of {len(reader.counted)} topics'
                           + f', none of {reader.namespace}' * bool(reader.namespace)
                           + f' ({reader.damage})' * bool(reader.damage))
    html.write_text(report_page(history, bag.name, warnings), encoding='utf-8')
    return history, warnings


def report_page(history: FlightHistory, name: str, warnings: Iterable[str] = ()) -> str:
    """The report as HTML.

    Args:
        history: of the flight.
        name: of the MCAP file.
        warnings: shown above the tables.
    """
    figures = ''.join(
        f'<h2>{title}</h2>\n'
        + figure.to_html(full_html=False, include_plotlyjs=False, div_id=div, config=CONFIG)
        for div, title, figure in all_figures(history))
    head = f'Flight of {start_time(history)}'
    parts = [
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
        f'<title>{escape(head)}</title><style>{STYLE}</style>',
        f'<script>{get_plotlyjs()}</script></head><body><h1>{escape(head)}</h1>',
        *(f'<p class="warning">{escape(text)}</p>' for text in warnings),
        f'<p id="times">{escape(time_text(history))}</p>',
        html_table('Key figures', (f'of {name}', ''), key_figures(history)),
        figures, f'<script>{ON_PHONES}</script>', tables(history), '</body></html>']
    return '\n'.join(parts)


def start_time(history: FlightHistory) -> str:
    """Date and time of the first line, as text."""
    try:
        return datetime.fromtimestamp(history.run.first, timezone.utc).strftime('%F %T UTC')
    except (OverflowError, ValueError, OSError):
        return 'unknown date'


def time_text(history: FlightHistory) -> str:
    """Which seconds are those of the mission, in words."""
    run = history.run
    if not history.tasks() or not all(map(math.isfinite, (run.first, run.last))):
        return 'All times are in seconds since the first message; no task was announced.'
    begin, end = (f'{history.clock(wall):.0f} s' for wall in (run.first, run.last))
    scale = run.scale
    fast = f' One second of the clock is {scale.speedup:g} s of the mission.' if (
        scale.speedup != 1.0) else (f' It was flown {scale.rate:g} times faster than real time.'
                                    if scale.rate != 1.0 else '')
    close = history.mission_end()
    why = 'the last task ended' if close < run.last else 'the recording ended with open tasks'
    return (f'All times are mission time: 0 s is the first task announced, at '
            f'{_time_of_day(run.start())}. The mission is from 0 s to {history.clock(close):.0f} '
            f's, when {why}; the recording is from {begin} to {end}, grey in the figures where it '
            f'is not the mission.{fast}')


def _time_of_day(wall: float) -> str:
    try:
        return datetime.fromtimestamp(wall, timezone.utc).strftime('%T UTC')
    except (OverflowError, ValueError, OSError):
        return 'an unknown time'


def key_figures(history: FlightHistory) -> list[tuple[Cell, ...]]:
    """Return the rows of the table of key figures.

    Args:
        history: of the recorded flight.

    Returns:
        (name, value) each; None: there is no value. Units are in the names.
    """
    counts = Counter(history.status(task).state for task in history.tasks())
    times = [plan.milliseconds for plan in history.replans]
    flown = sum(history.metres(uav) for uav in history.tracks)
    planned = sum(history.metres_planned(uav) for uav in history.tracks)
    return [
        ('tasks', len(history.tasks())),
        *((f'tasks {state.lower()}', count) for state, count in sorted(counts.items())),
        *_strip_figures(history),
        *waiting_figures(history),
        ('UAVs', len(history.tracks)), ('UAVs lost', len(history.lost())),
        ('metres flown', round(flown)),
        ('metres planned, of the legs that were begun', round(planned)),
        ('re-plans', sum(bool(plan.changed) for plan in history.replans[1:])),
        ('plans that changed nothing', sum(not plan.changed for plan in history.replans[1:])),
        ('solve time, median [ms]', round(median(times), 1) if times else None),
        ('solve time, longest [ms]', round(max(times), 1) if times else None),
        ('gaps in reception', len(history.gaps)),
        ('mission, to the end of the last task [s]',
         round(max(0.0, history.clock(history.mission_end())), 1)),
        ('last task completed at [s]', _last_flown(history, history.run.flown)),
        ('recorded, of mission time [s]',
         round((history.run.last - history.run.first) * history.run.scale.speedup, 1))]


def tables(history: FlightHistory) -> str:
    """The tables of tasks, UAVs, re-plans, gaps and events."""
    def at(wall: float) -> float:
        return round(history.clock(wall), 1)

    return ''.join((
        html_table('Tasks', ('task', 'state', 'UAV', 'value', 'announced [s]', 'begun [s]',
                             'ended [s]', 'reason'),
                   (_task_row(history, task) for task in history.tasks())),
        _strips_table(history),
        _waiting_table(history),
        html_table('UAVs', ('UAV', 'tasks and pieces completed', 'metres flown', 'metres planned',
                            'battery', 'last mode', 'done at [s]', 'silent [s]', 'lost at [s]',
                            'last position'),
                   (_uav_row(history, uav) for uav in sorted(history.tracks))),
        html_table('Re-plans', ('at [s]', 'plan', 'trigger', 'changes', 'solve time [ms]', 'fit',
                                'metres'),
                   ((at(plan.wall), plan.revision, plan.trigger, plan.changed or 'none',
                     round(plan.milliseconds, 1), plan.fit and round(plan.fit, 4),
                     plan.distance and round(plan.distance))
                    for k, plan in enumerate(history.replans) if plan.changed or not k)),
        html_table('Gaps', ('UAV', 'from [s]', 'to [s]', 'for [s]'),
                   ((gap.uav or 'all', at(gap.since), at(gap.until),
                     round((gap.until - gap.since) * history.run.scale.speedup, 1))
                    for gap in history.gaps)),
        html_table('Events', ('at [s]', 'event'),
                   ((at(wall), text) for wall, _, text in history.events)),
        f'<p>{history.dropped} earlier events are left out.</p>' if history.dropped else ''))


def _strips_table(history: FlightHistory) -> str:
    """The table of strips and other pieces; nothing where no task has any."""
    rows = piece_rows(history)
    return html_table('Strips', ('piece', 'state', 'planned for', 'flown by', 'metres',
                                 'flown', 'interrupted'), (
        (row.piece, row.state.lower(), ', '.join(row.planned), row.flown_by, round(row.metres),
         _percent(row.share), row.interrupted) for row in rows)) if rows else ''


def _waiting_table(history: FlightHistory) -> str:
    """The table of waiting; nothing where no UAV was sent to a place."""
    rows = waiting_rows(history)
    return html_table('Waiting', ('UAV', 'moves to waiting places', 'metres flown for waiting'), (
        (row.uav, row.moves, round(row.metres)) for row in rows)) if rows else ''


def _percent(share: float | None) -> str:
    return '' if share is None else f'{100.0 * share:.0f} %'


def _strip_figures(history: FlightHistory) -> list[tuple[Cell, ...]]:
    """Key figures of strips: how many, flown, interrupted, and which share of areas is covered."""
    rows = piece_rows(history)
    covered = covered_shares(history, rows)
    return [
        ('strips and other pieces', len(rows)),
        ('pieces flown', sum(row.state == 'COMPLETED' for row in rows)),
        ('pieces interrupted', sum(bool(row.interrupted) for row in rows)),
        *((f'{name}: inside flown footprints [%]', round(100.0 * share, 1))
          for name, share in covered.items())] if rows else []


def _task_row(history: FlightHistory, task: str) -> tuple[Cell, ...]:
    status = history.status(task)
    known = history.run.tasks.get(task)
    spans = history.spans.get(task, [])

    def since(found: Iterable[StateSpan]) -> Cell:
        span = next(iter(found), None)
        return None if span is None else round(history.clock(span.since), 1)

    return (task, status.state.lower(), status.uav, history.values.get(task),
            round(history.clock(known.wall), 1) if known else None,
            since(span for span in spans if span.state == 'ACTIVE'),
            since(span for span in spans[-1:] if span.state in END_STATES), status.reason)


def _uav_row(history: FlightHistory, uav: str) -> tuple[Cell, ...]:
    state = history.run.uavs[uav]
    ended = (*map(history.status, history.tasks()), *history.run.statuses.known_pieces().values())
    done = sum(status.uav == uav and status.state == 'COMPLETED' and not status.pieces
               for status in ended)
    silent = sum(gap.until - gap.since for gap in history.gaps if gap.uav == uav)
    battery, lost = state['battery'], history.lost().get(uav)
    return (uav, done, round(history.metres(uav)), round(history.metres_planned(uav)),
            None if battery is None else f'{100.0 * battery:.0f} %', state['mode'].lower(),
            _last_flown(history, [task for task, service in history.run.flown.items()
                                  if service.uav == uav]),
            round(silent * history.run.scale.speedup, 1),
            None if lost is None else round(history.clock(lost.wall), 1), _place(history, uav))


def _last_flown(history: FlightHistory, tasks: Iterable[str]) -> float | None:
    """When the last of these flown tasks was completed, in mission time [s]."""
    ends = [history.clock(history.run.flown[task].end) for task in tasks]
    return round(max(ends), 1) if ends else None


def _place(history: FlightHistory, uav: str) -> str:
    """The last position of a UAV: in degrees, where the origin is known, and height."""
    if not history.tracks[uav]:
        return 'unknown'
    point, origin = history.tracks[uav][-1].point, history.run.origin
    if origin is None:
        return f'{point[0]:.0f} m east, {point[1]:.0f} m north, {point[2]:.0f} m up'
    latitude, longitude, altitude = to_geodetic(origin, point)
    return f'{latitude:.6f}, {longitude:.6f}, {altitude:.0f} m AMSL'


def html_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """A collapsible table; numbers are right-aligned, cells of None empty."""
    body = ''.join(f'<tr>{"".join(map(_html_cell, row))}</tr>\n' for row in rows)
    head = ''.join(f'<th>{escape(text)}</th>' for text in heads)
    return (f'<details open id="{title.lower().replace(" ", "_")}"><summary>{title}</summary>'
            f'<div class="scroll"><table><thead><tr>{head}</tr></thead>'
            f'<tbody>{body}</tbody></table></div></details>\n')


def _html_cell(value: Cell) -> str:
    kind = '' if isinstance(value, str) else ' class="n"'
    return f'<td{kind}>{"" if value is None else escape(str(value))}</td>'
