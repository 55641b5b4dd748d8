# SPDX-License-Identifier: Apache-2.0
"""The command `study`: regenerate the paper's figures and tables, or run one experiment."""
from __future__ import annotations

import argparse
import inspect
import json
import os
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from uav_task_alloc.atomic_files import replacing
from uav_task_alloc.cli.interrupt import INTERRUPTED, resumable
from uav_task_alloc.cli.options import OptionParser, add_executor_options, size
from uav_task_alloc.cli.outputs import check_folder, check_installed, naming
from uav_task_alloc.cli.progress import log_line
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.study import campaign, executors, experiments, tables
from uav_task_alloc.study.campaign import CampaignOutcome
from uav_task_alloc.study.experiments import Experiments

EXPERIMENTS = {
    'scouts': 'learnt against frozen Q tables in the scouts alone',
    'whole': 'forms of learning in the whole solver, paired, at equal time',
    'warm': 'a sequence of events: new tasks arrive, UAVs move on',
    'anticipation': 'idle UAVs that wait where tasks will come from, against staying',
}


def main(argv: Sequence[str]) -> int:
    """Run the whole study, or the experiment that the first argument names.

    Returns:
        The exit status: 1 where a job failed, 130 after Ctrl-C.

    Raises:
        AllocError: an option is invalid, a file cannot be written, matplotlib is missing.
    """
    if argv and argv[0] == 'anticipation':
        return _run_anticipation(argv[1:])
    if argv and argv[0] in EXPERIMENTS:
        return _run_experiment(argv[0], argv[1:])
    args = _make_parser().parsed(argv)
    check_installed('study', 'matplotlib')  # checked before hours of computing
    check_folder('--out', args.out)
    settings = experiments.quick(args.seed) if args.quick else Experiments(args.seed)
    return regenerate(settings, args.out, executors.chosen(args))


def _make_parser() -> OptionParser:
    """The arguments of `study` without the name of an experiment."""
    parser = OptionParser(
        'study', "Regenerate the paper's figures and tables.",
        'experiments (uav_task_alloc study NAME -h):\n' + '\n'.join(
            f'  {name:12} {text}' for name, text in EXPERIMENTS.items()))
    add = parser.add_argument
    add('--out', type=Path, required=True, metavar='DIR',
        help='figures and tables; a run whose result is in DIR is not repeated (required)')
    add('--quick', action='store_true',
        help='smaller experiments: minutes of CPU time (default: half an hour)')
    parser.number('--seed', 0, 2**31, 'of all instances and solvers', default=1, whole=True)
    add_executor_options(parser, jobs=os.cpu_count() or 1)
    return parser


def regenerate(settings: Experiments, out: Path, open_executor: campaign.ExecutorFactory) -> int:
    """Run the jobs that have no result in `out`, then write all figures and tables.

    Returns:
        The exit status: 1 where a job failed, 130 after Ctrl-C.
    """
    jobs = experiments.jobs(settings)
    folder = out / 'jobs'
    try:
        with resumable():
            outcome = campaign.run_campaign(jobs, folder, open_executor, log_line, time.monotonic)
        status = 0
    except KeyboardInterrupt:
        outcome, status = campaign.load_results(jobs, folder), INTERRUPTED
        log_line(f'interrupted with {len(outcome.results)} of {len(jobs)} results; '
                 'the same command continues from here')
    with naming('--out', out):
        return write_study(settings, outcome, out) or status


def write_study(settings: Experiments, outcome: CampaignOutcome, out: Path) -> int:
    """Write the figures and tables that have results; returns 1 where a job failed."""
    from uav_task_alloc.study import figures  # imports matplotlib
    figures.draw_figures(settings, outcome.results, out)
    pairs = {'sizes': tables.sizes_table(settings, outcome.results),
             'dynamic': tables.events_table(settings, outcome.results)}
    for name, (quality, timing) in pairs.items():
        tables.write_csv(out / f'table_{name}.csv', quality)
        tables.write_csv(out / f'table_{name}_timing.csv', timing)
    with replacing(out / 'settings.json') as file:
        file.write_text(json.dumps(asdict(settings), indent=1) + '\n')
    for i, (file_name, head) in enumerate((('tables.md', _TABLES_HEAD),
                                           ('timing.md', _TIMING_HEAD))):
        with replacing(out / file_name) as file:
            file.write_text(head + ''.join(
                f'\n## {title}\n\n{tables.markdown(pairs[name][i])}\n'
                for name, title in _TITLES.items()))
    for name, reason in outcome.failed.items():
        log_line(f'{name} failed: {reason}')
    log_line(f'figures and tables: {out}')
    return int(bool(outcome.failed))


