# SPDX-License-Identifier: Apache-2.0
"""SITL processes are started as the environment says; a script stands in for the binary."""
import contextlib
import importlib.util
import socket
from pathlib import Path

import pytest

BINARY = '#!/bin/sh\nmkdir log && echo "speed $PX4_SIM_SPEED_FACTOR arguments $*"\n'
ENDS = """#!/bin/sh
[ "$2" = 2 ] || exec sleep 600
echo "PX4 server already running for instance $2"
exit 7
"""


def free_ports(count):
    """The first of some UDP ports in a row that are free."""
    while True:
        with contextlib.ExitStack() as stack, contextlib.suppress(OSError, OverflowError):
            first = 0
            for n in range(count):
                link = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
                link.bind(('127.0.0.1', first + n if n else 0))
                first = first or link.getsockname()[1]
            return first


def binary_in(folder, text):
    binary = folder / 'bin' / 'px4'
    binary.parent.mkdir()
    binary.write_text(text)
    binary.chmod(0o755)
    return str(binary)


def load_worlds():
    """The module, with the environment of the test."""
    spec = importlib.util.spec_from_file_location(
        'worlds_of_this_test', Path(__file__).parent / 'worlds.py')
    worlds = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(worlds)
    return worlds


def close(world):
    world.close()
    for link in world.links:
        link.close()


def test_an_autopilot_that_has_ended_is_reported_at_once_with_its_output(monkeypatch, tmp_path):
    monkeypatch.setenv('SITL_FIRST_INSTANCE', '0')
    monkeypatch.setenv('SITL_PORT', str(free_ports(4)))
    world = load_worlds().Px4(binary_in(tmp_path, ENDS), tmp_path)
    try:
        assert world.processes[2].wait(90) == 7
        with pytest.raises(AssertionError, match=r'vehicle 3 has ended with 7:\n.*for instance 2'):
            world.serve()
    finally:
        close(world)


def test_finding_29_px4_can_make_its_log_folder_and_gets_speed_instance_and_port(
        monkeypatch, tmp_path):
    port = free_ports(4)
    for name, value in (('SITL_SPEED', '2.5'), ('SITL_FIRST_INSTANCE', '5'),
                        ('SITL_PORT', str(port - 5)), ('SITL_LIMIT', '77')):
        monkeypatch.setenv(name, value)
    worlds = load_worlds()
    world = worlds.Px4(binary_in(tmp_path, BINARY), tmp_path)
    try:
        assert [process.wait(90) for process in world.processes] == [0, 0, 0, 0]
        assert world.limit == 77.0
        assert world.address(5) == f'udpin:127.0.0.1:{port}'
        for system in worlds.SYSTEMS:
            folder = tmp_path / f'sitl_{system}'
            assert (folder / 'log').is_dir()
            assert (folder / 'output.txt').read_text() == (
                f'speed 2.5 arguments -i {4 + system} -d {tmp_path / "etc"}\n')
    finally:
        close(world)
