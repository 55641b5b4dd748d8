# SPDX-License-Identifier: Apache-2.0
"""A campaign: many independent jobs on any executor, each result kept as a file when it comes."""
from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, as_completed
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

LIVES = 3  # executors in a row that may break without a single result
Opened = Callable[[], AbstractContextManager[Executor]]


@dataclass(frozen=True, slots=True)
class Job:
    """A call whose arguments and result are plain data, as JSON knows it."""

    name: str  # of its file, too
    work: Callable[..., Any]  # of a module, so that other processes find it
    settings: Mapping[str, Any]
    weight: float = 1.0  # about how long it takes; only the proportions matter

    def key(self) -> str:
        """What a kept result must have been made from."""
        return json.dumps([f'{self.work.__module__}.{self.work.__qualname__}',
                           dict(self.settings)], sort_keys=True)


@dataclass(slots=True)
class CampaignOutcome:
    """What came of a campaign, by job."""

    results: dict[str, Any] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)  # why


def kept(jobs: Sequence[Job], folder: Path) -> CampaignOutcome:
    """The results that an earlier run left in the folder for the same settings."""
    found = CampaignOutcome()
    for job in jobs:
        try:
            stored = json.loads((folder / f'{job.name}.json').read_text())
        except (FileNotFoundError, ValueError):  # never run, or cut off while copied
            continue
        if isinstance(stored, dict) and stored.get('key') == job.key():
            found.results[job.name] = stored['result']
    return found


def run_campaign(jobs: Sequence[Job], folder: Path, opened: Opened, say: Callable[[str], None],
        clock: Callable[[], float]) -> CampaignOutcome:
    """Do what the folder does not hold yet; `clock` [s] is for the estimate of what is left.

    `opened` opens an executor; one that breaks (a worker was killed) is opened again for what it
    left. A job that raises is told of in the outcome and tried again by the next run.
    """
    folder.mkdir(parents=True, exist_ok=True)
    outcome = kept(jobs, folder)
    if outcome.results:
        say(f'{len(outcome.results)} of {len(jobs)} results were there')
    progress = CampaignProgress(jobs, outcome, say, clock)
    lives = LIVES
    while left := [job for job in jobs if job.name not in progress.told()]:
        before = len(progress.told())
        try:
            with opened() as executor:
                for job, result, well in _done(executor, left):
                    if well:
                        outcome.results[job.name] = _keep(folder, job, result)
                    else:
                        outcome.failed[job.name] = f'{type(result).__name__}: {result}'
                    progress.tell(job)
        except BrokenExecutor as error:
            lives = LIVES if len(progress.told()) > before else lives - 1
            say(f'{error}; {"going on with what is left" if lives else "given up"}')
            if not lives:
                rest = [job for job in jobs if job.name not in progress.told()]
                outcome.failed |= {job.name: str(error) for job in rest}
    return outcome


def _done(executor: Executor, jobs: Sequence[Job]) -> Iterator[tuple[Job, Any, bool]]:
    """Each job, what it returned or raised, and which; the longest begin first."""
    asked = {executor.submit(job.work, **job.settings): job
             for job in sorted(jobs, key=lambda job: -job.weight)}
    broken: BaseException | None = None
    for future in as_completed(asked):
        error = CancelledError('taken back') if future.cancelled() else future.exception()
        if isinstance(error, (BrokenExecutor, CancelledError)):
            broken = error  # others may have come through
        else:
            yield asked[future], error or future.result(), error is None
    if broken:
        raise BrokenExecutor(str(broken))


def _keep(folder: Path, job: Job, result: Any) -> Any:
    """Write a result, whole or not at all; returns it as the next run will read it."""
    text = json.dumps({'key': job.key(), 'result': result}, indent=1)
    path = folder / f'{job.name}.json'
    half = path.with_suffix('.half')
    half.write_text(text + '\n')
    os.replace(half, path)
    return json.loads(text)['result']


@dataclass(slots=True)
class CampaignProgress:
    """Says how far a campaign is, and about how long the rest will take."""

    jobs: Sequence[Job]
    outcome: CampaignOutcome
    say: Callable[[str], None]
    clock: Callable[[], float]  # [s]
    began: float = field(init=False)
    done: float = 0.0  # weight of what was done since it began

    def __post_init__(self) -> None:
        self.began = self.clock()

    def told(self) -> set[str]:
        """The jobs that something came of."""
        return {*self.outcome.results, *self.outcome.failed}

    def tell(self, job: Job) -> None:
        """One more is done."""
        told = self.told()
        self.done += job.weight
        rest = sum(each.weight for each in self.jobs if each.name not in told)
        seconds = (self.clock() - self.began) * rest / self.done
        error = self.outcome.failed.get(job.name)
        self.say(f'[{len(told)}/{len(self.jobs)}] {job.name}'
                 f'{f" failed: {error}" if error else ""}; about {seconds:.0f} s left')
