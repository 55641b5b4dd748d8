# SPDX-License-Identifier: Apache-2.0
"""`python -m uav_task_alloc study`: the paper's figures and tables anew, or one experiment."""
from __future__ import annotations

import argparse
import importlib.util
import json
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from uav_task_alloc.study import campaign, executors, experiments as program, tables
from uav_task_alloc.study.campaign import CampaignOutcome
from uav_task_alloc.study.experiments import Experiments

EXPERIMENTS = {
    'scouts': 'learnt against frozen Q in the constructing bees alone',
    'whole': 'forms of learning in the whole solver, paired, at equal time',
    'warm': 'events in a row: new tasks arrive, UAVs move on',
}
INTERRUPTED = 130  # exit status, as shells have it


def main(argv: Sequence[str]) -> int:
    """The whole study, or the experiment that is named; returns the exit status."""
    if argv and argv[0] in EXPERIMENTS:
        return _experiment(argv[0], argv[1:])
    asked = _parser().parse_args(argv)
    if importlib.util.find_spec('matplotlib') is None:  # better now than when all was run
        raise SystemExit("study: no matplotlib: expected pip install '.[study,plot]'")
    made = program.quick(asked.seed) if asked.quick else Experiments(asked.seed)
    return regenerate(made, asked.out, executors.chosen(asked))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='python -m uav_task_alloc study', description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='experiments (study NAME -h):\n' + '\n'.join(
            f'  {name:8} {text}' for name, text in EXPERIMENTS.items()))
    add = parser.add_argument
    add('--out', type=Path, required=True, metavar='DIR',
        help='figures and tables; what it holds already is not run again')
    add('--quick', action='store_true', help='minutes instead of half an hour')
    add('--seed', type=int, default=1, help='of all instances and solvers (%(default)s)')
    executors.add_arguments(parser, jobs=os.cpu_count() or 1)
    return parser


def regenerate(made: Experiments, out: Path, opened: campaign.Opened) -> int:
    """Run what `out` lacks, then write all that there are results for."""
    jobs = program.jobs(made)
    folder = out / 'jobs'
    try:
        outcome, status = campaign.run_campaign(jobs, folder, opened, _say, time.monotonic), 0
    except KeyboardInterrupt:
        outcome, status = campaign.kept(jobs, folder), INTERRUPTED
        _say(f'interrupted with {len(outcome.results)} of {len(jobs)} results; '
             'the same command goes on from here')
    return write_study(made, outcome, out) or status


def write_study(made: Experiments, outcome: CampaignOutcome, out: Path) -> int:
    """Figures and tables; 1 where something is missing because a job failed."""
    from uav_task_alloc.study import figures  # needs matplotlib
    figures.draw_figures(made, outcome.results, out)
    parts = {'sizes': tables.sizes(made, outcome.results),
             'dynamic': tables.events_table(made, outcome.results)}
    for name, (same, timed) in parts.items():
        tables.write_csv(out / f'table_{name}.csv', same)
        tables.write_csv(out / f'table_{name}_timing.csv', timed)
    (out / 'settings.json').write_text(json.dumps(asdict(made), indent=1) + '\n')
    for which, head in enumerate((_SAME, TIMED)):
        (out / ('tables.md', 'timing.md')[which]).write_text(head + ''.join(
            f'\n## {title}\n\n{tables.markdown(parts[name][which])}\n'
            for name, title in TITLES.items()))
    for name, why in outcome.failed.items():
        _say(f'{name} failed: {why}')
    _say(f'figures and tables: {out}')
    return int(bool(outcome.failed))


TITLES = {'sizes': 'Solvers by size', 'dynamic': 'Random arrivals, warm against cold'}
_SAME = """# The study: tables

Budgets are iterations, so the same seed gives the same tables however fast the machine is; what
took how long is in timing.md. Settings: settings.json. Solvers by size: ranges are soft (eq 2.12),
so every task is assigned, and a metre beyond range costs as much as 100 m of way; gaps are in fit
to the best that any run found. `paper_chain_q` holds no more than 200 tasks. Random arrivals:
ranges are hard, a gap is in length, a task left out counts as 100 %.
"""
TIMED = """# The study: CPU seconds

Measured, so they differ from run to run; the same runs as in tables.md.
"""


def _experiment(name: str, argv: Sequence[str]) -> int:
    from uav_task_alloc.study import learning, warm
    parser = argparse.ArgumentParser(prog=f'python -m uav_task_alloc study {name}',
                                     description=EXPERIMENTS[name])
    parser.add_argument('--budget', type=float, help='[s] of CPU time a run')
    parser.add_argument('--runs', type=int, help='instances')
    parser.add_argument('--size', help='UAVs x tasks')
    asked = vars(parser.parse_args(argv))
    done = {'scouts': learning.scouts, 'whole': learning.whole_solver, 'warm': warm.run_events}[
        name
    ]
    done(**{key: value for key, value in asked.items() if value is not None})
    return 0


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
