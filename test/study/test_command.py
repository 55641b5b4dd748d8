# SPDX-License-Identifier: Apache-2.0
"""The whole study at a tiny size: all figures and tables, reproducible, also after interrupts."""
import importlib.util
import json
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest

from uav_task_alloc.cli import study as command
from uav_task_alloc.cli.outputs import NotInstalled
from uav_task_alloc.study import experiments, figures, tables, trials
from uav_task_alloc.study.experiments import Experiments
from uav_task_alloc.study.figures import mean_curve

TINY = Experiments(7, (2, 6, 1), 2, (1.0, 5.0), 0.002, ((2, 6), (3, 12)), 1, 0.002, 2, 100)
FIGURES = {f'{name}{end}' for end in ('.svg', '.png') for name in (
    'figure1_coefficient', 'figure2_convergence', 'figure3_allocation_chain_q',
    'figure3_allocation_paper_chain_q')}
QUALITY = ('tables.md', 'table_sizes.csv', 'table_dynamic.csv', 'figure1_coefficient.csv',
        'figure2_iterations.csv', 'figure3_allocation_chain_q.csv', 'settings.json')
TIMING = ('timing.md', 'table_sizes_timing.csv', 'table_dynamic_timing.csv', 'figure2_timing.csv')


@contextmanager
def one_thread():
    with ThreadPoolExecutor(1) as pool:
        yield pool


@contextmanager
def interrupted():
    raise KeyboardInterrupt
    yield


@pytest.fixture(scope='module')
def first(tmp_path_factory):
    out = tmp_path_factory.mktemp('first')
    assert command.regenerate(TINY, out, one_thread) == 0
    return out


@pytest.fixture
def no_3d(monkeypatch):
    """Skip the slow figures in three dimensions."""
    monkeypatch.setattr(figures, 'draw_plan_3d', lambda *_: None)


def test_a_study_leaves_all_figures_and_tables_and_its_settings(first):
    there = {path.name for path in first.iterdir()}
    assert FIGURES | {*QUALITY, *TIMING, 'jobs'} <= there
    assert json.loads((first / 'settings.json').read_text())['seed'] == 7
    assert '<svg' in (first / 'figure1_coefficient.svg').read_text()


def test_a_second_study_of_the_same_seed_has_identical_tables(first, no_3d, tmp_path):
    assert command.regenerate(TINY, tmp_path, one_thread) == 0
    for name in QUALITY:
        assert (tmp_path / name).read_bytes() == (first / name).read_bytes(), name


def test_a_complete_study_is_written_again_without_running(first, no_3d, capsys):
    before = {name: (first / name).read_bytes() for name in (*QUALITY, *TIMING)}
    count = len(experiments.jobs(TINY))
    assert command.regenerate(TINY, first, one_thread) == 0
    assert capsys.readouterr().err.startswith(f'{count} of {count} results exist already\nfigures')
    assert {name: (first / name).read_bytes() for name in before} == before


def test_an_interrupted_study_writes_its_results(first, no_3d, tmp_path, capsys):
    (tmp_path / 'jobs').mkdir()
    for path in (first / 'jobs').glob('coefficient-*-0.json'):
        (tmp_path / 'jobs' / path.name).write_bytes(path.read_bytes())
    assert command.regenerate(TINY, tmp_path, interrupted) == command.INTERRUPTED
    assert 'interrupted with 2 of' in capsys.readouterr().err
    assert (tmp_path / 'figure1_coefficient.svg').exists()
    assert not (tmp_path / 'figure2_convergence.svg').exists()
    assert 'no results yet' in (tmp_path / 'tables.md').read_text()


def test_a_study_without_matplotlib_does_not_begin(tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, 'find_spec', lambda name: None)
    with pytest.raises(NotInstalled, match=r"expected pip install '\.\[plot\]'"):
        command.main(['--out', str(tmp_path / 'out')])
    assert not (tmp_path / 'out').exists()


def test_a_quick_study_has_every_figure_and_the_whole_span_of_sizes():
    quick, full = experiments.quick(3), Experiments(3)
    assert {job.name.split('-')[0] for job in experiments.jobs(quick)} == {
        job.name.split('-')[0] for job in experiments.jobs(full)}
    assert quick.runs == full.runs == 10
    assert (quick.sizes[0], quick.sizes[-1]) == ((4, 20), (100, 1000))
    assert sum(job.weight for job in experiments.jobs(quick)) < 240.0  # [s] on one core


def test_the_paper_s_solver_gets_at_most_the_tasks_that_its_tables_hold():
    keys = {key for key in experiments.size_jobs(Experiments(1)) if key[3] == 'paper_chain_q'}
    assert max(tasks for _, tasks, _, _ in keys) == 200


def test_convergence_falls_and_ends_at_the_fit_of_the_run():
    result = trials.converge({'uavs': 2, 'tasks': 9, 'seed': 1}, 'abc', 3, 40)
    iterations, seconds, fits = zip(*result['steps'], strict=True)
    assert list(iterations) == sorted(iterations)
    assert list(seconds) == sorted(seconds)
    assert list(fits) == sorted(fits, reverse=True)
    assert (fits[-1], iterations[-1] <= result['iterations']) == (result['fit'], True)


def test_a_mean_curve_begins_when_all_runs_have_a_plan():
    runs = [{'steps': [[1, 0.1, 10.0], [4, 0.4, 6.0]], 'iterations': 8, 'seconds': 0.8},
            {'steps': [[2, 0.2, 20.0]], 'iterations': 8, 'seconds': 0.8}]
    curve = dict(mean_curve(runs, 0))
    assert curve == {2: 15.0, 3: 15.0, 4: 13.0, 5: 13.0, 6: 13.0, 7: 13.0, 8: 13.0}


def test_the_time_to_a_target_is_when_a_run_first_is_within_it():
    run = {'steps': [[1, 0.1, 120.0], [5, 0.5, 104.0], [9, 0.9, 100.5]]}
    assert tables.time_to_target(run, 100.0, 5) == (5, 0.5)
    assert tables.time_to_target(run, 100.0, 1) == (9, 0.9)
    assert tables.time_to_target(run, 90.0, 1) == (float('inf'), float('inf'))
