# SPDX-License-Identifier: Apache-2.0
"""The command of the demo up to the start of its nodes, and its end; `make demo` flies it."""
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from ament_index_python.packages import get_package_prefix

from uav_task_alloc.cli import report
from uav_task_alloc.nodes import demo
from uav_task_alloc.nodes.ros import udp_ports
from uav_task_alloc.nodes.ros.udp_ports import free_domain, free_port

pytestmark = pytest.mark.ros


class Started(Exception):
    """All that the demo checks is good."""


@pytest.fixture
def no_nodes(monkeypatch):
    def start(*_):
        raise Started
    monkeypatch.setattr(demo, 'start_nodes', start)


def test_finding_34_a_folder_with_files_of_others_is_refused_and_left_as_it_is(
        tmp_path, capsys, no_nodes):
    thesis = tmp_path / 'results' / 'thesis.tex'
    thesis.parent.mkdir()
    thesis.write_text('years of work')
    assert demo.main(['--out', str(thesis.parent)]) == 1
    assert 'thesis.tex' in capsys.readouterr().err
    assert thesis.read_text() == 'years of work'


def test_an_output_folder_that_cannot_be_made_names_the_option(tmp_path, capsys, no_nodes):
    tmp_path.joinpath('file').touch()
    folder = tmp_path / 'file' / 'demo'
    assert demo.main(['--out', str(folder)]) == 1
    assert capsys.readouterr().err == (f"demo: --out = '{folder}': expected a place that can be "
                                       'written: Not a directory\n')


def test_a_domain_in_which_another_node_takes_part_is_not_chosen():
    domain = free_domain(50)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(('', 7410 + 250 * domain + 2))
        assert free_domain(domain) not in (domain, 0)
    assert free_domain(domain) == domain


def test_a_port_is_none_that_linux_assigns_at_random_and_not_in_use(monkeypatch):
    low, high = map(int, Path('/proc/sys/net/ipv4/ip_local_port_range').read_text().split())
    first = free_port()
    assert not low <= first <= high
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as used:
        used.bind(('127.0.0.1', first))
        monkeypatch.setattr(udp_ports, '_PORTS', range(first, first + 1))
        assert free_port() == 0


def test_finding_34_a_bad_scenario_costs_no_earlier_results(tmp_path, capsys, no_nodes):
    with pytest.raises(Started):
        demo.main(['--out', str(tmp_path / 'out')])
    summary = tmp_path / 'out' / 'summary.json'
    summary.write_text('{}')
    assert demo.main(['--out', str(tmp_path / 'out'), '--scenario', str(tmp_path / 'no')]) == 1
    assert 'expected a scenario file' in capsys.readouterr().err
    assert summary.exists()


def test_finding_34_the_results_of_the_last_demo_are_removed(tmp_path, no_nodes):
    out = tmp_path / 'out'
    for _ in range(2):
        with pytest.raises(Started):
            demo.main(['--out', str(out)])
        assert not (out / 'summary.json').exists()
        (out / 'summary.json').write_text('{}')


def test_a_recording_has_the_name_of_one(tmp_path, capsys, no_nodes):
    out = str(tmp_path / 'out')
    with pytest.raises(Started):
        demo.main(['--out', out, '--record', str(tmp_path / 'demo.mcap')])
    assert demo.main(['--out', out, '--record', str(tmp_path / 'demo.rec')]) == 1
    assert 'expected a name that ends with .mcap' in capsys.readouterr().err


_SIGNAL_IN_AN_IMPORT = """
import signal, sys
from uav_task_alloc.nodes import demo
from uav_task_alloc.nodes.ros.udp_ports import free_domain

def load(_):
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:  # as a module in C that imports one in Python
        raise ImportError('failed to import') from None

demo.load = load
sys.exit(demo.main(['--out', sys.argv[1]]))
"""


