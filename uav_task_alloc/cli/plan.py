# SPDX-License-Identifier: Apache-2.0
"""The command `plan`: plan a scenario file; print it, write JSON, figures and mission files."""
from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from uav_task_alloc import scenario
from uav_task_alloc.cli.progress import SolveProgress, log_line
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Plan
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.scenario.values import Scenario

FIGURE_SUFFIXES = ('.png', '.pdf', '.svg')
_INTERRUPTED = 130  # exit status of a shell after Ctrl-C


def main(argv: Sequence[str]) -> int:
    """Run the command.

    Returns:
        The exit status: 0, or 130 where Ctrl-C ended the solving early.

    Raises:
        AllocError: the scenario or an option is invalid.
        OSError: a file cannot be read or written.
    """
    args = _make_parser().parse_args(argv)
    plotters = {path: plotter(option, path) for option, path in (
        ('--plot', args.plot), ('--plot-3d', args.plot_3d)) if path}
    loaded = with_options(without_cancelled(scenario.load(args.scenario)), args)
    from uav_task_alloc.solver.solve import load_kernels  # imports numba
    load_kernels(args.solver, bool(loaded.zones))  # Ctrl-C ends a compilation: no plan yet
    with SolveProgress(args.budget, sys.stderr, time.monotonic) as progress:
        result = solve_scenario(loaded, args, progress)
    print(plan_text(result))
    if args.json:
        args.json.write_text(json.dumps(plan_json(result), indent=2, allow_nan=False) + '\n')
    for path, draw in plotters.items():
        draw([uav.uav for uav in loaded.uavs], [timed.task for timed in loaded.tasks],
             [timed.zone for timed in loaded.zones], result, path)
    if args.missions:
        print(missions_text(loaded, result, args.missions))
    if progress.interrupted:
        log_line(f'stopped after {result.solve_time:.1f} s of {args.budget:g} s: '
                 'the best plan so far')
    return _INTERRUPTED if progress.interrupted else 0


def _make_parser() -> argparse.ArgumentParser:
    """The arguments of `plan`."""
    parser = argparse.ArgumentParser(
        prog='python -m uav_task_alloc plan',
        description='Plan all tasks of a scenario file around all its zones, as if everything '
                    'in it were known from the start; cancelled tasks are left out. Ctrl-C ends '
                    'the solving early: the best plan so far is printed and written, and the exit '
                    f'status is {_INTERRUPTED}.')
    parser.add_argument('scenario', type=Path, metavar='SCENARIO.yaml')
    parser.add_argument('--solver', default='chain_q',
                        help='%(default)s, or a baseline: paper_chain_q, q_learning, '
                             'abc, ga, nearest, auction, cbba')
    parser.add_argument('--budget', type=float, default=1.0, help='[s] of solving (%(default)s)')
    parser.add_argument('--seed', type=int, help="of the solver (the scenario's)")
    parser.add_argument('--route-end', choices=('hold', 'home'),
                        help="what a UAV does after its last task (the scenario's)")
    for option, meaning in (('clearance', 'kept from zones beyond their margins'),
                            ('altitude-min', 'lowest detour, above the origin'),
                            ('altitude-max', 'highest detour, above the origin')):
        parser.add_argument(f'--{option}', type=float, metavar='M',
                            help=f"[m] {meaning} (the scenario's)")
    parser.add_argument('--json', type=Path, metavar='OUT', help='write the plan as JSON')
    parser.add_argument('--plot', type=Path, metavar='OUT.png', help='draw the plan from above')
    parser.add_argument('--plot-3d', type=Path, metavar='OUT.png',
                        help='draw the plan in three dimensions')
    parser.add_argument('--missions', type=Path, metavar='DIR',
                        help='write a .plan (QGroundControl) and a .waypoints file for each UAV')
    return parser


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
                      route_end=args.route_end or loaded.route_end, **given)
    AllocatorParams(**{name: getattr(changed, name) for name in names})  # checks their ranges
    return changed


