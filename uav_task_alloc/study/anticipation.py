# SPDX-License-Identifier: Apache-2.0
"""Waiting where tasks will come from, against staying: fleets, loads and arrivals, paired runs."""
from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Executor
from dataclasses import dataclass

import numpy as np

from uav_task_alloc.errors import AllocError
from uav_task_alloc.study.arrivals import ARRIVAL_KINDS, DURATION
from uav_task_alloc.study.campaign import ExecutorFactory
from uav_task_alloc.study.learning import confidence
from uav_task_alloc.study.tables import markdown
from uav_task_alloc.study.waiting_runs import POLICIES, SPEED, Setting, arrival_rate, run_pair

UAVS, LOADS = (4, 8, 16), (30, 50, 70)
REFERENCE = 8, 50  # UAVs and load of the last line
_SEEDS = 1_000_000  # runs have seeds from `seed` times this on; ones below it are for tuning
Runs = list[dict[str, dict[str, float]]]


@dataclass(frozen=True, slots=True)
class Study:
    """What is flown."""

    uavs: tuple[int, ...] = UAVS  # sizes of fleets
    loads: tuple[int, ...] = LOADS  # [%] busy
    runs: int = 40  # of each setting
    seed: int = 1  # of the tasks
    policies: tuple[str, ...] = tuple(POLICIES)  # names, the first one is `stay`


def run_study(study: Study, open_executor: ExecutorFactory,
              log: Callable[[str], None]) -> dict[Setting, Runs]:
    """Fly all runs.

    Args:
        study: settings.
        open_executor: opens what runs them.
        log: takes one line of progress for each setting.

    Returns:
        By setting the results of its runs.

    Raises:
        AllocError: a process was killed.
    """
    try:
        with open_executor() as executor:
            return dict(_settings(study, executor, log))
    except BrokenExecutor as error:
        raise AllocError('a process of the study was killed: expected memory for all of them; '
                         f'with fewer --jobs they need less ({error})') from None


def _settings(study: Study, executor: Executor,
              log: Callable[[str], None]) -> Iterator[tuple[Setting, Runs]]:
    seeds = range(study.seed * _SEEDS, study.seed * _SEEDS + study.runs)
    for uavs in study.uavs:
        for load in study.loads:
            settings = [Setting(uavs, load, kind) for kind in ARRIVAL_KINDS]
            rates = list(executor.map(arrival_rate, settings))
            futures = [[executor.submit(run_pair, setting, rate, seed, study.policies)
                        for seed in seeds]
                       for setting, rate in zip(settings, rates, strict=True)]
            for setting, row in zip(settings, futures, strict=True):
                yield setting, [future.result() for future in row]
                log(f'{uavs} UAVs, {load} % busy, {setting.kind}: {len(seeds)} runs')


def reductions(runs: Runs, policy: str) -> list[float]:
    """By how much a policy shortens the mean response time of each run.

    Args:
        runs: of one setting.
        policy: a name of POLICIES.

    Returns:
        [%] of staying; runs without a task are left out.
    """
    return [100.0 * (1.0 - run[policy]['response'] / run['stay']['response'])
            for run in runs if run['stay']['response'] > 0.0]


def flight_added(setting: Setting, runs: Runs, policy: str) -> float:
    """What a policy flies more than staying.

    Args:
        setting: of the runs.
        runs: its results.
        policy: a name of POLICIES.

    Returns:
        [%] of what the fleet could fly at its speed in the time of arrivals.
    """
    more = np.mean([run[policy]['flown'] - run['stay']['flown'] for run in runs])
    return float(100.0 * more / (setting.uavs * SPEED * DURATION))


def oracle_gap(runs: Runs) -> float:
    """By how much `learnt` is longer than the true intensity, for tasks after LATE.

    Args:
        runs: of one setting.

    Returns:
        [%] of the mean response time of the oracle.
    """
    learnt, oracle = (np.mean([run[name]['late'] for run in runs])
                      for name in ('learnt', 'oracle'))
    return float(100.0 * (learnt / oracle - 1.0))


def table(results: Mapping[Setting, Runs]) -> str:
    """All settings as a Markdown table.

    Args:
        results: of `run_study`.

    Returns:
        A row for each setting: the response time of staying, and for each policy the reduction
        with its 95 % interval and, in brackets, the flight added [%]; `late gap` is `oracle_gap`.
    """
    rows = []
    for setting, runs in results.items():
        stay = np.mean([run['stay']['response'] for run in runs])
        row = {'UAVs': setting.uavs, 'busy': f'{setting.busy} %', 'arrivals': setting.kind,
               'stay': f'{stay:.0f} s'}
        for name in runs[0]:
            if name != 'stay':
                mean, half = confidence(reductions(runs, name))
                added = flight_added(setting, runs, name)
                row[name] = f'{mean:.1f} +- {half:.1f} % ({added:+.1f})'
        if {'learnt', 'oracle'} <= runs[0].keys():
            row['late gap'] = f'{oracle_gap(runs):.1f} %'
        rows.append(row)
    return markdown(rows)


def reference_line(results: Mapping[Setting, Runs]) -> str:
    """The figures of the reference setting.

    Args:
        results: with all kinds of arrivals for REFERENCE.

    Returns:
        One line of JSON: by kind of arrivals the reduction of `learnt` [%] with its 95 %
        interval, and the gap to the oracle with hot spots.
    """
    figures: dict[str, object] = {}
    for kind in ARRIVAL_KINDS:
        mean, half = confidence(reductions(results[Setting(*REFERENCE, kind)], 'learnt'))
        figures[kind] = {'reduction_percent': round(mean, 2),
                         'ci95': [round(mean - half, 2), round(mean + half, 2)]}
    figures['oracle_gap_percent'] = round(oracle_gap(results[Setting(*REFERENCE, 'hot')]), 2)
    return json.dumps(figures)
