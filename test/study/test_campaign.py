# SPDX-License-Identifier: Apache-2.0
"""A campaign loses no result to interrupts or killed workers, on one machine or a cluster."""
import argparse
import itertools
import json
import os
import signal
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.study import executors
from uav_task_alloc.study.campaign import MAX_BROKEN_EXECUTORS, Job, load_results, run_campaign


def square(x):
    return {'x': x, 'square': x * x}


def refuse(x):
    raise ValueError(f'{x} is refused')


def die_once(x, mark):
    """Kill the worker that runs this, the first time."""
    if not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return square(x)


def die(x):
    os.kill(os.getpid(), signal.SIGKILL)


@contextmanager
def threads():
    with ThreadPoolExecutor(1) as pool:
        yield pool


def jobs(count, work=square):
    return [Job(f'{work.__name__}-{i}', work, {'x': i}) for i in range(count)]


def squares(count):
    return {f'square-{i}': {'x': i, 'square': i * i} for i in range(count)}


def no_log(text):
    pass


def test_results_come_back_and_are_kept_as_files(tmp_path):
    outcome = run_campaign(jobs(3), tmp_path, threads, no_log, lambda: 0.0)
    assert outcome.results == squares(3) == load_results(jobs(3), tmp_path).results
    assert sorted(p.name for p in tmp_path.iterdir()) == [f'square-{i}.json' for i in range(3)]


def test_a_second_run_runs_only_the_missing_jobs(tmp_path):
    run_campaign(jobs(2), tmp_path, threads, no_log, lambda: 0.0)
    log = []
    run_campaign(jobs(3), tmp_path, threads, log.append, lambda: 0.0)
    assert log == ['2 of 3 results exist already', '[3/3] square-2; about 0 s left']


def test_a_result_of_other_settings_is_computed_again(tmp_path):
    run_campaign([Job('same', square, {'x': 2})], tmp_path, threads, no_log, lambda: 0.0)
    outcome = run_campaign([Job('same', square, {'x': 3})], tmp_path, threads, no_log, lambda: 0.0)
    assert outcome.results['same']['square'] == 9


def test_a_truncated_result_file_is_computed_again(tmp_path):
    run_campaign(jobs(1), tmp_path, threads, no_log, lambda: 0.0)
    (tmp_path / 'square-0.json').write_text('{"key": ')
    assert run_campaign(jobs(1), tmp_path, threads, no_log, lambda: 0.0).results == squares(1)


def test_the_time_left_is_estimated_by_weight(tmp_path):
    log, clock = [], itertools.count(0, 10)
    work = [Job('long', square, {'x': 1}, weight=3.0), Job('short', square, {'x': 2})]
    run_campaign(work, tmp_path, threads, log.append, lambda: float(next(clock)))
    assert {'[1/2] long; about 3 s left', '[1/2] short; about 30 s left'} & set(log)
    assert len(log) == 2


def test_a_job_that_raises_is_reported_and_tried_again_by_the_next_run(tmp_path):
    outcome = run_campaign(jobs(2) + jobs(1, refuse), tmp_path, threads, no_log, lambda: 0.0)
    assert outcome.results == squares(2)
    assert outcome.failed == {'refuse-0': 'ValueError: 0 is refused'}
    assert 'refuse-0' not in load_results(jobs(1, refuse), tmp_path).results


def test_an_interrupt_keeps_the_finished_results(tmp_path):
    def interrupt(text):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_campaign(jobs(5), tmp_path, threads, interrupt, lambda: 0.0)
    assert len(load_results(jobs(5), tmp_path).results) == 1


def test_a_killed_process_loses_no_result(tmp_path):
    killer = Job('killer', die_once, {'x': 7, 'mark': str(tmp_path / 'mark')}, weight=2.0)
    outcome = run_campaign(
        [*jobs(6), killer], tmp_path / 'kept', lambda: executors.processes(1), no_log, lambda: 0.0
    )
    assert outcome.results == squares(6) | {'killer': square(7)}
    assert not outcome.failed


def test_a_job_that_always_kills_its_process_is_given_up(tmp_path):
    log = []
    outcome = run_campaign(jobs(1, die), tmp_path, lambda: executors.processes(1), log.append,
                  lambda: 0.0)
    assert list(outcome.failed) == ['die-0']
    assert len(log) == MAX_BROKEN_EXECUTORS
    assert log[-1].endswith('given up')


@pytest.fixture
def cluster(monkeypatch):
    """Two workers that can import this file."""
    distributed = pytest.importorskip('distributed')  # here, as its import takes a second
    here = str(Path(__file__).parent)
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join([here, os.environ.get('PYTHONPATH', '')]))
    with distributed.LocalCluster(n_workers=2, processes=True, threads_per_worker=1,
                                  dashboard_address=None) as running:
        yield running


@pytest.mark.filterwarnings('default')  # of the library, when it ends
def test_a_killed_cluster_worker_loses_no_result(tmp_path, cluster):
    killer = Job('killer', die_once, {'x': 7, 'mark': str(tmp_path / 'mark')}, weight=0.5)
    outcome = run_campaign([*jobs(20), killer], tmp_path / 'kept',
                  lambda: executors.dask(cluster.scheduler_address), no_log, lambda: 0.0)
    assert outcome.results == squares(20) | {'killer': square(7)}
    assert (tmp_path / 'mark').exists()
    assert len(list((tmp_path / 'kept').iterdir())) == 21
    stored = json.loads((tmp_path / 'kept' / 'killer.json').read_text())
    assert stored['result'] == square(7)


def test_fewer_than_one_process_is_refused():
    with pytest.raises(InvalidValue, match=r'--jobs = 0: expected an integer in \[1, inf\)'):
        executors.chosen(argparse.Namespace(dask=None, jobs=0))


@pytest.mark.parametrize(('address', 'expected'), [
    ('nonsense', 'tcp://HOST:PORT'), ('tcp://127.0.0.1:1', 'a Dask scheduler that answers')])
def test_a_dask_scheduler_that_is_not_there_is_refused(address, expected, monkeypatch):
    pytest.importorskip('distributed')
    monkeypatch.setattr(executors, '_CONNECT_TIMEOUT', 0.5)
    with pytest.raises(InvalidValue, match=f"--dask = '{address}': expected {expected}"), (
            executors.dask(address)):
        pass
