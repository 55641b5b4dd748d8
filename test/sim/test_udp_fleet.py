# SPDX-License-Identifier: Apache-2.0
"""The fleet on real sockets: every vehicle its own, one thread, a ground-truth log."""
import json
import socket
import time
from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from vehicle_bench import ORIGIN

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.udp_fleet import UdpFleet, to_address


class Station:
    """A ground station's socket."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('127.0.0.1', 0))
        self.socket.settimeout(0.2)
        self.codec = Codec(255, 190)
        self.peers, self.received = {}, []

    @property
    def address(self):
        return self.socket.getsockname()

    def until(self, condition):
        end = time.monotonic() + 10.0
        while not condition(self.received):
            assert time.monotonic() < end, 'timed out'
            try:
                data, address = self.socket.recvfrom(4096)
            except TimeoutError:
                continue
            for message in self.codec.parse(data):
                self.peers[message.get_srcSystem()] = address
                self.received.append(message)


@pytest.fixture
def station():
    station = Station()
    yield station
    station.socket.close()


@pytest.fixture
def fleet(station, tmp_path):
    fleet = UdpFleet([(VehicleConfig(f'uav_{n}', n, ORIGIN, (10.0 * n, 0.0, 0.0), floods=False),
                   ('ardupilot', 'px4')[n % 2]) for n in (1, 2, 3)],
                 station.address, speedup=10.0, log_file=tmp_path / 'log.jsonl')
    thread = fleet.start()
    yield fleet
    fleet.stop()
    thread.join()
    fleet.close()


def lines(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_every_vehicle_speaks_from_its_own_port(fleet, station):
    station.until(lambda received: len(station.peers) == 3)
    assert len(set(station.peers.values())) == 3


def test_a_vehicle_answers_each_remote_that_sends(fleet, station):
    station.until(lambda received: 2 in station.peers)
    ask = d.MAVLink_mission_request_list_message(2, 1, 0)
    station.socket.sendto(Codec(255, 190).pack(ask), station.peers[2])
    station.until(lambda received: any(m.get_type() == 'MISSION_COUNT' for m in received))


def test_damaged_bytes_do_not_end_it(fleet, station):
    station.until(lambda received: 1 in station.peers)
    station.socket.sendto(b'\xfd\x00nonsense' * 20, station.peers[1])
    station.received.clear()
    station.until(lambda received: any(m.get_srcSystem() == 1 for m in received))


def test_time_runs_at_the_speedup(fleet):
    began, wall = fleet.now(), time.monotonic()
    while time.monotonic() < wall + 0.1:
        pass
    assert fleet.now() - began == pytest.approx(10.0 * (time.monotonic() - wall), rel=0.2)


def test_a_dead_vehicle_is_silent_until_it_is_revived(fleet, station):
    station.until(lambda received: len(station.peers) == 3)
    assert fleet.set_alive('uav_1', False) == ''
    station.until(lambda received: len([m for m in received if m.get_srcSystem() == 2]) > 30)
    station.received.clear()
    station.until(lambda received: len([m for m in received if m.get_srcSystem() == 2]) > 30)
    assert not any(m.get_srcSystem() == 1 for m in station.received)
    assert fleet.set_alive('uav_1', True) == ''
    station.until(lambda received: any(m.get_srcSystem() == 1 for m in received))


def test_an_unknown_vehicle_cannot_die(fleet):
    assert fleet.set_alive('uav_9', False) == (
        "uav 'uav_9' is unknown: expected one of uav_1, uav_2, uav_3")


def test_the_log_has_samples_and_events(fleet, station, tmp_path):
    path = tmp_path / 'log.jsonl'
    fleet.set_alive('uav_2', False)
    station.until(lambda received: len([r for r in lines(path) if r.get('event') == 'died']) == 1)
    sample = next(r for r in lines(path) if 'event' not in r)
    assert set(sample) == {'t', 'wall', 'clock', 'uav', 'x', 'y', 'z', 'battery', 'mode',
                           'alive'}
    assert sample['battery'] == 1.0
    died = next(r for r in lines(path) if r.get('event') == 'died')
    assert (died['uav'], died['x']) == ('uav_2', 20.0)


def test_vehicles_fly_and_send_on_while_the_process_stalls(fleet, station, tmp_path):
    def known(received):
        return [m.time_boot_ms for m in received
                if m.get_type() == 'ATTITUDE' and m.get_srcSystem() == 1]

    station.until(lambda received: len(known(received)) > 5)  # of the PX4, at 100 Hz
    with fleet._lock:
        begun = fleet.now()
        time.sleep(0.6)
    station.until(lambda received: known(received)[-1] > 1e3 * (begun + 8.0))
    for times in ([row['t'] for row in lines(tmp_path / 'log.jsonl')
                   if row['uav'] == 'uav_1' and 'event' not in row],
                  [1e-3 * t for t in known(station.received)]):
        assert max(b - a for a, b in pairwise(times)) < 1.0


@pytest.mark.parametrize(('text', 'address'), [
    ('127.0.0.1:14550', ('127.0.0.1', 14550)), ('udpout:host:1', ('host', 1))])
def test_a_target_is_a_host_and_a_port(text, address):
    assert to_address(text) == address


@pytest.mark.parametrize('text', ['', 'host', 'host:', ':1', 'host:x', 'host:70000'])
def test_a_bad_target_is_refused(text):
    with pytest.raises(InvalidValue, match=r'target = .*: expected HOST:PORT'):
        to_address(text)
