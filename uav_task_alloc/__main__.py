# SPDX-License-Identifier: Apache-2.0
"""The command line: `python -m uav_task_alloc COMMAND`; needs no ROS."""
from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from uav_task_alloc import params, scenario
from uav_task_alloc.errors import AllocError, InvalidValue
from uav_task_alloc.model import Plan
from uav_task_alloc.scenario.document import markdown_text

PICTURES = ('.png', '.pdf', '.svg')


def plan_command(argv: Sequence[str]) -> int:
    """plan the tasks of a scenario file"""
    args = plan_parser().parse_args(argv)
    draw = plotter(args.plot) if args.plot else None
    read = scenario.load(args.scenario)
    cancelled = {cancel.task for cancel in read.cancels}
    tasks = [timed.task for timed in read.tasks if timed.task.id not in cancelled]
    uavs = [uav.uav for uav in read.uavs]
    zones = [timed.zone for timed in read.zones]
    from uav_task_alloc.solver.solve import plan  # compiles: only where something is solved
    made = plan(uavs, tasks, zones, budget=args.budget, solver=args.solver,
                seed=read.seed if args.seed is None else args.seed,
                route_end=args.route_end or read.route_end)
    print(plan_text(made))
    if args.json:
        args.json.write_text(json.dumps(plan_json(made), indent=2, allow_nan=False) + '\n')
    if draw:
        draw(uavs, tasks, zones, made, args.plot)
    return 0


def plan_parser() -> argparse.ArgumentParser:
    """The arguments of `plan`."""
    parser = argparse.ArgumentParser(
        prog='python -m uav_task_alloc plan',
        description='Plan all tasks of a scenario file around all its zones, as if everything '
                    'in it were known from the start; cancelled tasks are left out.')
    parser.add_argument('scenario', type=Path, metavar='SCENARIO.yaml')
    parser.add_argument('--solver', default='chain_q', help='one of SOLVERS (%(default)s)')
    parser.add_argument('--budget', type=float, default=1.0, help='[s] of solving (%(default)s)')
    parser.add_argument('--seed', type=int, help="of the solver (the scenario's)")
    parser.add_argument('--route-end', choices=('hold', 'home'),
                        help="what a UAV does after its last task (the scenario's)")
    parser.add_argument('--json', type=Path, metavar='OUT', help='write the plan as JSON')
    parser.add_argument('--plot', type=Path, metavar='OUT.png', help='draw the plan')
    return parser


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
        'fit': finite(made.fit),
        'history': [[seconds, finite(fit)] for seconds, fit in made.history],
        'solver': made.solver, 'solve_time': made.solve_time, 'iterations': made.iterations,
    }


def finite(value: float) -> float | None:
    """JSON knows no infinity."""
    return value if math.isfinite(value) else None


def plotter(path: Path) -> Callable[..., None]:
    """The function that draws a plan; asked for before any time goes into solving."""
    if path.suffix.lower() not in PICTURES:
        raise InvalidValue('--plot', str(path), f'a name that ends with {" or ".join(PICTURES)}')
    try:
        from uav_task_alloc.plots import draw_plan
    except ModuleNotFoundError as error:
        raise SystemExit(f'--plot: {error}: expected matplotlib') from None
    return draw_plan


def study_command(argv: Sequence[str]) -> int:
    """run an experiment of the study"""
    from uav_task_alloc.study import main as run
    return run(list(argv))


def bench_command(argv: Sequence[str]) -> int:
    """measure the solvers"""
    from uav_task_alloc.study.bench import main as run
    return run(list(argv))


def report_command(argv: Sequence[str]) -> int:
    """print the table of a recorded run and draw its map again"""
    from uav_task_alloc.report import main as run
    return run(argv)


def params_command(argv: Sequence[str]) -> int:
    """print the tables of parameters and scenario keys; --write: into config/ and docs/"""
    if list(argv) not in ([], ['--write']):
        raise SystemExit('usage: python -m uav_task_alloc params [--write]')
    files = {Path('docs/parameters.md'): params.markdown_text(),
             Path('docs/scenarios.md'): markdown_text()}
    if not argv:
        print('\n'.join(files.values()))
        return 0
    files |= {Path(f'config/{node}.yaml'): params.yaml_text(node) for node in params.NODES}
    for path, text in files.items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return 0


def compile_command(argv: Sequence[str]) -> int:
    """compile the kernels ahead; they are kept on disk"""
    if argv:
        raise SystemExit('usage: python -m uav_task_alloc compile')
    from uav_task_alloc.allocator.rehearsal import rehearse
    from uav_task_alloc.solver.solve import plan
    rehearse(plan, params.AllocatorParams())
    return 0


COMMANDS: dict[str, Callable[[Sequence[str]], int]] = {
    'plan': plan_command, 'study': study_command, 'bench': bench_command,
    'report': report_command, 'params': params_command, 'compile': compile_command,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; its exit status."""
    parser = argparse.ArgumentParser(
        prog='python -m uav_task_alloc', formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='commands:\n' + '\n'.join(
            f'  {name:8} {command.__doc__}' for name, command in COMMANDS.items()))
    parser.add_argument('command', choices=COMMANDS, metavar='COMMAND')
    parser.add_argument('rest', nargs=argparse.REMAINDER, metavar='...',
                        help="the command's own arguments; -h after it lists them")
    args = parser.parse_args(argv)
    try:
        return COMMANDS[args.command](args.rest)
    except (AllocError, OSError) as error:
        print(error, file=sys.stderr)
        return 1


if __name__ == '__main__':
    sys.exit(main())
