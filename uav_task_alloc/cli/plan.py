# SPDX-License-Identifier: Apache-2.0
"""The command `plan`: a scenario file in; text, JSON, pictures and mission files out."""
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
from uav_task_alloc.cli.progress import SolveProgress
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Plan
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.scenario.values import Scenario

PICTURES = ('.png', '.pdf', '.svg')
_INTERRUPTED = 130  # what a shell expects after Ctrl-C


def main(argv: Sequence[str]) -> int:
    """Run the command; its exit status, 130 where Ctrl-C cut the solving short."""
    args = make_parser().parse_args(argv)
    draw = {path: plotter(option, path) for option, path in (
        ('--plot', args.plot), ('--plot-3d', args.plot_3d)) if path}
    read = with_options(known_from_start(scenario.load(args.scenario)), args)
    with SolveProgress(args.budget, sys.stderr, time.monotonic) as progress:
        made = solve_scenario(read, args, progress)
    print(plan_text(made))
    if args.json:
        args.json.write_text(json.dumps(plan_json(made), indent=2, allow_nan=False) + '\n')
    for path, picture in draw.items():
        picture([uav.uav for uav in read.uavs], [timed.task for timed in read.tasks],
                [timed.zone for timed in read.zones], made, path)
    if args.missions:
        print(missions_text(read, made, args.missions))
    if progress.interrupted:
        print(f'stopped after {made.solve_time:.1f} s of {args.budget:g} s: the best plan so far',
              file=sys.stderr)
    return _INTERRUPTED if progress.interrupted else 0


def make_parser() -> argparse.ArgumentParser:
    """The arguments of `plan`."""
    parser = argparse.ArgumentParser(
        prog='python -m uav_task_alloc plan',
        description='Plan all tasks of a scenario file around all its zones, as if everything '
                    'in it were known from the start; cancelled tasks are left out. Ctrl-C ends '
                    'the solving early: the best plan so far is told and written all the same, '
                    f'with exit status {_INTERRUPTED}.')
    parser.add_argument('scenario', type=Path, metavar='SCENARIO.yaml')
    parser.add_argument('--solver', default='chain_q',
                        help='%(default)s, or one to compare with: paper_chain_q, q_learning, '
                             'abc, ga, nearest, auction, cbba')
    parser.add_argument('--budget', type=float, default=1.0, help='[s] of solving (%(default)s)')
    parser.add_argument('--seed', type=int, help="of the solver (the scenario's)")
    parser.add_argument('--route-end', choices=('hold', 'home'),
                        help="what a UAV does after its last task (the scenario's)")
    for option, what in (('clearance', 'kept from zones beyond their margins'),
                         ('altitude-min', 'lowest detour, above the origin'),
                         ('altitude-max', 'highest detour, above the origin')):
        parser.add_argument(f'--{option}', type=float, metavar='M',
                            help=f"[m] {what} (the scenario's)")
    parser.add_argument('--json', type=Path, metavar='OUT', help='write the plan as JSON')
    parser.add_argument('--plot', type=Path, metavar='OUT.png', help='draw the plan from above')
    parser.add_argument('--plot-3d', type=Path, metavar='OUT.png',
                        help='draw the plan in three dimensions')
    parser.add_argument('--missions', type=Path, metavar='DIR',
                        help='write a .plan (QGroundControl) and a .waypoints file for each UAV')
    return parser


def known_from_start(read: Scenario) -> Scenario:
    """The scenario without the tasks that are cancelled."""
    cancelled = {cancel.task for cancel in read.cancels}
    return replace(read, tasks=tuple(
        timed for timed in read.tasks if timed.task.id not in cancelled))


def with_options(read: Scenario, args: argparse.Namespace) -> Scenario:
    """The scenario with what the command line says; raise InvalidValue for what cannot be."""
    names = ('clearance', 'altitude_min', 'altitude_max')
    given = {name: getattr(args, name) for name in names if getattr(args, name) is not None}
    made = replace(read, seed=read.seed if args.seed is None else args.seed,
                   route_end=args.route_end or read.route_end, **given)
    AllocatorParams(**{name: getattr(made, name) for name in names})  # which checks them
    return made


def solve_scenario(read: Scenario, args: argparse.Namespace, progress: SolveProgress) -> Plan:
    """All tasks around all zones."""
    from uav_task_alloc.solver.solve import plan  # compiles: only where something is solved
    return plan([uav.uav for uav in read.uavs], [timed.task for timed in read.tasks],
                [timed.zone for timed in read.zones], budget=args.budget, solver=args.solver,
                seed=read.seed, route_end=read.route_end, clearance=read.clearance,
                altitude_min=read.altitude_min, altitude_max=read.altitude_max, stop=progress.stop,
                on_iteration=progress.heard)


def plan_text(made: Plan) -> str:
    """A plan for a person."""
    lines = [f'{uav}: {made.route(uav).distance:.0f} m  {" -> ".join(tasks) or "(no tasks)"}'
             for uav, tasks in made.routes.items()]
    lines += [f'unassigned {name}: {reason}' for name, reason in made.unassigned.items()]
    planned = sum(len(tasks) for tasks in made.routes.values())
    lines.append(f'{planned} tasks planned, {len(made.unassigned)} unassigned; '
                 f'{made.distance:.0f} m, value {made.value:g}, penalty {made.penalty:.0f} m, '
                 f'fit {made.fit:.4g}; {made.solver}, {made.solve_time:.3f} s')
    return '\n'.join(lines)


def plan_json(made: Plan) -> dict[str, Any]:
    """A plan for a program; lengths in metres, points ENU."""
    return {
        'routes': {uav: list(tasks) for uav, tasks in made.routes.items()},
        'unassigned': made.unassigned,
        'legs': {uav: [asdict(leg) for leg in legs] for uav, legs in made.legs.items()},
        'distance': made.distance, 'value': made.value, 'penalty': made.penalty,
        'fit': json_number(made.fit),
        'history': [[seconds, json_number(fit)] for seconds, fit in made.history],
        'solver': made.solver, 'solve_time': made.solve_time, 'iterations': made.iterations,
    }


def json_number(value: float) -> float | None:
    """JSON knows no infinity."""
    return value if math.isfinite(value) else None


def missions_text(read: Scenario, made: Plan, folder: Path) -> str:
    """Write the mission files; what a person should know of them."""
    try:
        from uav_task_alloc.mavlink.mission.files import file_name, write_missions
    except ModuleNotFoundError as error:
        raise SystemExit(f'--missions: {error}: expected pymavlink') from None
    lines = []
    for mission in write_missions(read, made, folder):
        place = folder / file_name(mission.uav.id)
        line = f'{place}.plan, .waypoints: {len(mission.items)} items'
        if mission.unfenced:
            line += ('; no fence around ' + ', '.join(zone.id for zone in mission.unfenced)
                     + ', which it or its straight way home passes over or under')
        lines.append(line)
    return '\n'.join(lines)


def plotter(option: str, path: Path) -> Callable[..., None]:
    """The function that draws a plan; asked for before any time goes into solving."""
    if path.suffix.lower() not in PICTURES:
        raise InvalidValue(option, str(path), f'a name that ends with {" or ".join(PICTURES)}')
    try:
        from uav_task_alloc import plots
    except ModuleNotFoundError as error:
        raise SystemExit(f'{option}: {error}: expected matplotlib') from None
    return plots.draw_plan_3d if option == '--plot-3d' else plots.draw_plan
