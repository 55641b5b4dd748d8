# SPDX-License-Identifier: Apache-2.0
"""The command `bench`: solvers and reference solvers on the same instances in equal CPU time."""
from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from uav_task_alloc.cli.interrupt import resumable
from uav_task_alloc.cli.options import (
    OptionParser,
    add_executor_options,
    budgets,
    list_of_names,
    sizes,
)
from uav_task_alloc.cli.outputs import (
    FIGURE_SUFFIXES,
    check_file,
    check_folder,
    check_installed,
    writing,
)
from uav_task_alloc.cli.progress import log_line
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.solver.registry import SOLVERS
from uav_task_alloc.study import campaign, executors, public, reference_solvers
from uav_task_alloc.study.bench import (
    faults,
    instance_runs,
    measure,
    public_sources,
    random_sources,
)
from uav_task_alloc.study.campaign import Job
from uav_task_alloc.study.gaps import gap_table
from uav_task_alloc.study.instances import SLACK


def main(argv: Sequence[str]) -> int:
    """Run the benchmark: print the table of gaps, write JSON, draw the plot.

    Returns:
        The exit status: 1 where a run failed.

    Raises:
        AllocError: an option is invalid, a file cannot be written, matplotlib is missing.
    """
    args = _make_parser().parsed(argv)
    if args.plot:
        check_installed('--plot', 'matplotlib')
    check_file('--json', args.json)
    check_file('--plot', args.plot, FIGURE_SUFFIXES, [args.json] if args.json else ())
    check_folder('--keep', args.keep)
    if args.folder and not args.folder.is_dir():
        raise InvalidValue('--folder', str(args.folder), 'a folder that exists')
    jobs = _jobs(args)
    with resumable(), tempfile.TemporaryDirectory() as scratch:
        outcome = campaign.run_campaign(list(jobs.values()), args.keep or Path(scratch),
                                        executors.chosen(args), log_line, time.monotonic)
    runs = instance_runs(jobs, outcome.results)
    for text in faults(runs):
        log_line(text)
    print(gap_table(runs))
    if args.json:
        with writing('--json', args.json) as file:
            file.write_text(json.dumps({key: run.plain() for key, run in runs.items()},
                                       indent=1, allow_nan=False) + '\n')
    if args.plot:
        from uav_task_alloc.study.gap_plot import draw_gaps  # imports matplotlib
        with writing('--plot', args.plot) as file:
            draw_gaps(runs, file)
    return int(bool(outcome.failed))


def _make_parser() -> OptionParser:
    """The arguments of `bench`."""
    references = reference_solvers.REFERENCE_SOLVERS
    parser = OptionParser('bench', 'Compare solvers and reference solvers on the same instances '
                          'in equal CPU time: lengths or values over the best known.')
    add = parser.add_argument
    add('--sizes', type=sizes, default='4x20,8x50,8x100,20x200', metavar='UxT,...',
        help='sizes of random instances, UAVs x tasks (default: %(default)s)')
    add('--kinds', type=list_of_names('spread', 'base'), default='spread,base', metavar='KIND,...',
        help='spread: starts anywhere; base: one start (default: %(default)s)')
    parser.number('--seeds', 1, 10_000, 'instances of each size and kind', default=5, whole=True)
    parser.number('--first', 0, 2**31, 'seed of the first instance', default=1, whole=True)
    parser.number('--slack', 0.01, 1000.0, 'ranges over a fair share of a good tour',
                  default=SLACK)
    add('--folder', type=Path, metavar='DIR', help='public instances instead: team orienteering '
        '(Chao, MSTOP), MDVRP (Cordeau); best known values, if any, in '
        f'{public.BEST_KNOWN_FILE} (default: random instances)')
    add('--match', default='*', metavar='GLOB',
        help='which files of the folder (default: %(default)s)')
    add('--budgets', type=budgets, default='0.1,1', metavar='S,...',
        help='CPU times of a run, each in [0.001, 86400] s (default: %(default)s)')
    add('--solvers', type=list_of_names(*SOLVERS), default='chain_q', metavar='NAME,...',
        help=f'of {", ".join(SOLVERS)} (default: %(default)s)')
    add('--against', type=list_of_names(*references, 'none'), default=','.join(references),
        metavar='NAME,...', help='reference solvers, or none (default: %(default)s)')
    add('--keep', type=Path, metavar='DIR', help='keep the results; a run whose result is in DIR '
        'is not repeated (default: none)')
    add('--json', type=Path, metavar='OUT.json',
        help='write all lengths [m], values and gaps [%%] (default: none)')
    add('--plot', type=Path, metavar='OUT.png',
        help='draw the gap over time (.png, .pdf, .svg) (default: none)')
    add_executor_options(parser, jobs=1)
    return parser


def _jobs(args: argparse.Namespace) -> dict[tuple[str, str], Job]:
    """One job for each instance and solver, by their names."""
    sources = dict(_sources(args))
    return {(key, solver): Job(f'{key}-{solver}', measure, {
        'source': source, 'name': solver, 'budgets': args.budgets},
        sum(args.budgets) if solver in SOLVERS else max(args.budgets))
        for (key, source), solver in product(sources.items(), _solver_names(args))}


def _solver_names(args: argparse.Namespace) -> list[str]:
    """The solvers, and the reference solvers that are installed."""
    references = [name for name in args.against if name != 'none']
    missing = sorted(set(references) - set(reference_solvers.installed()))
    if missing:
        log_line(f'not installed, so left out: {", ".join(missing)} '
                 "(pip install '.[study]' in the folder of uav_task_alloc)")
    return [*args.solvers, *(name for name in references if name not in missing)]


def _sources(args: argparse.Namespace) -> Mapping[str, dict[str, Any]]:
    """What a job makes each instance from, by the instance's name. Raises InvalidValue."""
    if not args.folder:
        return random_sources(args.kinds, args.sizes,
                              range(args.first, args.first + args.seeds), args.slack)
    sources, skipped = public_sources(args.folder, args.match)
    for name, reason in skipped.items():
        log_line(f'{name} left out: {reason}')
    return sources
