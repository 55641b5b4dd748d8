# SPDX-License-Identifier: Apache-2.0
"""Flies a scenario from start to end in real nodes, watches them, and judges the result."""
from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from ament_index_python.packages import get_package_prefix, get_package_share_directory

from uav_task_alloc import plots
from uav_task_alloc.cli import report
from uav_task_alloc.errors import AllocError
from uav_task_alloc.nodes.ros.udp_ports import free_port
from uav_task_alloc.record import ground_truth as truth, run_folder
from uav_task_alloc.scenario import load, simulation_parameters
from uav_task_alloc.scenario.node_parameters import Parameters

_PACKAGE = 'uav_task_alloc'
_PATIENCE = 15.0  # [s], of which the bridge takes 10 at most for a swap under way
FAULTS = ('tasks_lost', 'tasks_flown_twice', 'zone_violations')


@dataclass
class Child:
    """One node as a process, its output in a file."""

    name: str
    process: subprocess.Popen[bytes]
    log: Path

    @classmethod
    def start(cls, name: str, out: Path, parameters: Parameters, show: bool = False) -> Child:
        """Start an installed executable; `show`: in this terminal, else into out/NAME.log."""
        command = [f'{get_package_prefix(_PACKAGE)}/lib/{_PACKAGE}/{name}', '--ros-args']
        for key, value in parameters.items():
            command += ['-p', f'{key}:={json.dumps(value)}']
        log = out / f'{name}.log'
        with open(log, 'wb') as file:
            process = subprocess.Popen(command, stdout=None if show else file,
                                       stderr=None if show else subprocess.STDOUT)
        return cls(name, process, log)

    def stop(self) -> int:
        """Ask it to end, wait, end it for good after PATIENCE; its exit status."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()


def start_nodes(args: argparse.Namespace, out: Path) -> list[Child]:
    """All nodes of the scenario; the last one is the live view, which ends when all is done."""
    given = simulation_parameters(load(args.scenario), args.scenario, free_port(), args.speedup)
    state = str(out / run_folder.STATE)
    for node, more in {
            'allocator': {'state_dir': state}, 'mavlink_bridge': {'state_dir': state},
            'fleet_sim': {'log_file': str(out / truth.FILE)},
            'live_view': {'out_dir': str(out), 'record': str(args.record or '')}}.items():
        given[node].update(more)
    return [Child.start(node, out, parameters, show=node == 'live_view')
            for node, parameters in given.items()]


def watch(children: list[Child], limit: float) -> list[str]:
    """Wait for the live view to end; what went wrong meanwhile."""
    *nodes, view = children
    end = time.monotonic() + limit
    while time.monotonic() < end:
        try:
            view.process.wait(0.2)
            return []
        except subprocess.TimeoutExpired:
            dead = [n for n in nodes if n.process.poll() is not None
                    and (n.name != 'scenario_player' or n.process.returncode)]
        if dead:
            return [f'{n.name} died with status {n.process.returncode}, see {n.log}'
                    for n in dead]
    return [f'not finished after {limit:g} s']


def find_faults(summary: dict[str, object]) -> list[str]:
    """The faults that a summary tells of."""
    return [f'{name} = {summary[name]}' for name in FAULTS if summary[name]]


def fly_scenario(args: argparse.Namespace) -> int:
    """Run the scenario into args.out; 0 when no task was lost or flown twice, no zone entered."""
    begin = time.monotonic()
    out = args.out
    load(args.scenario)  # a bad one costs no results of before
    run_folder.prepare(out)
    children = start_nodes(args, out)
    try:
        faults = watch(children, args.limit)
    finally:
        codes = {child.name: child.stop() for child in reversed(children)}
    faults += [f'{name} ended with status {code}' for name, code in codes.items()
               if code and not any(name in fault for fault in faults)]
    summary = report.summarise(out)
    summary['wall_s'] = round(time.monotonic() - begin, 1)
    (out / run_folder.SUMMARY).write_text(json.dumps(summary, indent=2) + '\n')
    print(report.summary_table(summary))
    plots.draw_flight(out, out / run_folder.MAP)
    print(f'Details: {out / run_folder.SUMMARY}   Map: {out / run_folder.MAP}')
    faults += find_faults(summary)
    for fault in faults:
        print(f'FAULT: {fault}', file=sys.stderr)
    return 1 if faults else 0


def main(argv: list[str] | None = None) -> int:
    """Command line of the demo; its exit status."""
    share = Path(get_package_share_directory(_PACKAGE))
    parser = argparse.ArgumentParser(prog='demo', description=__doc__)
    parser.add_argument('--scenario', type=Path, default=share / 'config/scenarios/demo.yaml')
    parser.add_argument('--speedup', type=float, help="(the scenario's)")
    parser.add_argument('--out', type=Path, default=Path('out/demo'), metavar='DIR',
                        help='results; what an earlier demo left there is removed (%(default)s)')
    parser.add_argument('--limit', type=float, default=80.0, help='[s] of wall time')
    parser.add_argument('--record', type=Path, metavar='FILE',
                        help='MCAP file for all topics; `report FILE` draws the mission from it')
    args = parser.parse_args(argv)
    # fleets of several demos on one machine, or on the network, must not hear each other
    os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    try:
        return fly_scenario(args)
    except (AllocError, OSError) as error:
        print(error, file=sys.stderr)
        return 1


if __name__ == '__main__':
    sys.exit(main())
