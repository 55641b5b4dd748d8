# SPDX-License-Identifier: Apache-2.0
"""The command `plan`: plan a scenario file; print it, write JSON, figures and mission files."""
from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from itertools import groupby
from pathlib import Path

from uav_task_alloc import scenario
from uav_task_alloc.cli.early_plan import EarlyPlan, counted_kernels
from uav_task_alloc.cli.interrupt import INTERRUPTED
from uav_task_alloc.cli.options import OptionParser, one_of
from uav_task_alloc.cli.outputs import (
    FIGURE_SUFFIXES,
    PLAN_MAP_SUFFIXES,
    check_file,
    check_folder,
    check_installed,
    naming,
    writing,
)
from uav_task_alloc.cli.plan_json import plan_json
from uav_task_alloc.cli.plan_pieces import piece_kinds, short_names, with_pieces
from uav_task_alloc.cli.plan_terrain import CLEARANCE, check_ground, ground_of, plan_over_terrain
from uav_task_alloc.cli.plan_times import has_times, times_text
from uav_task_alloc.cli.progress import SolveProgress, log_line
from uav_task_alloc.errors import InvalidValue, UnknownName, counted, first_of
from uav_task_alloc.model import Plan, ThreatZone
from uav_task_alloc.objective import MAX_TRIPS, OBJECTIVES
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.scenario.values import Scenario

_ITS_OWN = "the scenario's"  # default of an option


def main(argv: Sequence[str]) -> int:
    """Run the command.

    Returns:
        The exit status: 0, or 130 where Ctrl-C ended the solving early.

    Raises:
        AllocError: the scenario or an option is invalid, or a file cannot be written.
    """
    args = _make_parser().parsed(argv)
    check_outputs(args)
    _check_solver(args.solver)
    given = with_options(without_cancelled(scenario.load(args.scenario)), args)
    terrain, clearance = ground_of(given, args.terrain, args.terrain_clearance)
    loaded = with_pieces(given, terrain)
    ground = check_ground(loaded, terrain, clearance) if terrain else []
    with counted_kernels():
        _load_kernels(loaded, args.solver, search=False)
        for text in start_warnings(loaded) + ground:
            log_line(f'Warning: {text}')
        with SolveProgress(args.budget, sys.stderr, time.monotonic) as progress:
            early = EarlyPlan(lambda: _load_kernels(loaded, args.solver),
                              lambda stop: solve_scenario(loaded, args, stop, max_iterations=0),
                              progress)
            first = early.wait()
            result = first or solve_scenario(loaded, args, progress.stop, progress.on_iteration)
    if terrain:
        result = plan_over_terrain(loaded, result, terrain, clearance,
                                   lambda rest: solve_scenario(rest, args, progress.stop))
    with early.ending(INTERRUPTED):
        _answer(loaded, result, args)
        if first:
            log_line('stopped before the search: its kernels were not compiled yet')
        elif progress.interrupted:
            log_line(f'stopped after {result.solve_time:.1f} s of {args.budget:g} s: '
                     'the best plan so far')
    return INTERRUPTED if progress.interrupted else 0


def _answer(loaded: Scenario, result: Plan, args: argparse.Namespace) -> None:
    """Print a plan and write the files."""
    try:
        tasks = [timed.task for timed in loaded.tasks]
        print(plan_text(result, piece_kinds(loaded)), flush=True)
        if args.times or has_times(loaded):
            print(times_text([uav.uav for uav in loaded.uavs], tasks, result), flush=True)
    finally:  # also where nobody reads what is printed
        write_outputs(loaded, result, args)


def _check_solver(name: str) -> None:
    """Refuse a name before anything is compiled for it. Raises UnknownName."""
    from uav_task_alloc.solver.registry import SOLVERS  # imports numba
    if name not in SOLVERS:
        raise UnknownName('solver', name, list(SOLVERS))


def _load_kernels(loaded: Scenario, solver: str, search: bool = True) -> None:
    """Load what a scenario needs, or compile it; not all for a first plan. Raises UnknownName."""
    from uav_task_alloc.solver.solve import load_kernels  # imports numba
    from uav_task_alloc.solver.timed.solve import SOLVER_NAME, load_timed_kernels
    if not has_times(loaded):
        load_kernels(solver, bool(loaded.no_fly_zones()), search)
    elif solver == SOLVER_NAME:  # `plan` refuses others
        load_timed_kernels(bool(loaded.no_fly_zones()), search,
                           any(timed.task.path for timed in loaded.tasks))