def solve_scenario(loaded: Scenario, args: argparse.Namespace, progress: SolveProgress) -> Plan:
    """Plan all tasks of a scenario around all its zones."""
    from uav_task_alloc.solver.solve import plan  # imports numba
    return plan([uav.uav for uav in loaded.uavs], [timed.task for timed in loaded.tasks],
                [timed.zone for timed in loaded.zones], budget=args.budget, solver=args.solver,
                seed=loaded.seed, route_end=loaded.route_end, clearance=loaded.clearance,
                altitude_min=loaded.altitude_min, altitude_max=loaded.altitude_max,
                stop=progress.stop, on_iteration=progress.on_iteration)


def plan_text(result: Plan) -> str:
    """A plan as lines of text: a route for each UAV, unassigned tasks, totals."""
    lines = [f'{uav}: {result.route(uav).distance:.0f} m  {" -> ".join(tasks) or "(no tasks)"}'
             for uav, tasks in result.routes.items()]
    lines += [f'unassigned {name}: {reason}' for name, reason in result.unassigned.items()]
    planned = sum(len(tasks) for tasks in result.routes.values())
    lines.append(f'{planned} tasks planned, {len(result.unassigned)} unassigned; '
                 f'{result.distance:.0f} m, value {result.value:g}, '
                 f'penalty {result.penalty:.0f} m, fit {result.fit:.4g}; '
                 f'{result.solver}, {result.solve_time:.3f} s')
    return '\n'.join(lines)


def plan_json(result: Plan) -> dict[str, Any]:
    """A plan as JSON values: lengths in metres, points in ENU, an infinite fit as None."""
    return {
        'routes': {uav: list(tasks) for uav, tasks in result.routes.items()},
        'unassigned': result.unassigned,
        'legs': {uav: [asdict(leg) for leg in legs] for uav, legs in result.legs.items()},
        'distance': result.distance, 'value': result.value, 'penalty': result.penalty,
        'fit': json_number(result.fit),
        'history': [[seconds, json_number(fit)] for seconds, fit in result.history],
        'solver': result.solver, 'solve_time': result.solve_time, 'iterations': result.iterations,
    }


def json_number(value: float) -> float | None:
    """None for NaN and the infinities, which JSON cannot represent."""
    return value if math.isfinite(value) else None


def missions_text(loaded: Scenario, result: Plan, folder: Path) -> str:
    """Write the mission files of a plan; returns a line for each UAV.

    Raises:
        SystemExit: pymavlink is not installed.
        OSError: a file cannot be written.
    """
    try:
        from uav_task_alloc.mavlink.mission.files import file_name, write_missions
    except ModuleNotFoundError as error:
        raise SystemExit(f'--missions: {error}: expected pymavlink') from None
    lines = []
    for mission in write_missions(loaded, result, folder):
        stem = folder / file_name(mission.uav.id)
        line = f'{stem}.plan, .waypoints: {len(mission.items)} items'
        if mission.unfenced:
            line += ('; no fence around ' + ', '.join(zone.id for zone in mission.unfenced)
                     + ', which the route or its straight return leg passes over or under')
        lines.append(line)
    return '\n'.join(lines)


def plotter(option: str, path: Path) -> Callable[..., None]:
    """The function that draws a plan into `path`; called before solving, to fail early.

    Raises:
        InvalidValue: the suffix is none of FIGURE_SUFFIXES.
        SystemExit: matplotlib is not installed.
    """
    if path.suffix.lower() not in FIGURE_SUFFIXES:
        raise InvalidValue(option, str(path),
                           f'a name that ends with {" or ".join(FIGURE_SUFFIXES)}')
    try:
        from uav_task_alloc import plots
    except ModuleNotFoundError as error:
        raise SystemExit(f'{option}: {error}: expected matplotlib') from None
    return plots.draw_plan_3d if option == '--plot-3d' else plots.draw_plan
