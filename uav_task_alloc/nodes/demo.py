# SPDX-License-Identifier: Apache-2.0
"""Flies a scenario in real nodes as processes, monitors them, and checks the result."""
from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from ament_index_python.packages import get_package_prefix, get_package_share_directory

from uav_task_alloc.cli.options import OptionParser
from uav_task_alloc.cli.outputs import check_file, naming, writing
from uav_task_alloc.errors import AllocError, InvalidValue
from uav_task_alloc.nodes.ros.udp_ports import free_domain, free_port
from uav_task_alloc.record import ground_truth, run_folder
from uav_task_alloc.scenario import load, simulation_parameters
from uav_task_alloc.scenario.node_parameters import Parameters

_PACKAGE = 'uav_task_alloc'
_EXIT_TIMEOUT = 15.0  # [s]; the bridge waits up to 10 s for a running upload
_INTERRUPTED = 130  # exit status of a shell after Ctrl-C
_STOPPED = 'demo: stopped; there is no summary'
_COMPILING, _READY = 'compiling kernels (', ']: ready'  # in the log of the allocator
_FAULTS = ('tasks_lost', 'tasks_flown_twice', 'zone_violations', 'separation_losses')


@dataclass
class NodeProcess:
    """One node as a process, with its output in a file."""

    name: str
    process: subprocess.Popen[bytes]
    log: Path

    @classmethod
    def start(cls, name: str, out: Path, parameters: Parameters,
              show: bool = False) -> NodeProcess:
        """Start an installed executable.

        Args:
            name: of the executable.
            out: folder of its log, NAME.log.
            parameters: by ROS name.
            show: its output goes to this terminal instead.
        """
        command = [f'{get_package_prefix(_PACKAGE)}/lib/{_PACKAGE}/{name}', '--ros-args']
        for key, value in parameters.items():
            text = json.dumps(value).replace('Infinity', '.inf')  # as YAML has it
            command += ['-p', f'{key}:={text}']
        log = out / f'{name}.log'
        with open(log, 'wb') as file:
            process = subprocess.Popen(command, stdout=None if show else file,
                                       stderr=None if show else subprocess.STDOUT)
        return cls(name, process, log)

    def stop(self) -> int:
        """Interrupt it, kill it after a timeout; return its exit status."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(_EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()


def start_nodes(args: argparse.Namespace, out: Path) -> list[NodeProcess]:
    """Start all nodes of the scenario; the last one is the live view, which ends with it."""
    parameters = simulation_parameters(load(args.scenario), args.scenario, free_port(),
                                       args.speedup)
    state = str(out / run_folder.STATE)
    for node, more in {
            'allocator': {'state_dir': state}, 'mavlink_bridge': {'state_dir': state},
            'fleet_sim': {'log_file': str(out / ground_truth.TRUTH_FILE)},
            'live_view': {'out_dir': str(out), 'record': str(args.record or '')}}.items():
        parameters[node].update(more)
    return [NodeProcess.start(node, out, values, show=node == 'live_view')
            for node, values in parameters.items()]


class KernelWatch:
    """Whether the allocator still compiles kernels, by its log; says so once.

    Args:
        nodes: processes; nothing is compiled where no allocator is among them.
    """

    def __init__(self, nodes: Sequence[NodeProcess]) -> None:
        self._log = next((node.log for node in nodes if node.name == 'allocator'), None)
        self._said = False

    def compiling(self) -> bool:
        """Whether it has begun and is not ready."""
        text = self._log.read_text(errors='replace') if self._log else ''
        if _READY in text:
            self._log = None
        if _READY in text or _COMPILING not in text:
            return False
        if not self._said:
            print('demo: kernels are compiled first, once, for half a minute or more; the flight '
                  'begins after it', file=sys.stderr, flush=True)
        self._said = True
        return True


def wait_for_end(processes: list[NodeProcess], limit: float,
                 signals: Sequence[int]) -> list[str]:
    """Wait for the live view to exit.

    Args:
        processes: of all nodes, the live view last.
        limit: of wall time [s], without that in which kernels are compiled.
        signals: those received; the wait ends with the first.

    Returns:
        What went wrong: nodes that have died, or the timeout.
    """
    *nodes, view = processes
    end, kernels = time.monotonic() + limit, KernelWatch(nodes)
    while time.monotonic() < end and not signals:
        try:
            view.process.wait(0.2)
            return []
        except subprocess.TimeoutExpired:
            dead = [node for node in nodes if node.process.poll() is not None
                    and (node.name != 'scenario_player' or node.process.returncode)]
        if dead:
            return [f'{node.name} died with status {node.process.returncode}, see {node.log}'
                    for node in dead]
        if kernels.compiling():
            end = time.monotonic() + limit
    return [] if signals else [f'not finished after {limit:g} s']


def find_faults(summary: Mapping[str, object]) -> list[str]:
    """The figures of a summary that must be zero and are not."""
    return [f'{name} = {summary[name]}' for name in _FAULTS if summary[name]]


def fly_scenario(args: argparse.Namespace) -> int:
    """Fly a scenario and write its results into args.out.

    Args:
        args: of the command line.

    Returns:
        0 when no task was lost or flown twice, no zone entered, no separation lost, and every
        node exited in order.

    Raises:
        KeyboardInterrupt: the flight was stopped by a signal.
    """
    out = args.out
    load(args.scenario)  # an invalid one must not cost earlier results
    with naming('--out', out):
        run_folder.prepare(out)
    signals: list[int] = []
    # an exception while the nodes are started would leave some of them running
    with signal_handler(lambda number, _: signals.append(number)):
        processes = start_nodes(args, out)
        try:
            faults = wait_for_end(processes, args.limit, signals)
        finally:
            codes = {process.name: process.stop() for process in reversed(processes)}
    if signals:
        raise KeyboardInterrupt
    faults += [f'{name} ended with status {code}' for name, code in codes.items()
               if code and not any(name in fault for fault in faults)]
    faults += write_results(out)
    for fault in faults:
        print(f'FAULT: {fault}', file=sys.stderr)
    return 1 if faults else 0


@contextlib.contextmanager
def signal_handler(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Within `with`, a handler receives the signals to stop."""
    before = {number: signal.signal(number, handler)
              for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


def write_results(out: Path) -> list[str]:
    """Write summary and map of a run into a folder; return its faults."""
    from uav_task_alloc import plots  # imports matplotlib
    from uav_task_alloc.cli import report  # imports numba
    summary = report.summarise(out)
    with writing('--out', out / run_folder.SUMMARY) as file:
        file.write_text(json.dumps(summary, indent=2) + '\n')
    print(report.summary_table(summary))
    with writing('--out', out / run_folder.MAP) as file:
        plots.draw_flight(out, file)
    print(f'Details: {out / run_folder.SUMMARY}   Map: {out / run_folder.MAP}')
    return find_faults(summary)


def main(argv: list[str] | None = None) -> int:
    """Command line of the demo; returns the exit status, 130 after a signal."""
    try:
        with signal_handler(_exit_at_once):
            return _run(argv)
    except KeyboardInterrupt:
        print(_STOPPED, file=sys.stderr)
        return _INTERRUPTED
    except (AllocError, OSError) as error:
        print(f'demo: {error}', file=sys.stderr)
        return 1


def _exit_at_once(*_: object) -> None:
    """Exit on a signal while no nodes run.

    An exception would be lost, printed or replaced by another one where C calls Python, as in
    LLVM or during an import of numba.
    """
    with contextlib.suppress(Exception):  # the signal may have interrupted a write to it
        sys.stdout.flush()
    os.write(2, f'{_STOPPED}\n'.encode())
    os._exit(_INTERRUPTED)


def _run(argv: list[str] | None) -> int:
    share = Path(get_package_share_directory(_PACKAGE))
    parser = OptionParser('', __doc__ or '')
    parser.prog = 'demo'
    parser.add_argument('--scenario', type=Path, default=share / 'config/scenarios/demo.yaml',
                        metavar='FILE', help='scenario to fly (default: %(default)s)')
    parser.number('--speedup', 0.1, 100.0, 'how many times faster than real time',
                  default_text='as the scenario says')
    parser.add_argument('--out', type=Path, default=Path('out/demo'), metavar='DIR',
                        help='folder of the results; those of an earlier demo are removed '
                        '(default: %(default)s)')
    parser.number('--limit', 1.0, 86400.0, 'wall time after which it has failed, without that in '
                  'which kernels are compiled', unit='s',
                  default=80.0)
    parser.add_argument('--record', type=Path, metavar='FILE', help='MCAP file to record all '
                        'topics into; `report FILE` draws the mission from it (default: none)')
    args = parser.parsed(sys.argv[1:] if argv is None else argv)
    if args.record and args.record.exists():
        raise InvalidValue('--record', str(args.record), 'a file that does not exist')
    check_file('--record', args.record, ('.mcap',))
    # several demos on one machine, or in one network, must not exchange messages
    os.environ.setdefault('ROS_DOMAIN_ID', str(free_domain(1 + os.getpid() % 100)))
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    return fly_scenario(args)


if __name__ == '__main__':
    sys.exit(main())
