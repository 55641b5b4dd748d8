# SPDX-License-Identifier: Apache-2.0
"""A campaign: independent jobs on any executor, each result written to a file at once."""
from __future__ import annotations

import json
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, as_completed
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uav_task_alloc.atomic_files import replace_file

MAX_BROKEN_EXECUTORS = 3  # in a row, without a single result
ExecutorFactory = Callable[[], AbstractContextManager[Executor]]


@dataclass(frozen=True, slots=True)
class Job:
    """A function call whose arguments and result are JSON values."""

    name: str  # also of its file
    work: Callable[..., Any]  # a function of a module, so that other processes can import it
    settings: Mapping[str, Any]  # keyword arguments
    weight: float = 1.0  # expected run time in any unit: only the proportions matter

    def key(self) -> str:
        """Identity of a result: function and arguments; a stored one of another key is stale."""
        return json.dumps([f'{self.work.__module__}.{self.work.__qualname__}',
                           dict(self.settings)], sort_keys=True)


@dataclass(slots=True)
class CampaignOutcome:
    """Results and failures of a campaign, by job name."""

    results: dict[str, Any] = field(default_factory=dict)  # JSON values
    failed: dict[str, str] = field(default_factory=dict)  # reason


def load_results(jobs: Sequence[Job], folder: Path) -> CampaignOutcome:
    """Load the results that earlier runs stored for the same functions and arguments.

    Args:
        jobs: of the campaign.
        folder: in which a run stores its results.

    Returns:
        Without failures; jobs that have no valid result are not in it.
    """
    outcome = CampaignOutcome()
    for job in jobs:
        try:
            stored = json.loads((folder / f'{job.name}.json').read_text())
        except (FileNotFoundError, ValueError):  # never run, or the copy of a file was cut short
            continue
        if isinstance(stored, dict) and stored.get('key') == job.key():
            outcome.results[job.name] = stored['result']
    return outcome


def run_campaign(jobs: Sequence[Job], folder: Path, open_executor: ExecutorFactory,
                 log: Callable[[str], None], clock: Callable[[], float]) -> CampaignOutcome:
    """Run the jobs whose results are not in the folder yet.

    Args:
        jobs: with distinct names.
        folder: of the results, one JSON file each; created where it is missing.
        open_executor: opens an executor; called again for the remaining jobs after one broke
            because a worker process was killed.
        log: takes one line of progress.
        clock: [s], for the estimate of the time left.

    Returns:
        Results and failures. A job that raised is a failure; the next run tries it again.
    """
    folder.mkdir(parents=True, exist_ok=True)
    outcome = load_results(jobs, folder)
    if outcome.results:
        log(f'{len(outcome.results)} of {len(jobs)} results exist already')
    progress = CampaignProgress(jobs, outcome, log, clock)
    attempts = MAX_BROKEN_EXECUTORS
    while remaining := [job for job in jobs if job.name not in progress.finished()]:
        before = len(progress.finished())
        try:
            with open_executor() as executor:
                for job, result, succeeded in _run(executor, remaining):
                    if succeeded:
                        outcome.results[job.name] = _store(folder, job, result)
                    else:
                        outcome.failed[job.name] = f'{type(result).__name__}: {result}'
                    progress.count(job)
        except BrokenExecutor as error:
            attempts = (MAX_BROKEN_EXECUTORS if len(progress.finished()) > before
                        else attempts - 1)
            log(f'{error}; {"continuing with the remaining jobs" if attempts else "given up"}')
            if not attempts:
                rest = [job for job in jobs if job.name not in progress.finished()]
                outcome.failed |= {job.name: str(error) for job in rest}
    return outcome


def _run(executor: Executor, jobs: Sequence[Job]) -> Iterator[tuple[Job, Any, bool]]:
    """Each job, its result or exception, and whether it succeeded; the longest are first."""
    with _sigint_blocked():
        submitted = {executor.submit(job.work, **job.settings): job
                     for job in sorted(jobs, key=lambda job: -job.weight)}
    broken: BaseException | None = None
    for future in as_completed(submitted):
        error = CancelledError('cancelled') if future.cancelled() else future.exception()
        if isinstance(error, (BrokenExecutor, CancelledError)):
            broken = error  # other futures may hold results
        else:
            yield submitted[future], error or future.result(), error is None
    if broken:
        raise BrokenExecutor(str(broken))


@contextmanager
def _sigint_blocked() -> Iterator[None]:
    """Within `with`, Ctrl-C waits; processes that are started inherit that it is blocked.

    They would print a traceback each until they have a handler, or where this process ends
    before it has sent them their task. Other threads of this process may take the signal, for
    which Python calls the handler in the main thread.
    """
    received: list[int] = []
    main = threading.current_thread() is threading.main_thread()
    handler = signal.getsignal(signal.SIGINT)
    if main:
        signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if main:
            signal.signal(signal.SIGINT, handler)
        if received:
            signal.raise_signal(signal.SIGINT)


def _store(folder: Path, job: Job, result: Any) -> Any:
    """Write a result atomically; returns it as a later run will read it."""
    text = json.dumps({'key': job.key(), 'result': result}, indent=1)
    replace_file(folder / f'{job.name}.json', text + '\n')
    return json.loads(text)['result']


@dataclass(slots=True)
class CampaignProgress:
    """Logs how many jobs are finished, and an estimate of the time left."""

    jobs: Sequence[Job]
    outcome: CampaignOutcome
    log: Callable[[str], None]
    clock: Callable[[], float]  # [s]
    started: float = field(init=False)
    done: float = 0.0  # weight of the jobs finished since `started`

    def __post_init__(self) -> None:
        self.started = self.clock()

    def finished(self) -> set[str]:
        """Names of the jobs with a result or a failure."""
        return {*self.outcome.results, *self.outcome.failed}

    def count(self, job: Job) -> None:
        """Log that one more job is finished."""
        finished = self.finished()
        self.done += job.weight
        remaining = sum(each.weight for each in self.jobs if each.name not in finished)
        seconds = (self.clock() - self.started) * remaining / self.done
        error = self.outcome.failed.get(job.name)
        self.log(f'[{len(finished)}/{len(self.jobs)}] {job.name}'
                 f'{f" failed: {error}" if error else ""}; about {seconds:.0f} s left')
