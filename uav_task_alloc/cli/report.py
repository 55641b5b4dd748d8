# SPDX-License-Identifier: Apache-2.0
"""The command `report`: a page of a recorded flight, or the key figures of a demo and its map."""
from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from uav_task_alloc.cli.options import OptionParser
from uav_task_alloc.cli.outputs import MAP_SUFFIXES, check_file, check_installed, naming, writing
from uav_task_alloc.cli.progress import log_line
from uav_task_alloc.errors import AllocError, InvalidValue, damage
from uav_task_alloc.geometry.fence_area import zones_outside
from uav_task_alloc.map_files.write import flight_shapes, write_map
from uav_task_alloc.record.ground_truth import (
    TRUTH_FILE,
    GroundTruth,
    Reached,
    TrueSample,
    read_run,
    zone_entries,
)
from uav_task_alloc.record.piece_passes import piece_passes, served
from uav_task_alloc.record.record_file import RECORD_FILE, unfinished
from uav_task_alloc.record.reported import FINAL_STATES, ZoneInterval
from uav_task_alloc.record.run_state import RunState

Summary = dict[str, Any]
_LEFT_OUT = ('UNASSIGNED', 'REJECTED')


def summarise(out_dir: str | Path) -> Summary:
    """Return the key figures of a recorded run.

    Args:
        out_dir: folder with record.jsonl and flight.jsonl.

    Returns:
        Values by name: metres, milliseconds, counts and lists of ids.

    Raises:
        OSError: a file cannot be read.
    """
    out = Path(out_dir)
    return run_summary(*read_run(out))


def run_summary(state: RunState, truth: GroundTruth) -> Summary:
    """The key figures of a run; a task counts as completed only if a vehicle was there."""
    reached, passes = served(state, truth), piece_passes(state, truth)
    known = state.statuses.known()
    fates = {name: fate(name, state, bool(reached[name])) for name in state.tasks}
    names = {kind: sorted(name for name, its_fate in fates.items() if its_fate == kind)
             for kind in ('completed', 'unassigned', 'cancelled', 'lost')}
    twice = sorted(name for name, items in {**reached, **passes}.items() if len(items) > 1)
    entries = zone_entries(truth, [*state.zones, *(
        ZoneInterval(zone, -math.inf) for zone in zones_outside(state.fence_area))])
    times = [solve.milliseconds for solve in state.solves[1:]]  # the first plan is no re-plan
    replans = len(state.replans())
    return {
        'tasks_announced': len(state.tasks),
        'tasks_completed': len(names['completed']),
        'tasks_unassigned': len(names['unassigned']),
        'tasks_cancelled': len(names['cancelled']),
        'tasks_lost': len(names['lost']),
        'tasks_flown_twice': len(twice),
        'pieces_completed': len(passes),
        'zone_violations': len(entries),
        **_separation(state, truth),
        'replans': replans,
        'plans_unchanged': len(times) - replans,
        'resolve_ms_median': percentile(times, 50.0),
        'resolve_ms_p99': percentile(times, 99.0),
        'uploads': state.uploads,
        'metres_flown': round(truth.metres(), 1),
        'metres_planned': round(planned_length(state, names['completed']), 1),
        'finish_s': finish(state, reached, names['completed']),
        'uavs_lost': len(truth.died),
        'wall_s': round(max(0.0, state.last - state.first) / state.scale.second, 1)
        if state.solves else 0.0,
        'unassigned': {name: known[name].reason for name in names['unassigned']},
        'lost': {name: why_lost(name, state) for name in names['lost']},
        'flown_twice': twice,
        'entries': [f'{entry.uav} into {entry.zone} at '
                    f'({", ".join(f"{v:.1f}" for v in entry.point)})' for entry in entries],
    }


def _separation(state: RunState, truth: GroundTruth) -> Summary:
    """How near UAVs came in the air by the truth."""
    least = truth.least_distance()
    return {'separation_losses': len(truth.losses),
            'separation_min_m': None if least is None else round(least, 2),
            'losses': [f'{" and ".join(loss.uavs)} at {state.clock(loss.wall):.1f} s: '
                       f'{loss.horizontal:.1f} m apart horizontally, {loss.vertical:.1f} m '
                       'vertically' for loss in truth.losses]}


def finish(state: RunState, reached: Mapping[str, Sequence[Reached]],
           completed: Sequence[str]) -> float:
    """Scenario time [s] at which the last task was completed; 0 where none was."""
    return round(max((state.clock(reached[name][0].wall) for name in completed), default=0.0), 1)


