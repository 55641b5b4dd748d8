# SPDX-License-Identifier: Apache-2.0
"""fleet_sim as a process: it speaks MAVLink for a scenario, and lets a UAV die when told."""
import json
import socket
import time

import pytest
from uav_task_alloc_msgs.srv import SetAvailability

from uav_task_alloc.mavlink.transport.codec import Codec

pytestmark = pytest.mark.ros

SCENARIO = """
uavs:
  - {id: uav_1, system_id: 1, autopilot: ardupilot, position: [0, 0, 0]}
  - {id: uav_2, system_id: 2, autopilot: px4, position: [50, 0, 0]}
"""


@pytest.fixture
def bridge():
    """The bridge's end: a bound socket, and who is heard there."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind(('127.0.0.1', 0))
    made.settimeout(0.2)
    yield made
    made.close()


@pytest.fixture
def sim(start, bridge, tmp_path):
    path = tmp_path / 'scenario.yaml'
    path.write_text(SCENARIO)
    return start('fleet_sim', '-p', f'scenario:={path}', '-p', 'speedup:=5.0',
                 '-p', f'target:=127.0.0.1:{bridge.getsockname()[1]}',
                 '-p', f'log_file:={tmp_path / "truth.jsonl"}')


def heard_systems(bridge, wanted, limit=20.0):
    """Listen until all of `wanted` were heard."""
    codec, heard, end = Codec(255, 190), set(), time.monotonic() + limit
    while not wanted <= heard:
        assert time.monotonic() < end, f'heard only {heard}'
        try:
            heard |= {m.get_srcSystem() for m in codec.parse(bridge.recv(4096))}
        except TimeoutError:
            continue
    return heard


def test_every_uav_of_the_scenario_speaks(sim, bridge):
    assert heard_systems(bridge, {1, 2}) == {1, 2}
    status, output = sim.stop()
    assert status == 0, output


def test_a_uav_dies_when_told(sim, bridge, probe, tmp_path):
    heard_systems(bridge, {1, 2})
    request = SetAvailability.Request(uav_id='uav_2', available=False)
    assert probe.call(SetAvailability, 'fleet_sim/set_alive', request).success
    sim.stop()
    rows = [json.loads(line) for line in (tmp_path / 'truth.jsonl').read_text().splitlines()]
    assert [r['uav'] for r in rows if r.get('event') == 'died'] == ['uav_2']


def test_an_unknown_uav_is_refused_with_the_reason(sim, probe):
    request = SetAvailability.Request(uav_id='nobody', available=False)
    answer = probe.call(SetAvailability, 'fleet_sim/set_alive', request)
    assert not answer.success
    assert "uav 'nobody' is unknown" in answer.message


def test_a_bad_target_ends_it_with_one_clear_line(start, tmp_path):
    path = tmp_path / 'scenario.yaml'
    path.write_text(SCENARIO)
    process = start('fleet_sim', '-p', f'scenario:={path}', '-p', 'target:=nowhere')
    process.popen.wait(20)
    assert process.popen.returncode == 1
    assert "target = 'nowhere': expected HOST:PORT" in process.output()
