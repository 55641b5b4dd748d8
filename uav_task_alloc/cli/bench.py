# SPDX-License-Identifier: Apache-2.0
"""The command `bench`: solvers and reference solvers on the same instances in equal CPU time."""
from __future__ import annotations

import argparse
import importlib.util
import json
import tempfile
import time
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from uav_task_alloc.cli.progress import log_line
from uav_task_alloc.errors import UnknownName
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
        AllocError: an option is invalid.
        SystemExit: a plot is requested and matplotlib is not installed.
    """
    args = _make_parser().parse_args(argv)
    if args.plot and importlib.util.find_spec('matplotlib') is None:
        raise SystemExit("--plot: no matplotlib: expected pip install '.[plot]'")
    jobs = _jobs(args)
    with tempfile.TemporaryDirectory() as scratch:
        outcome = campaign.run_campaign(list(jobs.values()), args.keep or Path(scratch),
                                        executors.chosen(args), log_line, time.monotonic)
    runs = instance_runs(jobs, outcome.results)
    for text in faults(runs):
        log_line(text)
    print(gap_table(runs))
    if args.json:
        args.json.write_text(json.dumps({key: run.plain() for key, run in runs.items()},
                                        indent=1, allow_nan=False) + '\n')
    if args.plot:
        from uav_task_alloc.study.gap_plot import draw_gaps  # imports matplotlib
        draw_gaps(runs, args.plot)
    return int(bool(outcome.failed))


def _make_parser() -> argparse.ArgumentParser:
    """The arguments of `bench`."""
    parser = argparse.ArgumentParser(prog='python -m uav_task_alloc bench', description=__doc__)
    add = parser.add_argument
    add('--sizes', default='4x20,8x50,8x100,20x200', help='UAVs x tasks, ... (%(default)s)')
    add('--kinds', default='spread,base', help='spread: starts anywhere; base: one start')
    add('--seeds', type=int, default=5, help='instances a size (%(default)s)')
    add('--first', type=int, default=1, help='seed of the first instance (%(default)s)')
    add('--slack', type=float, default=SLACK, help='ranges over a fair share of a good tour')
    add('--folder', type=Path, metavar='DIR', help='public instances instead: team orienteering '
        '(Chao, MSTOP), MDVRP (Cordeau); best known values, if any, in '
        f'{public.BEST_KNOWN_FILE}')
    add('--match', default='*', metavar='GLOB', help='which files of the folder')
    add('--budgets', type=_budgets, default=(0.1, 1.0), help='[s] of CPU time, ... (0.1,1)')
    add('--solvers', default='chain_q', help=f'of {", ".join(SOLVERS)}')
    add('--against', default=','.join(reference_solvers.REFERENCE_SOLVERS),
        help='reference solvers (%(default)s), or none')
    add('--keep', type=Path, metavar='DIR',
        help='keep results; a run whose result is in DIR is not repeated')
    add('--json', type=Path, metavar='OUT.json', help='all lengths, values and gaps')
    add('--plot', type=Path, metavar='OUT.png', help='gap over time (.png, .svg)')
    executors.add_arguments(parser, jobs=1)
    return parser


def _budgets(text: str) -> tuple[float, ...]:
    return tuple(sorted(float(part) for part in text.split(',')))


def _jobs(args: argparse.Namespace) -> dict[tuple[str, str], Job]:
    """One job for each instance and solver, by their names."""
    sources = dict(_sources(args))
    return {(key, solver): Job(f'{key}-{solver}', measure, {
        'source': source, 'name': solver, 'budgets': args.budgets},
        sum(args.budgets) if solver in SOLVERS else max(args.budgets))
        for (key, source), solver in product(sources.items(), _solver_names(args))}


def _solver_names(args: argparse.Namespace) -> list[str]:
    """The solvers, and the reference solvers that are installed. Raises UnknownName."""
    solvers, references = args.solvers.split(','), args.against.split(',')
    references = [] if references == ['none'] else references
    for kind, names, known in (
            ('solver', solvers, SOLVERS),
            ('reference solver', references, reference_solvers.REFERENCE_SOLVERS)):
        for name in names:
            if name not in known:
                raise UnknownName(kind, name, list(known))
    missing = sorted(set(references) - set(reference_solvers.installed()))
    if missing:
        log_line(f'not installed, so left out: {", ".join(missing)} '
                 '(pip install -r benchmarks/requirements.txt)')
    return [*solvers, *(name for name in references if name not in missing)]


def _sources(args: argparse.Namespace) -> Mapping[str, dict[str, Any]]:
    """What a job makes each instance from, by the instance's name. Raises InvalidValue."""
    if not args.folder:
        return random_sources(args.kinds.split(','), args.sizes.split(','),
                              range(args.first, args.first + args.seeds), args.slack)
    sources, skipped = public_sources(args.folder, args.match)
    for name, reason in skipped.items():
        log_line(f'{name} left out: {reason}')
    return sources