def test_a_signal_during_an_import_ends_the_demo_without_a_traceback(tmp_path):
    ended = subprocess.run([sys.executable, '-c', _SIGNAL_IN_AN_IMPORT, tmp_path / 'out'],
                           capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stderr) == (130, 'demo: stopped; there is no summary\n')


class Clock:
    """Stands in for time: a wait takes its timeout."""

    def __init__(self):
        self.now = 0.0

    def monotonic(self):
        return self.now

    def view(self, ends_at, at):
        """A live view that ends at `ends_at` [s]; `at`: {time [s]: called then}."""
        def wait(timeout):
            self.now += timeout
            for when in [when for when in at if when <= self.now]:
                at.pop(when)()
            if self.now < ends_at:
                raise subprocess.TimeoutExpired('live_view', timeout)
        return demo.NodeProcess('live_view', SimpleNamespace(wait=wait), None)


@pytest.mark.parametrize(('ready', 'faults'), [(100.0, []), (1.0, ['not finished after 80 s'])])
def test_kernels_that_are_compiled_do_not_count_for_the_limit(
        tmp_path, capsys, monkeypatch, ready, faults):
    clock, log = Clock(), tmp_path / 'allocator.log'
    monkeypatch.setattr(demo, 'time', clock)
    log.write_text('')
    allocator = demo.NodeProcess('allocator', SimpleNamespace(poll=lambda: None), log)
    view = clock.view(150.0, {
        0.5: lambda: log.write_text('compiling kernels (once, about 29 s)\n'),
        ready: lambda: log.write_text(log.read_text() + '[INFO] [1.5] [allocator]: ready\n')})
    assert demo.wait_for_end([allocator, view], 80.0, []) == faults
    assert capsys.readouterr().err.count('kernels are compiled first') == 1


def children(pid):
    found = subprocess.run(['ps', '-o', 'pid=', '--ppid', str(pid)], capture_output=True,
                           text=True)
    return [int(text) for text in found.stdout.split()]


@pytest.mark.parametrize('delay', [0.02, 0.3, 1.0, 2.0, 4.0])  # [s]
def test_a_demo_that_is_interrupted_ends_its_nodes_without_a_traceback(tmp_path, delay):
    path = Path(get_package_prefix('uav_task_alloc'), 'lib/uav_task_alloc/demo')
    process = subprocess.Popen([path, '--out', str(tmp_path / 'out')], stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, text=True)
    time.sleep(delay)
    nodes = children(process.pid)
    process.send_signal(signal.SIGINT)  # to the demo only, not to its nodes as a terminal does
    out, _ = process.communicate(timeout=120)
    assert 'Traceback' not in out
    assert (process.returncode, out.splitlines()[-1:]) in (
        (0, ['demo: stopped during its start']), (130, ['demo: stopped; there is no summary']),
        (-signal.SIGINT, []))
    for node in nodes:
        with pytest.raises(ProcessLookupError):
            os.kill(node, 0)


def test_the_summary_of_a_demo_is_that_of_its_report(tmp_path, capsys):
    lines = [{'wall': 1.0, 'kind': 'run', 'speedup': 1.0, 'simulated': True},
             {'wall': 1.0, 'kind': 'announcement', 'action': 'ADD', 'tasks': [
                 {'id': 'a', 'position': [0.0, 0.0, 9.0]}]},
             {'wall': 2.0, 'kind': 'allocation', 'solve_ms': 5.0, 'trigger': '', 'lists': []},
             {'wall': 41.0, 'kind': 'zones', 'zones': []}]
    (tmp_path / 'record.jsonl').write_text(''.join(json.dumps(line) + '\n' for line in lines))
    (tmp_path / 'flight.jsonl').write_text('')
    assert demo.write_results(tmp_path) == ['tasks_lost = 1']
    summary = json.loads((tmp_path / 'summary.json').read_text())
    assert summary == report.summarise(tmp_path)
    assert summary['wall_s'] == 40.0