def _make_parser() -> OptionParser:
    """The arguments of `plan`."""
    parser = OptionParser(
        'plan', 'Plan all tasks of a scenario file around all its zones, as if everything in it '
        'were known from the start; cancelled tasks are left out. Ctrl-C ends the solving '
        'early: the best plan so far is printed and written, and the exit status is '
        f'{INTERRUPTED}.')
    parser.add_argument('scenario', type=Path, metavar='SCENARIO.yaml',
                        help='fleet, tasks and zones (docs/scenarios.md)')
    parser.add_argument('--solver', default='chain_q', metavar='NAME',
                        help='%(default)s, or a baseline: paper_chain_q, q_learning, '
                             'abc, ga, nearest, auction, cbba (default: %(default)s)')
    parser.number('--budget', 0.0, 86400.0, 'time to solve, after the kernels are loaded',
                  unit='s', default=1.0)
    parser.number('--seed', 0, 2**63 - 1, 'of the random numbers of the solver', whole=True,
                  default_text=_ITS_OWN)
    parser.add_argument('--route-end', type=one_of('hold', 'home'), metavar='{hold,home}',
                        help='what a UAV does after its last task: hold there, or fly home '
                             f'(default: {_ITS_OWN})')
    parser.add_argument('--objective', type=one_of(*OBJECTIVES),
                        metavar=f'{{{",".join(OBJECTIVES)}}}',
                        help=f'what is minimised, docs/times.md (default: {_ITS_OWN})')
    parser.number('--trips', 1, MAX_TRIPS, 'of each UAV at most; with more than one it may visit '
                  'its home between tasks', whole=True, default_text=_ITS_OWN)
    parser.add_argument('--times', action='store_true',
                        help='print when each task is reached (default: only where times, loads, '
                             'trips or the objective count)')
    for name, meaning in (('clearance', 'kept from zones beyond their margins'),
                          ('altitude_min', 'lowest detour, above the origin'),
                          ('altitude_max', 'highest detour, above the origin')):
        spec = next(spec.metadata for spec in fields(AllocatorParams) if spec.name == name)
        parser.number(f'--{name.replace("_", "-")}', spec['low'], spec['high'], meaning,
                      unit='m', default_text=_ITS_OWN)
    parser.add_argument('--terrain', type=Path, metavar='GROUND.tif',
                        help='a GeoTIFF of ground heights (AMSL): legs keep clear of the ground, '
                             'and tasks may have vertical: terrain (default: none)')
    parser.number('--terrain-clearance', 0.0, 10000.0, 'that legs keep from the ground of '
                  '--terrain; tasks that are lower are reached upright', unit='m',
                  default_text=f'{CLEARANCE:g}')
    _add_outputs(parser)
    return parser


def _add_outputs(parser: OptionParser) -> None:
    """The files that `plan` writes."""
    for option, metavar, meaning in (
            ('--json', 'OUT', 'write the plan as JSON, lengths in metres'),
            ('--plot', 'OUT.png', 'draw the plan from above (.png, .pdf, .svg)'),
            ('--plot-3d', 'OUT.png', 'draw the plan in three dimensions (.png, .pdf, .svg)'),
            ('--plot-times', 'OUT.png', 'draw the plan from above and over time (.png, .pdf, '
                                        '.svg)'),
            ('--map', 'OUT.geojson', 'write routes, tasks and zones for maps (.geojson, .kml), or '
                                      'tasks and zones as surveys and fences for QGroundControl '
                                      '(.plan)'),
            ('--missions', 'DIR', 'write a .plan (QGroundControl) and a .waypoints file (Mission '
                                  'Planner, MAVProxy) for each UAV')):
        parser.add_argument(option, type=Path, metavar=metavar, help=f'{meaning} (default: none)')


