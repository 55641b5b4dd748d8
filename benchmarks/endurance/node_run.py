# SPDX-License-Identifier: Apache-2.0
"""A run of real nodes as processes, in a network of its own, and its command line."""
from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import domain_coordinator
import rclpy

from uav_task_alloc.nodes.demo import NodeProcess
from uav_task_alloc.nodes.ros.udp_ports import free_port
from uav_task_alloc.scenario import load, simulation_parameters

# UDP on the loopback only: a killed process leaves shared memory, through which its successor
# receives nothing for 3 s, and the discovery range LOCALHOST always adds that transport. Frequent
# announcements: else a known process answers a new one once, perhaps before that one listens, and
# then after 3 s
NETWORK = """<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"><profiles>
<transport_descriptors><transport_descriptor><transport_id>loopback</transport_id>
<type>UDPv4</type><interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList>
</transport_descriptor></transport_descriptors>
<participant profile_name="crash" is_default_profile="true"><rtps>
<userTransports><transport_id>loopback</transport_id></userTransports>
<useBuiltinTransports>false</useBuiltinTransports><builtin><discovery_config>
<leaseAnnouncement><sec>0</sec><nanosec>100000000</nanosec></leaseAnnouncement>
</discovery_config></builtin></rtps></participant></profiles></dds>"""


class Nodes:
    """The processes, each with a folder for each of its starts."""

    def __init__(self, folder: Path, speedup: float, scenario: str) -> None:
        path = folder / 'scenario.yaml'
        path.write_text(scenario)
        self.folder, self.starts = folder, 0
        self.truth = folder / f'flight_{time.time():.0f}.jsonl'
        played = load(path)
        self.homes = {uav.id: uav.home for uav in played.uavs}
        self.parameters = simulation_parameters(played, path, free_port(), speedup)
        state = str(folder / 'state')
        for node, more in {'allocator': {'state_dir': state, 'uav_timeout': 5.0},
                           'mavlink_bridge': {'state_dir': state},
                           'fleet_sim': {'log_file': str(self.truth)}}.items():
            self.parameters[node].update(more)
        self.running: dict[str, NodeProcess] = {}

    def start(self, name: str) -> None:
        self.starts += 1
        out = self.folder / 'logs' / f'{self.starts:03d}'
        out.mkdir(parents=True, exist_ok=True)
        self.running[name] = NodeProcess.start(name, out, self.parameters[name])

    def kill(self, name: str) -> None:
        self.running[name].process.kill()
        self.running[name].process.wait()

    def dead(self) -> list[str]:
        """Nodes that have ended by themselves."""
        return [f'{name} ended with {node.process.returncode}, see {node.log}'
                for name, node in self.running.items() if node.process.poll() is not None]

    def cpu(self) -> dict[str, float]:
        """CPU time [s] of the present processes."""
        times = {}
        for name, node in self.running.items():
            fields = Path(f'/proc/{node.process.pid}/stat').read_text().rpartition(')')[2].split()
            times[name] = (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
        return times

    def stop(self) -> None:
        for node in reversed(self.running.values()):
            node.stop()


@contextmanager
def own_network(folder: str) -> Iterator[None]:
    """A DDS domain of its own, by UDP on the loopback; the profile is in `folder`."""
    profile = Path(folder, 'network.xml')
    profile.write_text(NETWORK)
    with domain_coordinator.domain_id() as domain:
        os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE='SUBNET',
                          FASTRTPS_DEFAULT_PROFILES_FILE=str(profile))
        rclpy.init()
        try:
            yield
        finally:
            rclpy.shutdown()


def node_run(text: str | None, run: Callable[[argparse.Namespace, Path], int],
             numbers: Mapping[str, float], flags: tuple[str, ...] = ()) -> int:
    """Read the command line and run in a network of its own; returns the exit status.

    text: of `--help`.
    run: takes the options and the folder for files.
    numbers: default of each option with a number, whole where the default is.
    flags: options without a value.
    """
    parser = argparse.ArgumentParser(description=(text or '').partition('\n')[0])
    for name, default in {**numbers, 'seed': 1}.items():
        parser.add_argument(f'--{name}', type=type(default), default=default)
    for name in (*flags, 'json'):
        parser.add_argument(f'--{name}', action='store_true')
    parser.add_argument('--state', type=Path, help='folder that keeps the files of the run')
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary, own_network(temporary):
        folder = args.state or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        return run(args, folder)


def print_figures(figures: Mapping[str, object], as_json: bool) -> None:
    """Print figures, a line each or as one object."""
    if as_json:
        print(json.dumps(figures))
    else:
        print(*(f'{name:18} {value}' for name, value in figures.items()), sep='\n')