_TITLES = {'sizes': 'Solvers by size', 'dynamic': 'Random arrivals, warm against cold'}
_TABLES_HEAD = """# The study: tables

Budgets are iterations, so the same seed gives the same tables on every machine; CPU times are in
timing.md. Settings: settings.json. Solvers by size: ranges are soft (eq 2.12), so every task is
assigned, and a metre beyond range costs as much as 100 m of distance; gaps are in fit to the best
of all runs. `paper_chain_q` solves at most 200 tasks. Random arrivals: ranges are hard, a gap is
in length, a task left out counts as 100 %.
"""
_TIMING_HEAD = """# The study: CPU seconds

Measured, so they differ from run to run; the same runs as in tables.md.
"""


def _run_experiment(name: str, argv: Sequence[str]) -> int:
    from uav_task_alloc.study import learning, warm  # import numba and scipy
    experiment = {'scouts': learning.scouts, 'whole': learning.whole_solver,
                  'warm': warm.run_events}[name]
    own = {key: each.default for key, each in inspect.signature(experiment).parameters.items()}
    parser = OptionParser(f'study {name}', f'Run an experiment: {EXPERIMENTS[name]}.')
    parser.number('--budget', 0.001, 86400.0, 'CPU time of each run', unit='s',
                  default=own['budget'])
    parser.number('--runs', 1, 100_000, 'instances or events', whole=True, default=own['runs'])
    parser.add_argument('--size', type=size, metavar='UxT', default=own['size'],
                        help='UAVs x tasks (default: %(default)s)')
    with resumable():
        experiment(**vars(parser.parsed(argv)))
    return 0


def _run_anticipation(argv: Sequence[str]) -> int:
    """Fly the runs of the study of waiting, print its table and with --json its last line."""
    from uav_task_alloc.study import anticipation, waiting_runs  # import numba and scipy
    parser = OptionParser('study anticipation',
                          f'Run an experiment: {EXPERIMENTS["anticipation"]}.')
    add = parser.add_argument
    uavs, busy = anticipation.REFERENCE
    add('--uavs', type=_whole_numbers(1, 100), metavar='N,N', default=_joined(anticipation.UAVS),
        help='sizes of fleets (default: 4,8,16)')
    add('--busy', type=_whole_numbers(5, 90), metavar='N,N', default=_joined(anticipation.LOADS),
        help='loads: percent of the time in which a UAV has a task (default: 30,50,70)')
    names = tuple(waiting_runs.POLICIES)
    add('--policies', type=_policies(names), metavar='NAME,NAME', default=','.join(names),
        help='beside stay, which is always flown (default: %(default)s)')
    parser.number('--runs', 2, 100_000, 'runs of 2 h for each setting', whole=True, default=40)
    parser.number('--seed', 1, 2**31, 'of the runs', whole=True, default=1)
    add('--json', action='store_true',
        help=f'the last line is one JSON object: {uavs} UAVs, {busy} %% busy (default: the table)')
    add_executor_options(parser, jobs=os.cpu_count() or 1)
    args = parser.parsed(argv)
    for option, value, wanted in (('--uavs', args.uavs, uavs), ('--busy', args.busy, busy)):
        if args.json and wanted not in value:
            raise InvalidValue(option, _joined(value), f'{wanted} in it with --json')
    if args.json and not {'learnt', 'oracle'} <= set(args.policies):
        raise InvalidValue('--policies', ','.join(args.policies),
                           'learnt and oracle in it with --json')
    study = anticipation.Study(args.uavs, args.busy, args.runs, args.seed, args.policies)
    with resumable():
        results = anticipation.run_study(study, executors.chosen(args), log_line)
    print(anticipation.table(results))
    if args.json:
        print(anticipation.reference_line(results))
    return 0


def _joined(numbers: Sequence[int]) -> str:
    return ','.join(map(str, numbers))


def _policies(names: Sequence[str]) -> Callable[[str], tuple[str, ...]]:
    """A reader of names of policies separated by commas; `stay` is the first in any case."""
    def read(text: str) -> tuple[str, ...]:
        wanted = text.split(',')
        if not set(wanted) <= set(names):
            raise argparse.ArgumentTypeError(f'{text!r}: expected of {",".join(names)}')
        return tuple(name for name in names if name in wanted or name == 'stay')
    return read


def _whole_numbers(low: int, high: int) -> Callable[[str], tuple[int, ...]]:
    """A reader of whole numbers separated by commas."""
    def read(text: str) -> tuple[int, ...]:
        parts = text.split(',')
        if not all(re.fullmatch(r'\d{1,9}', part, re.ASCII) and low <= int(part) <= high
                   for part in parts):
            raise argparse.ArgumentTypeError(
                f'{text!r}: expected whole numbers in [{low}, {high}], as {low},{high}')
        return tuple(dict.fromkeys(map(int, parts)))
    return read