def fate(name: str, state: RunState, reached: bool) -> str:
    """`completed`, `unassigned`, `cancelled` or `lost`; `reached`: a vehicle was at the task."""
    status = state.statuses.last(name)
    if status is not None and status.state == 'COMPLETED' and reached:
        return 'completed'
    if status is not None and status.state in _LEFT_OUT and status.reason:
        return 'unassigned'
    cancelled = name in state.cancelled if status is None else status.state == 'CANCELLED'
    return 'cancelled' if cancelled else 'lost'


def why_lost(name: str, state: RunState) -> str:
    """The last status of a lost task."""
    status = state.statuses.last(name)
    if status is None:
        return 'no status'
    if status.state == 'COMPLETED':
        return 'reported as completed, but no vehicle was there'
    return f'last seen {status.state}' + f': {status.reason}' * bool(status.reason)


def planned_length(state: RunState, completed: Sequence[str]) -> float:
    """Length [m] of the legs to completed tasks and home, as planned when each became next."""
    known = state.statuses.known()
    rows = {**{name: known[name] for name in completed}, **{
        piece: row for piece, row in state.statuses.known_pieces().items()
        if row.state == 'COMPLETED'}}
    legs = [state.lists.legs.get((row.uav, name), 0.0) for name, row in rows.items()]
    return math.fsum(legs) + state.lists.ways_home.total()


def percentile(values: Sequence[float], share: float) -> float:
    """A percentile rounded to 0.1; 0 without values."""
    return round(float(np.percentile(values, share)), 1) if values else 0.0


def summary_table(summary: Mapping[str, Any]) -> str:
    """Return the key figures as a table of text.

    Args:
        summary: as `summarise` returns it.

    Returns:
        Lines of three columns: name, value, remark.
    """
    of = summary.__getitem__
    flown, planned = of('metres_flown'), of('metres_planned')
    unchanged = summary.get('plans_unchanged', 0)
    excess = 100.0 * (flown / planned - 1.0) if planned else 0
    rows = [
        ('tasks announced', of('tasks_announced'), ''),
        ('  completed', of('tasks_completed'), ''),
        ('  unassigned', of('tasks_unassigned'), _with_reasons(of('unassigned'))),
        ('  cancelled', summary.get('tasks_cancelled', 0), ''),
        ('  lost', of('tasks_lost'), _with_reasons(of('lost'))),
        *([('  in pieces', summary['pieces_completed'], 'completed strips, sections and orbits')]
          if summary.get('pieces_completed') else []),
        ('  flown twice', of('tasks_flown_twice'), ', '.join(of('flown_twice'))),
        ('zone violations', of('zone_violations'), '; '.join(of('entries'))),
        ('separation losses', summary.get('separation_losses', 0),
         '; '.join(summary.get('losses', []))),
        ('least distance', _metres(summary.get('separation_min_m')),
         'of two UAVs in the air'),
        ('metres flown', f'{flown:.0f}', f'planned {planned:.0f} ({excess:+.1f} %)'),
        ('finished', f'{summary.get("finish_s", 0.0):.0f} s', 'last task, scenario time'),
        ('re-plans', of('replans'), f'{unchanged} more changed nothing' * bool(unchanged)),
        ('re-solve time', f'{of("resolve_ms_median"):.0f} ms',
         f'p99 {of("resolve_ms_p99"):.0f} ms'),
        ('uploads', of('uploads'), 'begun, repeated ones included'),
        ('UAVs lost', of('uavs_lost'), ''),
        ('wall time', f'{of("wall_s"):.1f} s', ''),
    ]
    rule = '-' * 60
    lines = [f'{name:<18}{value!s:>10}  {note}'.rstrip() for name, value, note in rows]
    return '\n'.join([rule, *lines, rule])


def _metres(length: float | None) -> str:
    return 'unknown' if length is None else f'{length:.1f} m'


def _with_reasons(reasons: Mapping[str, str]) -> str:
    return '; '.join(f'{name}: {reason}' for name, reason in reasons.items())


def flight_page(bag: Path, html: Path, flown: Path | None, namespace: str | None) -> int:
    """Write the report of an MCAP file, and its map, and print its key figures.

    Raises:
        AllocError: the file has no messages of one fleet, the page cannot be written, or a package
            is not installed.
        SystemExit: the file cannot be read.
    """
    with reading():
        bag.open('rb').close()
    check_installed('report', 'plotly', 'mcap', 'mcap_ros2')
    check_file('--html', html, inputs=[bag])
    check_file('--map', flown, MAP_SUFFIXES, [bag, html])
    from uav_task_alloc.flight_report import page  # imports plotly and mcap
    with writing('--html', html) as file:
        history, warnings = page.write_report(bag, file, namespace)
    for name, value in page.key_figures(history):
        print(f'{name:<45}{"" if value is None else value!s:>12}')
    for text in warnings:
        log_line(f'Warning: {text}')
    write_flown(flown, history.run, history.tracks)
    print(f'Report: {html}')
    return 0