def check_outputs(args: argparse.Namespace) -> None:
    """Check that all outputs can be made and written. Raises AllocError."""
    used = [args.scenario]
    for option, path, suffixes in (('--json', args.json, ()),
                                   ('--plot', args.plot, FIGURE_SUFFIXES),
                                   ('--plot-3d', args.plot_3d, FIGURE_SUFFIXES),
                                   ('--plot-times', args.plot_times, FIGURE_SUFFIXES),
                                   ('--map', args.map, PLAN_MAP_SUFFIXES)):
        if path is not None and suffixes is FIGURE_SUFFIXES:
            check_installed(option, 'matplotlib')
        check_file(option, path, suffixes, used)
        used += [path] if path and (path.is_file() or not path.exists()) else []
    if args.missions:
        check_installed('--missions', 'pymavlink')
        check_folder('--missions', args.missions)


def without_cancelled(loaded: Scenario) -> Scenario:
    """The scenario without the tasks that it cancels."""
    cancelled = {cancel.task for cancel in loaded.cancels}
    return replace(loaded, tasks=tuple(
        timed for timed in loaded.tasks if timed.task.id not in cancelled))


def with_options(loaded: Scenario, args: argparse.Namespace) -> Scenario:
    """The scenario with the options of the command line applied. Raises InvalidValue."""
    names = ('clearance', 'altitude_min', 'altitude_max')
    given = {name: getattr(args, name) for name in names if getattr(args, name) is not None}
    changed = replace(loaded, seed=loaded.seed if args.seed is None else args.seed,
                      route_end=args.route_end or loaded.route_end,
                      objective=args.objective or loaded.objective or 'distance',
                      trips=loaded.trips if args.trips is None else args.trips, **given)
    low, high = changed.altitude_min, changed.altitude_max
    if low >= high and args.altitude_min is not None:
        raise InvalidValue('--altitude-min', low, f'less than the highest detour, {high:g} m')
    if low >= high:
        raise InvalidValue('--altitude-max', high, f'more than the lowest detour, {low:g} m')
    return changed


def solve_scenario(loaded: Scenario, args: argparse.Namespace, stop: Callable[[], bool],
                   on_iteration: Callable[[int, float], None] | None = None,
                   max_iterations: int | None = None) -> Plan:
    """Plan all tasks of a scenario around all its zones."""
    from uav_task_alloc.solver.solve import plan  # imports numba
    return plan([uav.uav for uav in loaded.uavs], [timed.task for timed in loaded.tasks],
                loaded.no_fly_zones(), budget=args.budget, solver=args.solver,
                seed=loaded.seed, route_end=loaded.route_end,
                objective=loaded.objective or 'distance',
                trips=loaded.trips, clearance=loaded.clearance,
                altitude_min=loaded.altitude_min, altitude_max=loaded.altitude_max,
                separation=loaded.separation if loaded.separation.on else None,
                stop=stop, on_iteration=on_iteration, max_iterations=max_iterations)


def plan_text(result: Plan, kinds: dict[str, str]) -> str:
    """A plan as lines of text: a route for each UAV, unassigned tasks, totals.

    Args:
        result: the plan.
        kinds: as `piece_kinds` returns them.
    """
    lines = [f'{uav}: {result.route(uav).distance:.0f} m  {stops_text(result, uav, kinds)}'
             for uav in result.routes]
    for reason, names in groupby(result.unassigned, lambda name: result.unassigned[name]):
        lines += [f'unassigned {name}: {reason}' for name in short_names(names, kinds)]
    lines += [f'conflict of {each.uavs[0]} and {each.uavs[1]} at {each.time:.0f} s: '
              f'{each.resolution or "NOT RESOLVED"}, {each.detail}' for each in result.conflicts]
    planned = sum(len(tasks) for tasks in result.routes.values())
    lines.append(f'{counted(planned, "task")}{" and pieces" * bool(kinds)} planned, '
                 f'{len(result.unassigned)} unassigned; '
                 f'{result.distance:.0f} m, finish {result.finish:.0f} s, '
                 f'response {result.response:.0f} s, value {result.value:g}, '
                 f'penalty {result.penalty:.0f} m, fit {result.fit:.4g}; '
                 f'{result.solver}, {result.solve_time:.3f} s')
    return '\n'.join(lines)


