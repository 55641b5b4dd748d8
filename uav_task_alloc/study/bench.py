# SPDX-License-Identifier: Apache-2.0
"""The bench: solvers and rivals on the same instances in equal CPU time, one judge for all."""
from __future__ import annotations

import argparse
import importlib.util
import json
import math
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from uav_task_alloc.errors import InvalidValue, UnknownName
from uav_task_alloc.solver.registry import SOLVERS
from uav_task_alloc.solver.solve import plan
from uav_task_alloc.study import campaign, executors, public, reference_solvers as rivals
from uav_task_alloc.study.campaign import Job
from uav_task_alloc.study.evaluator import RoutesByUav, judge
from uav_task_alloc.study.gaps import InstanceRuns, gap_table
from uav_task_alloc.study.instances import SLACK, Instance, make_instance


def main(argv: Sequence[str]) -> int:
    """`python -m uav_task_alloc bench`: table, JSON, plot; returns the exit status."""
    asked = _parser().parse_args(argv)
    if asked.plot and importlib.util.find_spec('matplotlib') is None:
        raise SystemExit("--plot: no matplotlib: expected pip install '.[plot]'")
    names = _names(asked)
    jobs = {(key, name): Job(f'{key}-{name}', measure, {
        'source': source, 'name': name, 'budgets': asked.budgets},
        sum(asked.budgets) if name in SOLVERS else max(asked.budgets))
        for (key, source), name in product(_sources(asked), names)}
    with tempfile.TemporaryDirectory() as scratch:
        outcome = campaign.run_campaign(list(jobs.values()), asked.keep or Path(scratch),
                               executors.chosen(asked), _say, time.monotonic)
    runs = _gathered(jobs, outcome.results)
    print(gap_table(runs))
    if asked.json:
        asked.json.write_text(json.dumps({key: run.plain() for key, run in runs.items()},
                                         indent=1, allow_nan=False) + '\n')
    if asked.plot:
        from uav_task_alloc.study.gap_plot import draw_gaps  # needs matplotlib
        draw_gaps(runs, asked.plot)
    return int(bool(outcome.failed))


def _gathered(jobs: Mapping[tuple[str, str], Job],
              results: Mapping[str, Any]) -> dict[str, InstanceRuns]:
    """Results by instance; faults that the judge found are told of."""
    runs: dict[str, InstanceRuns] = {}
    for (key, name), job in jobs.items():
        result = results.get(job.name)
        if result is None:
            continue
        run = runs.setdefault(
            key, InstanceRuns(result['group'], result['collects'], result['known'])
        )
        run.found[name] = result['found']
        for each in result['found']:
            for fault in each['faults']:
                _say(f'{key}, {name} in {each["budget"]:g} s, not counted: {fault}')
    return runs


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='python -m uav_task_alloc bench', description=__doc__)
    add = parser.add_argument
    add('--sizes', default='4x20,8x50,8x100,20x200', help='UAVs x tasks, ... (%(default)s)')
    add('--kinds', default='spread,base', help='spread: starts anywhere; base: one start')
    add('--seeds', type=int, default=5, help='instances a size (%(default)s)')
    add('--first', type=int, default=1, help='seed of the first instance (%(default)s)')
    add('--slack', type=float, default=SLACK, help='ranges over a fair share of a good tour')
    add('--folder', type=Path, metavar='DIR', help='public instances instead: team orienteering '
        f'(Chao, MSTOP), MDVRP (Cordeau); best values, if any, in {public.TABLE}')
    add('--match', default='*', metavar='GLOB', help='which files of the folder')
    add('--budgets', type=_numbers, default=(0.1, 1.0), help='[s] of CPU time, ... (0.1,1)')
    add('--solvers', default='chain_q', help=f'of {", ".join(SOLVERS)}')
    add(
        '--against',
        default=','.join(rivals.REFERENCE_SOLVERS),
        help='rivals (%(default)s), or none',
    )
    add('--keep', type=Path, metavar='DIR', help='keep results; what it holds is not run again')
    add('--json', type=Path, metavar='OUT.json', help='all lengths, values and gaps')
    add('--plot', type=Path, metavar='OUT.png', help='gap over time (.png, .svg)')
    executors.add_arguments(parser, jobs=1)
    return parser


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(sorted(float(each) for each in text.split(',')))


