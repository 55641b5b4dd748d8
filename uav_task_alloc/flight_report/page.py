# SPDX-License-Identifier: Apache-2.0
"""A flight as one HTML file that needs no network: figures that can be zoomed, and tables."""
from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from datetime import datetime, timezone
from html import escape
from pathlib import Path
from statistics import median

from plotly.offline import get_plotlyjs

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.flight_report.figures import all_figures
from uav_task_alloc.flight_report.story import Span, Story, fold
from uav_task_alloc.record.bag_reader import BagReader

# what a task or UAV is called comes from the network: no more may be run than is written here
POLICY = ("default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
          "img-src data: blob:")
STYLE = """body { font: 15px/1.45 sans-serif; margin: 1.5em auto; max-width: 1300px;
  padding: 0 1em; color: #222 }
table { border-collapse: collapse; margin: 0.5em 0 2em }
th, td { border-bottom: 1px solid #ddd; padding: 3px 10px; text-align: left; vertical-align: top }
th { background: #f4f6f8 } td.n { text-align: right; font-variant-numeric: tabular-nums }
.trouble { background: #fff3cd; border-left: 5px solid #e69f00; padding: 0.6em 1em }
details { margin: 1em 0 } summary { cursor: pointer; font-size: 1.3em; font-weight: bold }"""
CONFIG = {'displaylogo': False, 'responsive': True,
          'showSendToCloud': False}  # plotly's bar has a button for that otherwise
Cell = str | float | int | None


def write_report(bag: Path, html: Path) -> tuple[Story, list[str]]:
    """Draw the report of an MCAP file from it alone; the story, and what could not be read.

    Raises OSError where a file cannot be opened, InvalidValue where it tells of no flight.
    """
    reader = BagReader(bag)
    story = fold(reader)
    trouble = [f'{bag.name}: {reader.trouble}; here is what came before'] * bool(reader.trouble)
    trouble += [f'{count} messages of {topic} could not be decoded'
                for topic, count in reader.unread.items()]
    if not story.tasks() and not story.tracks:
        raise InvalidValue('file', str(bag), 'messages of a fleet in it, found '
                           f'{reader.counted.total()} of {len(reader.counted)} topics'
                           + f' ({reader.trouble})' * bool(reader.trouble))
    html.write_text(page(story, bag.name, trouble), encoding='utf-8')
    return story, trouble


def page(story: Story, name: str, trouble: Iterable[str] = ()) -> str:
    """The whole file."""
    figures = ''.join(
        figure.to_html(full_html=False, include_plotlyjs=False, div_id=div, config=CONFIG)
        for div, figure in all_figures(story))
    head = f'Flight of {began(story)}'
    parts = [
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
        f'<title>{escape(head)}</title><style>{STYLE}</style>',
        f'<script>{get_plotlyjs()}</script></head><body><h1>{escape(head)}</h1>',
        *(f'<p class="trouble">{escape(text)}</p>' for text in trouble),
        html_table('Key figures', (f'of {name}', ''), key_figures(story)),
        figures, tables(story), '</body></html>']
    return '\n'.join(parts)


def began(story: Story) -> str:
    """Date and time of the first line."""
    try:
        return datetime.fromtimestamp(story.heard.first, timezone.utc).strftime('%F %T UTC')
    except (OverflowError, ValueError, OSError):
        return 'an unknown day'


def key_figures(story: Story) -> list[tuple[Cell, ...]]:
    """What an operator asks first."""
    counts = Counter(story.status(task).state for task in story.tasks())
    times = [plan.milliseconds for plan in story.replans]
    flown = sum(story.metres(uav) for uav in story.tracks)
    planned = sum(story.metres_planned(uav) for uav in story.tracks)
    return [
        ('tasks', len(story.tasks())),
        *((f'tasks {state.lower()}', count) for state, count in sorted(counts.items())),
        ('UAVs', len(story.tracks)), ('metres flown', round(flown)),
        ('metres planned, of the legs that were begun', round(planned)),
        ('re-plans', max(0, len(times) - 1)),
        ('solve time, median [ms]', round(median(times), 1) if times else None),
        ('solve time, longest [ms]', round(max(times), 1) if times else None),
        ('gaps in what was heard', len(story.gaps)),
        ('recorded [s]', round(story.heard.last - story.heard.first, 1))]


def tables(story: Story) -> str:
    """Everything that is told in words."""
    def at(wall: float) -> float:
        return round(story.clock(wall), 1)

    return ''.join((
        html_table('Tasks', ('task', 'state', 'UAV', 'value', 'announced [s]', 'begun [s]',
                        'ended [s]', 'reason'),
              (_task(story, task) for task in story.tasks())),
        html_table('UAVs', ('UAV', 'tasks completed', 'metres flown', 'metres planned', 'battery',
                       'last mode', 'not heard [s]'),
              (_uav(story, uav) for uav in sorted(story.tracks))),
        html_table('Re-plans', ('at [s]', 'plan', 'because of', 'what changed', 'solved in [ms]',
                           'fit', 'metres'),
              ((at(plan.wall), plan.revision, plan.trigger, plan.changed or 'nothing',
                round(plan.milliseconds, 1), plan.fit and round(plan.fit, 4),
                plan.distance and round(plan.distance)) for plan in story.replans)),
        html_table('Gaps', ('UAV', 'from [s]', 'to [s]', 'wall time [s]'),
              ((gap.uav or 'nobody was heard', at(gap.since), at(gap.until),
                round(gap.until - gap.since, 1)) for gap in story.gaps)),
        html_table('Events', ('at [s]', 'what'),
              ((at(wall), text) for wall, _, text in story.events))))


def _task(story: Story, task: str) -> tuple[Cell, ...]:
    status = story.status(task)
    known = story.heard.tasks.get(task)
    spans = story.spans.get(task, [])

    def first(*states: str) -> Cell:
        found: Span | None = next((span for span in spans if span.state in states), None)
        return None if found is None else round(story.clock(found.since), 1)

    return (task, status.state.lower(), status.uav, story.values.get(task),
            round(story.clock(known.wall), 1) if known else None, first('ACTIVE'),
            first('COMPLETED', 'FAILED', 'CANCELLED', 'REJECTED'), status.reason)


def _uav(story: Story, uav: str) -> tuple[Cell, ...]:
    state = story.heard.uavs[uav]
    done = sum(status.uav == uav and status.state == 'COMPLETED'
               for status in story.heard.statuses.values())
    silent = sum(gap.until - gap.since for gap in story.gaps if gap.uav == uav)
    battery = state['battery']
    return (uav, done, round(story.metres(uav)), round(story.metres_planned(uav)),
            None if battery is None else f'{100.0 * battery:.0f} %', state['mode'].lower(),
            round(silent, 1))


def html_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """A table of a page; numbers to the right, nothing for None."""
    body = ''.join(f'<tr>{"".join(map(_cell, row))}</tr>\n' for row in rows)
    head = ''.join(f'<th>{escape(text)}</th>' for text in heads)
    return (f'<details open id="{title.lower().replace(" ", "_")}"><summary>{title}</summary>'
            f'<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></details>\n')


def _cell(value: Cell) -> str:
    kind = '' if isinstance(value, str) else ' class="n"'
    return f'<td{kind}>{"" if value is None else escape(str(value))}</td>'