def warn_of_ends(out: Path, run: RunState, truth: GroundTruth) -> None:
    """Say where the files of a demo end before the run did."""
    for name in (RECORD_FILE, TRUTH_FILE):
        for text in filter(None, [unfinished(out / name)]):
            log_line(f'Warning: {name} {text}')
    known = run.statuses.known()
    still = sum(name not in known or known[name].state not in FINAL_STATES for name in run.tasks)
    if still:
        log_line(f'Warning: {RECORD_FILE} ends while {still} of {len(run.tasks)} tasks are open')
    end = max((track[-1].wall for track in truth.tracks.values()), default=run.first)
    if run.last - end > run.silent_after:
        log_line(f'Warning: {TRUTH_FILE} ends {run.last - end:.0f} s before {RECORD_FILE}')


def write_flown(path: Path | None, run: RunState,
                tracks: Mapping[str, Sequence[TrueSample]]) -> None:
    """Write the map of a flight, if `--map` is given. Raises InvalidValue where it cannot."""
    if path is None:
        return
    if run.origin is None:
        raise InvalidValue('--map', str(path), 'a recording with fleet_origin: its coordinates '
                           'are not known')
    with naming('--map', path):
        write_map(path, run.origin, flight_shapes(run, tracks))
    print(f'Map: {path}')


@contextmanager
def reading() -> Iterator[None]:
    """Within `with`, a file that cannot be read becomes a SystemExit that says so."""
    try:
        yield
    except OSError as error:
        raise SystemExit(f'{error.filename}: {error.strerror}: expected a recorded run') from None


def demo_table(place: Path, flown: Path | None) -> int:
    """Print the table of the folder or summary of a demo, and draw its map again.

    Raises:
        AllocError: the files are damaged, the map cannot be written, or matplotlib is missing.
        SystemExit: a file cannot be read.
    """
    out = place if place.is_dir() else place.parent
    png = out / 'map.png'
    check_file('--map', flown, MAP_SUFFIXES)
    try:
        with reading():
            summary = summarise(out) if place.is_dir() else json.loads(place.read_text())
            print(summary_table(summary), flush=True)
            run, truth = read_run(out)
        warn_of_ends(out, run, truth)
        write_flown(flown, run, truth.tracks)
        check_installed('report', 'matplotlib')
        check_file('map', png)
        from uav_task_alloc.plots import draw_flight  # imports matplotlib
        with writing('map', png) as file:
            draw_flight(out, file)
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError,
            ValueError) as error:
        if isinstance(error, AllocError):
            raise
        raise InvalidValue('report', str(place), 'a recorded run, undamaged: '
                           f'{damage(error)}') from None
    print(f'Map: {png}')
    return 0


def main(argv: Sequence[str]) -> int:
    """Run `report FILE.mcap`: write the page; `report OUT_DIR | SUMMARY.json`: table and map.

    Returns:
        The exit status 0.

    Raises:
        AllocError: the file is no recording of a fleet, or damaged, or no output can be written.
        SystemExit: there is no recorded run.
    """
    parser = OptionParser(
        'report', 'Draw a flight recorded as MCAP as one HTML file; or print the table of the '
        'folder of a demo again, and draw its map.png again.')
    parser.add_argument('place', type=Path, metavar='FILE.mcap | OUT_DIR | SUMMARY.json',
                        help='a recording, the folder of a demo, or its summary.json')
    parser.add_argument('--html', type=Path, metavar='OUT.html', help='where to write the page of '
                        'a recording (default: FILE.html beside FILE.mcap)')
    parser.add_argument('--map', type=Path, metavar='OUT.geojson', help='write tracks, tasks and '
                        'zones for maps (.geojson, .kml) (default: none)')
    parser.add_argument('--namespace', metavar='NAME', help='of the fleet, where a recording has '
                        'several (default: the only one)')
    args = parser.parsed(argv)
    place = args.place
    if place.is_dir() or place.suffix == '.json':
        for option, value in (('--html', args.html), ('--namespace', args.namespace)):
            if value is not None:
                raise InvalidValue(option, str(value), 'a recording, FILE.mcap, to draw: '
                                   f'{place} is of a demo, whose table is printed')
        return demo_table(place, args.map)
    return flight_page(place, args.html or Path(f'{str(place).removesuffix(".mcap")}.html'),
                       args.map, args.namespace)
