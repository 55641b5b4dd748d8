# SPDX-License-Identifier: Apache-2.0
"""SITL processes are started as the environment says; a script stands in for the binary."""
import contextlib
import importlib.util
import socket
from pathlib import Path

BINARY = '#!/bin/sh\nmkdir log && echo "speed $PX4_SIM_SPEED_FACTOR arguments $*"\n'


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


def test_finding_29_px4_can_make_its_log_folder_and_gets_speed_instance_and_port(
        monkeypatch, tmp_path):
    port = free_ports(4)
    for name, value in (('SITL_SPEED', '2.5'), ('SITL_FIRST_INSTANCE', '5'),
                        ('SITL_PORT', str(port - 5)), ('SITL_LIMIT', '77')):
        monkeypatch.setenv(name, value)
    spec = importlib.util.spec_from_file_location(
        'worlds_of_this_test', Path(__file__).parent / 'worlds.py')
    worlds = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(worlds)
    binary = tmp_path / 'bin' / 'px4'
    binary.parent.mkdir()
    binary.write_text(BINARY)
    binary.chmod(0o755)
    world = worlds.Px4(str(binary), tmp_path)
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
        world.close()
        for link in world.links:
            link.close()
