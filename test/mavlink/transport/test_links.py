# SPDX-License-Identifier: Apache-2.0
"""Links on real sockets: who hears what, and lines that break."""
import os
import socket

import pytest
from link_bench import heartbeat, nothing, receive
from mission_bench import ORIGIN
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.gcs.ground_station import GcsConfig, GroundStation
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.mavlink.transport.link import Serial, open_link


def test_an_answer_goes_only_where_the_system_was_heard(connections, far):
    connections = connections()
    one, two = far(connections, 1), far(connections, 2)
    for end in (one, two):
        end.say(heartbeat())
    by_system = {m.get_srcSystem(): a for a, m in receive(connections, 2)}
    connections.send([(by_system[2], d.MAVLink_mission_request_list_message(2, 1, 0))])
    assert two.hear()[0].target_system == 2
    one.socket.setblocking(False)
    with pytest.raises(BlockingIOError):
        one.hear()


def test_a_damaged_datagram_does_not_spoil_the_next(connections, far):
    connections = connections()
    end = far(connections)
    frame = end.codec.pack(heartbeat())
    end.socket.sendto(frame[:7], end.to)
    end.say(heartbeat())
    assert [m.get_type() for _, m in receive(connections)] == ['HEARTBEAT']


def test_two_bridges_cannot_bind_the_same_port(connections):
    first = connections()
    with pytest.raises(InvalidValue, match='expected a free port'):
        open_link(f'udpin:127.0.0.1:{first.links[0].port}')


@pytest.mark.parametrize('name', ['', 'udpin', 'udpin:host', 'udp:127.0.0.1:1', 'udpin:h:port',
                                  'tcp:127.0.0.1:70000', '/dev/ttyUSB0', '/dev/ttyUSB0:12345'])
def test_a_link_that_is_none_is_refused_in_words(name):
    with pytest.raises(InvalidValue, match='connections = '):
        open_link(name)


def test_udpout_speaks_first(connections):
    far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    far.bind(('127.0.0.1', 0))
    far.settimeout(5.0)
    out = connections(f'udpout:127.0.0.1:{far.getsockname()[1]}')
    out.send_to_all(heartbeat())
    data, address = far.recvfrom(1000)
    assert Codec(1, 1).parse(data)[0].get_srcSystem() == 245
    far.sendto(Codec(1, 1).pack(heartbeat()), address)
    assert receive(out)[0][1].get_srcSystem() == 1
    far.close()


def test_tcp_connects_again_after_the_line_broke(connections):
    server = socket.create_server(('127.0.0.1', 0))
    server.settimeout(5.0)
    line = connections(f'tcp:127.0.0.1:{server.getsockname()[1]}')
    for now in (0.0, 10.0):
        line.step(now)
        far, _ = server.accept()
        frame = Codec(1, 1).pack(heartbeat())
        far.sendall(frame[:5])
        assert nothing(line)
        far.sendall(frame[5:])
        assert len(receive(line)) == 1
        line.send_to_all(heartbeat())
        far.settimeout(5.0)
        assert Codec(1, 1).parse(far.recv(1000))
        far.close()
        assert nothing(line)
        assert line.links[0].fileno() == -1
    server.close()


def test_a_refused_tcp_connection_is_tried_again_and_harms_nothing(connections):
    line = connections('tcp:127.0.0.1:1')
    for now in range(3):
        line.step(float(now))
        assert nothing(line)
    assert line.links[0].trouble == 'Connection refused'


def test_a_serial_line_that_is_not_there_says_so(connections):
    line = connections('/dev/ttyNOPE:57600')
    assert line.links[0].trouble == ''
    line.step(0.0)
    assert line.links[0].trouble == 'No such file or directory'


def test_a_serial_line_carries_frames(connections):
    master, slave = os.openpty()
    line = connections(f'{os.ttyname(slave)}:57600')
    line.step(0.0)
    os.write(master, Codec(1, 1).pack(heartbeat()))
    assert len(receive(line)) == 1
    line.send_to_all(heartbeat())
    assert Codec(1, 1).parse(os.read(master, 1000))[0].get_srcSystem() == 245
    os.close(master)
    os.close(slave)


def test_a_full_line_drops_instead_of_blocking():
    line = Serial('x', '/nowhere', 57600)
    read, write = os.pipe()
    os.set_blocking(write, False)
    line._file = write
    for _ in range(1000):
        line.write('x', bytes(1000))
    assert len(line._waiting) <= 65536
    os.close(read)
    line.close()


def ground():
    import random
    return GroundStation(GcsConfig(origin=ORIGIN), random.Random(0))


def heard(message, system=1, component=1):
    return Codec(245, 190).parse(Codec(system, component).pack(message))[0]


@pytest.mark.parametrize(('message', 'system', 'component'), [
    (d.MAVLink_heartbeat_message(d.MAV_TYPE_GCS, 8, 0, 0, 4, 3), 255, 190),
    (heartbeat(), 1, 154), (heartbeat(), 245, 1),
    (d.MAVLink_heartbeat_message(d.MAV_TYPE_GIMBAL, 8, 0, 0, 4, 3), 1, 1)])
def test_ground_stations_and_gimbals_are_no_uavs(message, system, component):
    station = ground()
    station.receive('a', heard(message, system, component), 0.0)
    assert station.sessions == {}


def test_the_same_system_from_another_address_is_a_stray_until_the_first_is_silent():
    station = ground()
    station.receive('a', heard(heartbeat()), 0.0)
    station.receive('b', heard(heartbeat()), 1.0)
    assert (station.sessions[1].address, station.sessions[1].strays) == ('a', 1)
    station.receive('b', heard(heartbeat()), 5.0)
    assert station.sessions[1].address == 'b'
