# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C from the start of a program to its end: one line and status 130, no traceback."""
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from uav_task_alloc import __main__ as cli
from uav_task_alloc.cli.interrupt import prompt_interrupt, resumable

ROOT = Path(__file__).parents[2]
FILE = str(ROOT / 'config/scenarios/plan_only.yaml')
TIMEOUT = 120.0  # [s]


@contextmanager
def start(*arguments, **env):
    """A program in a group of its own that takes SIGINT, as a shell starts it; killed at the end.

    pytest itself may run where SIGINT is ignored, as jobs in the background do.
    """
    with subprocess.Popen(
            [sys.executable, '-m', 'uav_task_alloc', *arguments], cwd=ROOT, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
            env={**os.environ, **env},
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)) as process:
        try:
            yield process
        finally:
            process.kill()


def until(condition, process):
    end = time.monotonic() + TIMEOUT
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.001)


def press_ctrl_c(process):
    """SIGINT to the whole group, as a terminal sends it."""
    os.killpg(process.pid, signal.SIGINT)
    return process.communicate(timeout=TIMEOUT)


@pytest.mark.parametrize('library', ['numpy', 'llvmlite', 'scipy'])
def test_ctrl_c_during_an_import_is_one_line(library):
    with start('plan', FILE, '--budget', '600') as process:
        until(lambda: f'/{library}/' in Path(f'/proc/{process.pid}/maps').read_text(), process)
        out, err = press_ctrl_c(process)
    assert (process.returncode, out, err) == (130, '', 'interrupted\n')


def test_ctrl_c_once_the_program_has_begun_prints_no_traceback():
    with start('plan', FILE, '--budget', '600') as process:
        # its thread for signals is there
        until(lambda: len(list(Path(f'/proc/{process.pid}/task').iterdir())) > 1, process)
        out, err = press_ctrl_c(process)
    assert (process.returncode, out, err) == (130, '', 'interrupted\n')


FIRST = """
import os, signal, sys
class Press:
    def find_spec(self, name, path, target=None):
        if name in ('__future__', 'uav_task_alloc.cli'):
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Press())
"""


@pytest.mark.parametrize('as_module', [True, False], ids=['program', 'library'])
def test_ctrl_c_during_the_first_import_of_the_package_prints_no_traceback(as_module, tmp_path):
    (tmp_path / 'sitecustomize.py').write_text(FIRST)
    call = ['-m', 'uav_task_alloc'] if as_module else ['-c', 'import uav_task_alloc.cli']
    done = subprocess.run([sys.executable, *call], cwd=ROOT, text=True, capture_output=True,
                          timeout=TIMEOUT, check=False,
                          env={**os.environ, 'PYTHONPATH': str(tmp_path)},
                          preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    assert done.stdout == ''
    if as_module:
        assert (done.returncode, done.stderr) == (-signal.SIGINT, '')
    else:  # a library changes no handler
        assert done.stderr.endswith('KeyboardInterrupt\n')


def test_ctrl_c_during_a_compilation_is_one_line(tmp_path):
    with start('compile', NUMBA_CACHE_DIR=str(tmp_path)) as process:
        assert process.stderr.readline().startswith('compiling kernels')
        out, err = press_ctrl_c(process)
    assert (process.returncode, out, err) == (130, '', 'interrupted\n')


def test_ctrl_c_while_the_search_is_compiled_prints_the_first_plan(tmp_path):
    file, out = tmp_path / 'one.yaml', tmp_path / 'plan.json'
    file.write_text('uavs: [{id: u, position: [0, 0, 50]}]\n'
                    'tasks: [{id: t, position: [90, 0, 50]}]\n')
    with start('plan', str(file), '--json', str(out), NUMBA_CACHE_DIR=str(tmp_path)) as process:
        assert process.stderr.readline().startswith('compiling kernels')
        assert process.stderr.readline().startswith('compiling kernels')
        assert process.stderr.readline() == (
            'first plan, by insertion: 1 task, 0 unassigned, 90 m; Ctrl-C stops and keeps it\n')
        printed, err = press_ctrl_c(process)
    assert (process.returncode, err) == (
        130, 'stopped before the search: its kernels were not compiled yet\n')
    assert '1 task planned' in printed
    assert 'insertion' in printed
    assert json.loads(out.read_text())['routes'] == {'u': ['t']}
    assert list(tmp_path.rglob('insertion.*.nbc'))
    assert not list(tmp_path.rglob('recombine.*.nbc'))


LATE = """
import signal, sys, threading
from uav_task_alloc.cli.interrupt import prompt_interrupt, resumable
from uav_task_alloc.cli.progress import SolveProgress
with prompt_interrupt():
    sys.setswitchinterval(1000.0)  # [s]: its thread runs only where this one waits
    try:
        with SolveProgress(1.0, sys.stderr, lambda: 0.0) if KEEPS else resumable():
            signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        pass
    for _ in range(100):
        waiting = threading.Thread(target=lambda: None)
        waiting.start()
        waiting.join()
    print('saved')
"""


@pytest.mark.parametrize('keeps', [True, False], ids=['plan', 'results'])
def test_what_ctrl_c_kept_is_saved_although_the_thread_for_signals_runs_late(keeps):
    done = subprocess.run([sys.executable, '-c', LATE.replace('KEEPS', str(keeps))], cwd=ROOT,
                          text=True, capture_output=True, timeout=TIMEOUT, check=False,
                          preexec_fn=lambda: signal.signal(signal.SIGINT,
                                                           signal.SIG_DFL))
    assert (done.returncode, done.stdout, done.stderr) == (0, 'saved\n', '')


def test_ctrl_c_ends_a_benchmark_and_all_its_processes(tmp_path):
    keep = tmp_path / 'kept'
    with start('bench', '--sizes', '4x20', '--against', 'none', '--budgets', '0.02', '--jobs', '2',
               '--seeds', '2000', '--keep', str(keep)) as process:
        until(lambda: len(list(keep.glob('*.json'))) > 2, process)
        out, err = press_ctrl_c(process)
    assert (process.returncode, out) == (130, '')
    assert 'Traceback' not in err
    assert err.endswith('interrupted\n')


def test_a_worker_process_never_takes_sigint(tmp_path):
    with start('bench', '--sizes', '4x20', '--against', 'none', '--jobs', '2',
               '--keep', str(tmp_path)) as process:
        children = Path(f'/proc/{process.pid}/task/{process.pid}/children')
        until(lambda: len(children.read_text().split()) > 1, process)
        for child in children.read_text().split():  # whatever it has got to
            status = Path(f'/proc/{child}/status').read_text()
            masks = [int(word, 16) for word in re.findall(r'Sig(?:Blk|Ign):\t(\w+)', status)]
            assert any(mask & 1 << signal.SIGINT - 1 for mask in masks)
        out, err = press_ctrl_c(process)
    assert (process.returncode, out, err) == (130, '', 'interrupted\n')


def test_a_caller_in_python_gets_its_handlers_back():
    before, descriptor = signal.default_int_handler, signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGINT, before)
    with prompt_interrupt():
        assert signal.getsignal(signal.SIGINT) is not before
        with resumable(), pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before
    assert signal.set_wakeup_fd(descriptor) == -1


def test_a_command_runs_in_another_thread_than_the_main_one(capsys):
    status = []
    thread = threading.Thread(target=lambda: status.append(cli.main(['params'])))
    thread.start()
    thread.join()
    assert status == [0]


def test_an_ignored_sigint_stays_ignored():
    code = ('import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n'
            'from uav_task_alloc.cli.entry import main; main(["params"])\n'
            'assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN')
    subprocess.run([sys.executable, '-c', code], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