def _names(asked: argparse.Namespace) -> list[str]:
    """Solvers and the rivals that are here. Raises UnknownName."""
    ours, wanted = asked.solvers.split(','), asked.against.split(',')
    wanted = [] if wanted == ['none'] else wanted
    for kind, names, known in (
        ('solver', ours, SOLVERS),
        ('rival', wanted, rivals.REFERENCE_SOLVERS),
    ):
        for name in names:
            if name not in known:
                raise UnknownName(kind, name, list(known))
    missing = sorted(set(wanted) - set(rivals.installed()))
    if missing:
        _say(f'not installed, so left out: {", ".join(missing)} '
             '(pip install -r benchmarks/requirements.txt)')
    return [*ours, *(name for name in wanted if name not in missing)]


def _sources(asked: argparse.Namespace) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name of each instance, and what a worker makes it from. Raises InvalidValue."""
    if not asked.folder:
        for kind, size, seed in product(asked.kinds.split(','), asked.sizes.split(','),
                                        range(asked.first, asked.first + asked.seeds)):
            uavs, tasks = (int(each) for each in size.split('x'))
            made = {'uavs': uavs, 'tasks': tasks, 'seed': seed, 'one_base': kind == 'base',
                    'slack': asked.slack}
            yield make_instance(**made).name, made
        return
    texts, left = public.read_folder(asked.folder, asked.match)
    for name, why in left.items():
        _say(f'{name} left out: {why}')
    if not texts:
        raise InvalidValue('--folder', str(asked.folder), f'instances named {asked.match}')
    known = public.best_known(asked.folder)
    for name, text in texts.items():
        best = {'known': known[name]} if name in known else {}
        yield name, {'name': name, 'text': text, **best}


def measure(source: Mapping[str, Any], name: str, budgets: Sequence[float]) -> dict[str, Any]:
    """One solver or rival on one instance: what it has after each budget [s] of CPU time.

    Ours plan anew for each budget; a rival is asked once, for the longest.
    """
    instance = public.parse_instance(**source) if 'text' in source else make_instance(**source)
    group = source['name'].split('.')[0].split('_')[0] if 'text' in source else (
        instance.name.rpartition('-')[0])
    if name in SOLVERS:
        answers: list[RoutesByUav | None] = [_ours(instance, name, budget) for budget in budgets]
    else:
        found = rivals.REFERENCE_SOLVERS[name](instance, max(budgets))
        answers = [rivals.at(found, budget) for budget in budgets]
    return {'group': group, 'collects': instance.collects,
            'known': instance.known if math.isfinite(instance.known) else None,
            'found': [{'budget': budget} | _judged(instance, routes)
                      for budget, routes in zip(budgets, answers, strict=True)]}


def _ours(instance: Instance, solver: str, budget: float) -> RoutesByUav:
    made = plan(instance.uavs, instance.tasks, solver=solver, budget=budget,
                route_end=instance.route_end, clock=time.thread_time)
    return made.routes


def _judged(instance: Instance, routes: RoutesByUav | None) -> dict[str, Any]:
    """`score`: value where that counts, else length [m]; None where there is no answer."""
    if routes is None:
        return {'score': None, 'missing': len(instance.tasks), 'faults': []}
    found = judge(instance, routes)
    score = found.value if instance.collects else found.length
    return {'score': score if found.counts(instance.collects) else None,
            'length': found.length, 'value': found.value, 'missing': found.missing,
            'faults': list(found.faults)}


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
