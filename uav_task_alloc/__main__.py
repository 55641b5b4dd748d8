# SPDX-License-Identifier: Apache-2.0
"""The command line: `python -m uav_task_alloc COMMAND`; needs no ROS."""
from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from uav_task_alloc import params
from uav_task_alloc.allocator.state import task_state_machine as life
from uav_task_alloc.errors import AllocError
from uav_task_alloc.scenario.document import markdown_text


def plan_command(argv: Sequence[str]) -> int:
    """plan the tasks of a scenario file"""
    from uav_task_alloc.cli.plan import main as run
    return run(argv)


def study_command(argv: Sequence[str]) -> int:
    """make the paper's figures and tables anew, or run an experiment"""
    from uav_task_alloc.cli.study import main as run
    return run(list(argv))


def bench_command(argv: Sequence[str]) -> int:
    """measure the solvers"""
    from uav_task_alloc.study.bench import main as run
    return run(list(argv))


def report_command(argv: Sequence[str]) -> int:
    """print the table of a recorded run and draw its map again"""
    from uav_task_alloc.cli.report import main as run
    return run(argv)


def params_command(argv: Sequence[str]) -> int:
    """print the tables of parameters and scenario keys; --write: into config/ and docs/"""
    if list(argv) not in ([], ['--write']):
        raise SystemExit('usage: python -m uav_task_alloc params [--write]')
    files = {Path('docs/parameters.md'): params.markdown_text(),
             Path('docs/scenarios.md'): markdown_text(),
             Path('docs/task_states.md'): life.markdown_text()}
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
    from uav_task_alloc.allocator.replanning.warm_up import warm_up
    from uav_task_alloc.solver.solve import plan
    warm_up(plan, params.AllocatorParams())
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
    except KeyboardInterrupt:
        return 130  # what a shell expects after Ctrl-C


if __name__ == '__main__':
    sys.exit(main())
