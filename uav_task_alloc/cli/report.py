# SPDX-License-Identifier: Apache-2.0
"""The figures of a recorded run: what was said is held against where the vehicles really were."""
from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from uav_task_alloc.record import ground_truth as truth, run_state as heard
from uav_task_alloc.record.ground_truth import Truth
from uav_task_alloc.record.run_state import RunState

Summary = dict[str, Any]
EXPLAINED = ('UNASSIGNED', 'REJECTED')


def summarise(out_dir: str | Path) -> Summary:
    """The figures of the run that was recorded into a folder; OSError when there is none."""
    out = Path(out_dir)
    return figures(heard.read_record(out), truth.read_truth(out))


def figures(said: RunState, flown: Truth) -> Summary:
    """The figures of a run; a task that was only said to be completed is lost."""
    visits = truth.visits(flown, {name: task.position for name, task in said.tasks.items()})
    fates = {name: fate(name, said, bool(visits[name])) for name in said.tasks}
    names = {kind: sorted(name for name, its in fates.items() if its == kind)
             for kind in ('completed', 'unassigned', 'cancelled', 'lost')}
    twice = sorted(name for name, reached in visits.items() if len(reached) > 1)
    entries = truth.entries(flown, said.zones)
    times = [solve.milliseconds for solve in said.solves[1:]]  # the first is no re-solve
    return {
        'tasks_announced': len(said.tasks),
        'tasks_completed': len(names['completed']),
        'tasks_unassigned': len(names['unassigned']),
        'tasks_cancelled': len(names['cancelled']),
        'tasks_lost': len(names['lost']),
        'tasks_flown_twice': len(twice),
        'zone_violations': len(entries),
        'replans': len(times),
        'resolve_ms_median': percentile(times, 50.0),
        'resolve_ms_p99': percentile(times, 99.0),
        'uploads': said.uploads,
        'metres_flown': round(flown.metres(), 1),
        'metres_planned': round(planned(said, names['completed']), 1),
        'uavs_lost': len(flown.died),
        'wall_s': round(max(0.0, said.last - said.first), 1) if said.solves else 0.0,
        'unassigned': {name: said.statuses[name].reason for name in names['unassigned']},
        'lost': {name: why_lost(name, said) for name in names['lost']},
        'flown_twice': twice,
        'entries': [f'{entry.uav} into {entry.zone} at '
                    f'({", ".join(f"{v:.1f}" for v in entry.point)})' for entry in entries],
    }


def fate(name: str, said: RunState, reached: bool) -> str:
    """completed, unassigned, cancelled or lost."""
    status = said.statuses.get(name)
    if status is not None and status.state == 'COMPLETED' and reached:
        return 'completed'
    if status is not None and status.state in EXPLAINED and status.reason:
        return 'unassigned'
    if name in said.cancelled:
        return 'cancelled'
    return 'lost'


def why_lost(name: str, said: RunState) -> str:
    """What is known of a lost task."""
    status = said.statuses.get(name)
    if status is None:
        return 'no status'
    if status.state == 'COMPLETED':
        return 'said to be completed, but no vehicle was there'
    return f'last seen {status.state}' + f': {status.reason}' * bool(status.reason)


def planned(said: RunState, completed: Sequence[str]) -> float:
    """Metres of the legs to completed tasks and home, as planned when each became the next."""
    legs = [said.legs.get((said.statuses[name].uav, name), 0.0) for name in completed]
    home = [line['distance'] or 0.0 for line in said.lists.values() if not line['tasks']]
    return math.fsum(legs) + math.fsum(home)


def percentile(values: Sequence[float], share: float) -> float:
    """A percentile to 0.1; 0 of nothing."""
    return round(float(np.percentile(values, share)), 1) if values else 0.0


def summary_table(summary: Mapping[str, Any]) -> str:
    """The figures as lines for a person."""
    of = summary.__getitem__
    more = 100.0 * (of('metres_flown') / of('metres_planned') - 1.0) if of('metres_planned') else 0
    rows = [
        ('tasks announced', of('tasks_announced'), ''),
        ('  completed', of('tasks_completed'), ''),
        ('  unassigned', of('tasks_unassigned'), _named(of('unassigned'))),
        ('  cancelled', summary.get('tasks_cancelled', 0), ''),
        ('  lost', of('tasks_lost'), _named(of('lost'))),
        ('  flown twice', of('tasks_flown_twice'), ', '.join(of('flown_twice'))),
        ('zone violations', of('zone_violations'), '; '.join(of('entries'))),
        ('metres flown', f'{of("metres_flown"):.0f}',
         f'planned {of("metres_planned"):.0f} ({more:+.1f} %)'),
        ('re-plans', of('replans'), ''),
        ('re-solve time', f'{of("resolve_ms_median"):.0f} ms',
         f'p99 {of("resolve_ms_p99"):.0f} ms'),
        ('uploads', of('uploads'), ''),
        ('UAVs lost', of('uavs_lost'), ''),
        ('wall time', f'{of("wall_s"):.1f} s', ''),
    ]
    rule = '-' * 60
    lines = [f'{name:<18}{value!s:>10}  {note}'.rstrip() for name, value, note in rows]
    return '\n'.join([rule, *lines, rule])


def _named(reasons: Mapping[str, str]) -> str:
    return '; '.join(f'{name}: {reason}' for name, reason in reasons.items())


def flight_page(bag: Path, html: Path) -> int:
    """Write the page of a flight and say so."""
    try:
        from uav_task_alloc.flight_report import page  # plotly and mcap are wanted here only
    except ModuleNotFoundError as error:
        raise SystemExit(f'report: {error}: expected plotly, mcap and mcap-ros2-support') from None
    try:
        story, trouble = page.write_report(bag, html)
    except OSError as error:
        raise SystemExit(f'{error.filename}: {error.strerror}: expected a recorded run') from None
    for name, value in page.key_figures(story):
        print(f'{name:<45}{"" if value is None else value!s:>12}')
    for text in trouble:
        print(f'Warning: {text}', file=sys.stderr)
    print(f'Report: {html}')
    return 0


def main(argv: Sequence[str]) -> int:
    """`report FILE.mcap`: a page of the flight. `report OUT_DIR | SUMMARY.json`: table and map."""
    parser = argparse.ArgumentParser(
        prog='python -m uav_task_alloc report',
        description='Draw a flight recorded as MCAP as one HTML file; or print the table of the '
                    'folder of a demo again, and draw its map again.')
    parser.add_argument('place', type=Path, metavar='FILE.mcap | OUT_DIR | SUMMARY.json')
    parser.add_argument('--html', type=Path, metavar='OUT.html',
                        help='where the page goes (FILE.html)')
    args = parser.parse_args(argv)
    place = args.place
    if not place.is_dir() and place.suffix != '.json':
        return flight_page(place, args.html or Path(
            f'{str(place).removesuffix(".mcap")}.html'))
    out = place if place.is_dir() else place.parent
    try:
        summary = summarise(out) if place.is_dir() else json.loads(place.read_text())
        print(summary_table(summary))
        from uav_task_alloc.plots import draw_flight  # matplotlib is wanted here only
        draw_flight(out, out / 'map.png')
    except OSError as error:
        raise SystemExit(f'{error.filename}: {error.strerror}: expected a recorded run') from None
    print(f'Map: {out / "map.png"}')
    return 0
