# SPDX-License-Identifier: Apache-2.0
"""The progress line on a terminal, none in a pipe, and Ctrl-C; virtual time, and one process."""
import io
import json
import os
import pty
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from uav_task_alloc.cli.progress import WIPE, SolveProgress

ROOT = Path(__file__).parents[2]
FILE = str(ROOT / 'config/scenarios/plan_only.yaml')


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self):
        return True


def run(stream, times):
    """Poll at each time [s]; a plan of fit 60.5 is found at the first."""
    now = [times[0]]
    with SolveProgress(10.0, stream, lambda: now[0]) as progress:
        for now[0] in times:
            assert not progress.stop()
            progress.on_iteration(100, 60.5)
    return stream.getvalue()


def test_nothing_is_shown_in_the_first_second():
    assert run(Terminal(), [100.0, 100.5, 101.0]) == ''


def test_then_the_best_fit_and_the_time_left_are_shown_and_erased_at_the_end():
    assert run(Terminal(), [100.0, 104.1]) == (
        f'{WIPE}solving: 4 s, 6 s left; fit 60.5, improved 4 s ago; '
        f'Ctrl-C stops and keeps it{WIPE}')


def test_a_better_plan_of_a_worse_fit_is_shown_as_the_best():
    now = [100.0]
    stream = Terminal()
    with SolveProgress(10.0, stream, lambda: now[0]) as progress:
        for now[0], fit in ((100.0, 60.5), (103.0, 70.5), (104.1, 70.5)):
            progress.on_iteration(100, fit)
            progress.stop()
    assert 'fit 70.5, improved 1 s ago' in stream.getvalue()


def test_the_line_is_updated_at_most_five_times_a_second():
    shown = run(Terminal(), [0.0, *(2.0 + 0.01 * i for i in range(100))])
    assert shown.count('solving') == 5


def test_nothing_is_shown_in_a_pipe():
    assert run(io.StringIO(), [100.0, 104.0, 109.0]) == ''


def test_the_first_ctrl_c_stops_the_solver_and_the_second_interrupts():
    before = signal.getsignal(signal.SIGINT)
    progress = SolveProgress(10.0, Terminal(), lambda: 0.0)
    with progress:
        signal.raise_signal(signal.SIGINT)
        assert progress.stop()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_amid_a_write_to_the_terminal_only_stops_the_solver(tmp_path):
    class Interrupted(io.BufferedWriter):
        """A stream that cannot be written to while it is written to, as that of stderr."""
        writing = False

        def write(self, text):
            assert not self.writing, 'reentrant call'
            self.writing = True
            if b'left' in text:
                signal.raise_signal(signal.SIGINT)
            self.writing = False
            return super().write(text)

    now, file = [0.0], tmp_path / 'shown'
    with file.open('wb', buffering=0) as raw, io.TextIOWrapper(
            Interrupted(raw), write_through=True) as stream:
        stream.isatty = lambda: True
        with SolveProgress(10.0, stream, lambda: now[0]) as progress:
            assert not progress.stop()
            now[0] = 2.0
            assert progress.stop()
    assert 'stopping; Ctrl-C again discards the plan\n' in file.read_text()


def test_ctrl_c_at_a_terminal_prints_and_writes_the_best_plan_so_far(tmp_path):
    ours, theirs = pty.openpty()
    out = tmp_path / 'plan.json'
    with subprocess.Popen(
            [sys.executable, '-m', 'uav_task_alloc', 'plan', FILE, '--budget', '600', '--json',
             str(out)], cwd=ROOT, stdout=subprocess.PIPE, stderr=theirs) as process:
        os.close(theirs)
        shown, end = b'', time.monotonic() + 120.0
        while b'left; fit' not in shown and time.monotonic() < end:
            if select.select([ours], [], [], 1.0)[0]:
                shown += os.read(ours, 4096)
        process.send_signal(signal.SIGINT)
        printed, _ = process.communicate(timeout=60)
    os.close(ours)
    assert b'left; fit' in shown
    assert process.returncode == 130
    assert b'5 tasks planned, 1 unassigned' in printed
    assert len(json.loads(out.read_text())['routes']) == 3
