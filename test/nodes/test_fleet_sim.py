# SPDX-License-Identifier: Apache-2.0
"""fleet_sim as a process: MAVLink of a scenario, and UAVs that are switched off."""
import json
import socket
import time

import pytest
from rosgraph_msgs.msg import Clock
from uav_task_alloc_msgs.srv import SetAvailability

from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.nodes.conversions.messages import from_stamp

pytestmark = pytest.mark.ros

SCENARIO = """
uavs:
  - {id: uav_1, system_id: 1, autopilot: ardupilot, position: [0, 0, 0]}
  - {id: uav_2, system_id: 2, autopilot: px4, position: [50, 0, 0]}
"""


@pytest.fixture
def bridge():
    """A bound socket in place of the bridge."""
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


def receive_systems(bridge, wanted, limit=90.0):
    """Receive until all system ids in `wanted` have sent."""
    codec, senders, end = Codec(255, 190), set(), time.monotonic() + limit
    while not wanted <= senders:
        assert time.monotonic() < end, f'received only from {senders}'
        try:
            senders |= {m.get_srcSystem() for m in codec.parse(bridge.recv(4096))}
        except TimeoutError:
            continue
    return senders


def test_every_uav_of_the_scenario_sends_heartbeats(sim, bridge):
    assert receive_systems(bridge, {1, 2}) == {1, 2}
    status, output = sim.stop()
    assert status == 0, output


def test_a_uav_is_switched_off_by_the_service(sim, bridge, probe, tmp_path):
    receive_systems(bridge, {1, 2})
    request = SetAvailability.Request(uav_id='uav_2', available=False)
    assert probe.call(SetAvailability, 'fleet_sim/set_alive', request).success
    sim.stop()
    rows = [json.loads(line) for line in (tmp_path / 'truth.jsonl').read_text().splitlines()]
    assert [r['uav'] for r in rows if r.get('event') == 'died'] == ['uav_2']


def test_an_unknown_uav_is_refused_with_the_reason(sim, probe):
    request = SetAvailability.Request(uav_id='no_such_uav', available=False)
    answer = probe.call(SetAvailability, 'fleet_sim/set_alive', request)
    assert not answer.success
    assert "uav 'no_such_uav' is unknown" in answer.message


def test_a_bad_target_ends_it_with_one_clear_line(start, tmp_path):
    path = tmp_path / 'scenario.yaml'
    path.write_text(SCENARIO)
    process = start('fleet_sim', '-p', f'scenario:={path}', '-p', 'target:=nowhere')
    process.popen.wait(90)
    assert process.popen.returncode == 1
    assert "target = 'nowhere': expected HOST:PORT" in process.output()


def test_simulated_time_runs_at_the_speedup_from_the_time_of_the_start_on(sim, probe):
    begin = time.time()
    clocks = []  # (simulated time, when it was sent) [unix s]; a delay of the test is in neither

    def receive(msg, info):
        clocks.append((from_stamp(msg.clock), info['source_timestamp'] * 1e-9))
    probe.node.create_subscription(Clock, '/clock', receive, 10)
    probe.until(lambda: clocks and clocks[-1][0] - clocks[0][0] >= 10.0)
    assert clocks[0][0] >= begin - 60.0
    first, last = (max(simulated - 5.0 * sent for simulated, sent in part)
                   for part in (clocks[:10], clocks[-10:]))  # sent at once: the others were late
    assert last - first <= 1.0
    times = [simulated for simulated, _ in clocks]
    assert times == sorted(times)


def test_the_ground_truth_has_the_times_of_the_clock(sim, bridge, probe, tmp_path):
    clocks = probe.collect(Clock, '/clock', 10)
    probe.until(lambda: clocks)
    receive_systems(bridge, {1, 2})
    sim.stop()
    rows = [json.loads(line) for line in (tmp_path / 'truth.jsonl').read_text().splitlines()]
    epochs = {round(row['clock'] - row['t'], 2) for row in rows}
    assert max(epochs) - min(epochs) < 0.02
    assert min(epochs) <= from_stamp(clocks[0].clock)