def stops_text(result: Plan, uav: str, kinds: dict[str, str]) -> str:
    """The tasks of a UAV in order, with the visits of its home between its trips."""
    rows = result.trips_of(uav)
    stops = [name for row in rows for name in (*short_names(row, kinds), '(home)')][:-1]
    return ' -> '.join(stops) or '(no tasks)'


def start_warnings(loaded: Scenario) -> list[str]:
    """A line for each UAV that starts, or whose home is, inside an enlarged zone."""
    from uav_task_alloc.geometry.zones import zones_around  # imports numba
    zones, lines = loaded.no_fly_zones(), []
    for uav in loaded.uavs:
        around = zones_around(uav.position, zones, loaded.clearance)
        if around:
            lines.append(f'{uav.id} starts inside zone {_named(around, loaded.clearance)}: '
                         'its route leaves it first; in a flight it gets no tasks while it is on '
                         'the ground there')
        home = zones_around(uav.home, zones, loaded.clearance)
        if home and uav.home != uav.position:
            lines.append(f'the home of {uav.id} is inside zone {_named(home, loaded.clearance)}: '
                         'no safe way leads home')
    return lines


def _named(zones: Sequence[ThreatZone], clearance: float) -> str:
    """The ids, and what enlarges the zones."""
    names = first_of([zone.id for zone in zones])
    margins = '' if len(zones) > 1 else f'its margin of {zones[0].margin:g} m and '
    return f'{names} (with {margins}the clearance of {clearance:g} m)'


def write_outputs(loaded: Scenario, result: Plan, args: argparse.Namespace) -> None:
    """Write JSON, figures and mission files.

    Raises:
        InvalidValue: a file cannot be written and stays as it was; those before it are written.
    """
    if args.json:
        with writing('--json', args.json) as file:
            file.write_text(
                json.dumps(plan_json(loaded, result), indent=2, allow_nan=False) + '\n')
    for option, path, name in (('--plot', args.plot, 'draw_plan'),
                               ('--plot-3d', args.plot_3d, 'draw_plan_3d'),
                               ('--plot-times', args.plot_times, 'draw_plan_times')):
        if path:
            from uav_task_alloc import plots  # imports matplotlib
            with writing(option, path) as file:
                getattr(plots, name)(
                    [uav.uav for uav in loaded.uavs], [timed.task for timed in loaded.tasks],
                    [timed.zone for timed in loaded.zones], result, file,
                    fence_area=loaded.fence_area)
    if args.map and args.map.suffix.lower() == '.plan':
        from uav_task_alloc.map_files.write_plan import plan_document
        document, notes = plan_document(loaded)
        with writing('--map', args.map) as file:
            file.write_text(json.dumps(document, indent=2, allow_nan=False) + '\n')
        for note in notes:
            log_line(f'Warning: {args.map.name}: {note}')
    elif args.map:
        from uav_task_alloc.map_files.write import plan_shapes, write_map  # imports numba
        with naming('--map', args.map):
            write_map(args.map, loaded.origin, plan_shapes(loaded, result))
    if args.missions:
        with naming('--missions', args.missions):
            print(missions_text(loaded, result, args.missions))


def missions_text(loaded: Scenario, result: Plan, folder: Path) -> str:
    """Write the mission files of a plan; returns a line for each UAV.

    Raises:
        InvalidValue: a UAV makes more than one trip.
        OSError: a file cannot be written.
    """
    for uav in result.routes:
        if len(result.trips_of(uav)) > 1:
            raise InvalidValue(f'--missions: trips of {uav}', len(result.trips_of(uav)),
                               '1: a mission file holds one flight')
    from uav_task_alloc.mavlink.mission.files import file_name, write_missions  # pymavlink
    lines = []
    for mission in write_missions(loaded, result, folder):
        stem = folder / file_name(mission.uav.id)
        line = f'{stem}.plan, .waypoints: {counted(len(mission.items), "item")}'
        if mission.unfenced:
            line += ('; no fence around ' + ', '.join(zone.id for zone in mission.unfenced)
                     + ', which the route or its straight return leg passes over or under')
        if loaded.fence_area and not mission.area:
            line += '; no fence_area, which its straight return leg leaves'
        lines.append(line)
    return '\n'.join(lines)
