# SPDX-License-Identifier: Apache-2.0
"""Links on real sockets: routing, and links that fail."""
import os
import random
import socket

import pytest
from link_bench import heartbeat, nothing_received, receive
from mission_bench import ORIGIN
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.gcs.ground_station import GcsConfig, GroundStation
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.mavlink.transport.link import Serial, open_link


def test_an_answer_goes_only_to_the_address_of_its_system(make_connections, make_remote):
    connections = make_connections()
    one, two = make_remote(connections, 1), make_remote(connections, 2)
    for remote in (one, two):
        remote.send(heartbeat())
    by_system = {m.get_srcSystem(): a for a, m in receive(connections, 2)}
    connections.send([(by_system[2], d.MAVLink_mission_request_list_message(2, 1, 0))])
    assert two.receive()[0].target_system == 2
    one.socket.setblocking(False)
    with pytest.raises(BlockingIOError):
        one.receive()


def test_a_corrupt_datagram_does_not_affect_the_next(make_connections, make_remote):
    connections = make_connections()
    remote = make_remote(connections)
    frame = remote.codec.pack(heartbeat())
    remote.socket.sendto(frame[:7], remote.to)
    remote.send(heartbeat())
    assert [m.get_type() for _, m in receive(connections)] == ['HEARTBEAT']


def test_two_bridges_cannot_bind_the_same_port(make_connections):
    first = make_connections()
    with pytest.raises(InvalidValue, match='expected a free port'):
        open_link(f'udpin:127.0.0.1:{first.links[0].port}')


@pytest.mark.parametrize('name', ['', 'udpin', 'udpin:host', 'udp:127.0.0.1:1', 'udpin:h:port',
                                  'tcp:127.0.0.1:70000', '/dev/ttyUSB0', '/dev/ttyUSB0:12345'])
def test_a_malformed_link_name_is_refused_in_words(name):
    with pytest.raises(InvalidValue, match='connections = '):
        open_link(name)


def test_udpout_sends_first(make_connections):
    remote = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    remote.bind(('127.0.0.1', 0))
    remote.settimeout(60.0)
    out = make_connections(f'udpout:127.0.0.1:{remote.getsockname()[1]}')
    out.send_to_all(heartbeat())
    data, address = remote.recvfrom(1000)
    assert Codec(1, 1).parse(data)[0].get_srcSystem() == 245
    remote.sendto(Codec(1, 1).pack(heartbeat()), address)
    assert receive(out)[0][1].get_srcSystem() == 1
    remote.close()


def test_tcp_reconnects_after_the_connection_is_lost(make_connections):
    server = socket.create_server(('127.0.0.1', 0))
    server.settimeout(60.0)
    connections = make_connections(f'tcp:127.0.0.1:{server.getsockname()[1]}')
    for now in (0.0, 10.0):
        connections.step(now)
        remote, _ = server.accept()
        frame = Codec(1, 1).pack(heartbeat())
        remote.sendall(frame[:5])
        assert nothing_received(connections)
        remote.sendall(frame[5:])
        assert len(receive(connections)) == 1
        connections.send_to_all(heartbeat())
        remote.settimeout(60.0)
        assert Codec(1, 1).parse(remote.recv(1000))
        remote.close()
        assert nothing_received(connections)
        assert connections.links[0].fileno() == -1
    server.close()


def test_a_refused_tcp_connection_is_retried(make_connections):
    connections = make_connections('tcp:127.0.0.1:1')
    for now in range(3):
        connections.step(float(now))
        assert nothing_received(connections)
    assert connections.links[0].trouble == 'Connection refused'


def test_a_missing_serial_port_is_reported(make_connections):
    connections = make_connections('/dev/ttyNOPE:57600')
    assert connections.links[0].trouble == ''
    connections.step(0.0)
    assert connections.links[0].trouble == 'No such file or directory'


def test_a_serial_port_carries_frames(make_connections):
    master, slave = os.openpty()
    connections = make_connections(f'{os.ttyname(slave)}:57600')
    connections.step(0.0)
    os.write(master, Codec(1, 1).pack(heartbeat()))
    assert len(receive(connections)) == 1
    connections.send_to_all(heartbeat())
    assert Codec(1, 1).parse(os.read(master, 1000))[0].get_srcSystem() == 245
    os.close(master)
    os.close(slave)


def test_a_full_stream_drops_instead_of_blocking():
    port = Serial('x', '/nowhere', 57600)
    read, write = os.pipe()
    os.set_blocking(write, False)
    port._file = write
    for _ in range(1000):
        port.write('x', bytes(1000))
    assert len(port._send_buffer) <= 65536
    os.close(read)
    port.close()


def make_station():
    return GroundStation(GcsConfig(origin=ORIGIN), random.Random(0))


def received(message, system=1, component=1):
    return Codec(245, 190).parse(Codec(system, component).pack(message))[0]


@pytest.mark.parametrize(('message', 'system', 'component'), [
    (d.MAVLink_heartbeat_message(d.MAV_TYPE_GCS, 8, 0, 0, 4, 3), 255, 190),
    (heartbeat(), 1, 154), (heartbeat(), 245, 1),
    (d.MAVLink_heartbeat_message(d.MAV_TYPE_GIMBAL, 8, 0, 0, 4, 3), 1, 1)])
def test_ground_stations_and_gimbals_are_no_uavs(message, system, component):
    station = make_station()
    station.receive('a', received(message, system, component), 0.0)
    assert station.sessions == {}


def test_the_same_system_from_another_address_is_a_stray_until_the_first_is_silent():
    station = make_station()
    station.receive('a', received(heartbeat()), 0.0)
    station.receive('b', received(heartbeat()), 1.0)
    assert (station.sessions[1].address, station.sessions[1].strays) == ('a', 1)
    station.receive('b', received(heartbeat()), 5.0)
    assert station.sessions[1].address == 'b'
