# SPDX-License-Identifier: Apache-2.0
"""Links that are silent, garbled, shared or cut, and hosts whose name is looked up."""
import os
import random
import select
import socket
import termios
import threading
import time

import pytest
from link_bench import heartbeat, receive

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.mavlink.transport.link import open_link


@pytest.fixture
def terminal():
    """A serial port: the end of the vehicle, and the path of the other end."""
    master, slave = os.openpty()
    yield master, os.ttyname(slave)
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize('name', ['/dev/ttyUSB0:0', 'tcp:127.0.0.1:0', 'tcp::5760',
                                  'udpout:127.0.0.1:0', 'udpout::14550'])
def test_a_baud_rate_port_or_host_that_is_none_is_refused(name):
    with pytest.raises(InvalidValue, match=r'connections = .*: expected '):
        open_link(name)


def test_a_host_of_udpout_that_is_unknown_is_named(monkeypatch):
    def unknown(_):
        raise socket.gaierror(-2, 'Name or service not known')

    monkeypatch.setattr(socket, 'gethostbyname', unknown)
    with pytest.raises(InvalidValue, match=r"'udpout:plane:14550': expected a known host \(.*N"):
        open_link('udpout:plane:14550')


@pytest.mark.parametrize(('path', 'text'), [
    ('/dev/null', 'Inappropriate ioctl for device: expected a serial port'),
    ('/', 'Is a directory: expected a serial port'),
    ('/dev/ttyNOPE', 'No such file or directory')])
def test_what_is_no_serial_port_is_said(make_connections, path, text):
    connections = make_connections(f'{path}:57600')
    connections.step(0.0)
    assert connections.links[0].trouble == text


def test_a_serial_port_without_permission_names_the_group(make_connections, monkeypatch):
    connections = make_connections('/dev/ttyUSB0:57600')

    def refuse(*_):
        raise PermissionError(13, 'Permission denied', '/dev/ttyUSB0')

    monkeypatch.setattr(os, 'open', refuse)
    connections.step(0.0)
    assert connections.links[0].trouble == (
        'Permission denied: expected a port that this user may read and write, as a member of '
        'its group (dialout)')


def test_a_serial_port_has_one_reader(make_connections, terminal):
    master, path = terminal
    first, second = make_connections(f'{path}:57600'), make_connections(f'{path}:115200')
    for one in (first, second):
        one.step(0.0)
    assert second.links[0].trouble.startswith('in use by another program')
    for _ in range(20):
        os.write(master, Codec(1, 1).pack(heartbeat()))
    assert len(receive(first, 20)) == 20
    first.close()
    second.step(10.0)
    os.write(master, Codec(1, 1).pack(heartbeat()))
    assert len(receive(second)) == 1
    assert second.links[0].trouble == ''


def test_a_serial_port_is_set_whatever_another_program_has_left(make_connections, terminal):
    _, path = terminal
    with open(path, 'rb', buffering=0) as port:
        left = termios.tcgetattr(port)
        left[2] = left[2] & ~(termios.CREAD | termios.CLOCAL) | termios.CSTOPB
        left[4] = left[5] = termios.B1200
        termios.tcsetattr(port, termios.TCSANOW, left)
        make_connections(f'{path}:57600').step(0.0)
        flags, speeds = (now := termios.tcgetattr(port))[2], now[4:6]
    assert speeds == [termios.B57600] * 2
    assert not flags & termios.CSTOPB
    assert flags & termios.CREAD
    assert flags & termios.CLOCAL


def test_a_device_without_the_baud_rate_is_said(make_connections, terminal, monkeypatch):
    connections = make_connections(f'{terminal[1]}:921600')
    monkeypatch.setattr(termios, 'tcsetattr', lambda *_: None)  # as a driver that ignores it
    connections.step(0.0)
    assert connections.links[0].trouble == 'the device has no such baud rate'


def warnings(connections, now):
    connections.step(now)
    return [traffic.warning for traffic in connections.traffic]


def test_a_wrong_baud_rate_is_said_of_its_link_only(make_connections, terminal):
    master, path = terminal
    server = socket.create_server(('127.0.0.1', 0))
    server.settimeout(60.0)
    connections = make_connections(f'{path}:57600', f'tcp:127.0.0.1:{server.getsockname()[1]}')
    assert warnings(connections, 0.0) == ['', '']
    remote, _ = server.accept()
    remote.sendall(Codec(1, 1).pack(heartbeat()))
    assert len(receive(connections)) == 1
    os.write(master, random.Random(1).randbytes(300))
    connections.receive(1.0)
    assert warnings(connections, 9.0) == ['', '']
    remote.sendall(Codec(1, 1).pack(heartbeat()))
    assert len(receive(connections)) == 1
    garbled, good = warnings(connections, 11.0)
    assert garbled.startswith('what is received is no MAVLink, or signed with another key')
    assert (good, connections.traffic[0].is_garbled) == ('', True)
    for _ in range(40):  # the parser may wait for the end of what it took for a frame
        os.write(master, Codec(1, 1).pack(heartbeat()))
    assert receive(connections)
    assert warnings(connections, 12.0) == ['', '']
    remote.close()
    server.close()


def test_a_link_on_which_nothing_comes_is_said_until_it_is_closed(make_connections, terminal):
    connections = make_connections(f'{terminal[1]}:57600', 'tcp:127.0.0.1:1')
    assert warnings(connections, 0.0) == ['', '']
    connections.receive(1.0)
    silent, refused = warnings(connections, 11.0)
    assert silent == 'no MAVLink message received for more than 10 s'
    assert refused == ''  # its trouble says why
    assert not connections.traffic[0].is_garbled


@pytest.mark.skipif(not hasattr(socket, 'TCP_USER_TIMEOUT'), reason='of Linux')
def test_a_tcp_peer_that_does_not_answer_is_given_up_within_seconds(make_connections):
    with socket.socket() as server:
        server.bind(('127.0.0.1', 0))
        server.listen(0)
        waiting = [socket.socket() for _ in range(3)]  # no room for one more
        for one in waiting:
            one.setblocking(False)
            one.connect_ex(server.getsockname())
        connections = make_connections(f'tcp:127.0.0.1:{server.getsockname()[1]}')
        connections.step(0.0)
        end = time.monotonic() + 30.0
        while not connections.links[0].trouble and time.monotonic() < end:
            connections.receive(0.1)
        assert connections.links[0].trouble == 'Connection timed out'
        for one in waiting:
            one.close()


@pytest.fixture
def names(monkeypatch):
    """names[host] is its address; `slow` is cleared while no name server answers."""
    known, slow = {}, threading.Event()
    slow.set()

    def find(host):
        slow.wait(60.0)
        if host not in known:
            raise socket.gaierror(-2, 'Name or service not known')
        return known[host]

    monkeypatch.setattr(socket, 'gethostbyname', find)
    monkeypatch.setattr('uav_task_alloc.mavlink.transport.host_lookup._START', 0.2)
    yield known, slow
    slow.set()


def test_no_other_link_waits_for_the_name_of_a_host(make_connections, make_remote, names):
    known, answers = names
    answers.clear()
    with socket.create_server(('127.0.0.1', 0)) as server:
        server.settimeout(60.0)
        connections = make_connections('udpin:127.0.0.1:0',
                                       f'tcp:plane:{server.getsockname()[1]}')
        remote = make_remote(connections)
        began = time.monotonic()
        for now in range(5):
            connections.step(float(now))
            remote.send(heartbeat())
            assert len(receive(connections)) == 1
        assert time.monotonic() - began < 30.0
        assert connections.links[1].trouble == 'its name is not looked up yet'
        answers.set()
        connections.links[1]._host._thread.join(60.0)
        connections.step(10.0)  # begins the next look-up
        assert connections.links[1].trouble == 'Name or service not known'
        known['plane'] = '127.0.0.1'
        connections.links[1]._host._thread.join(60.0)
        for now in (20.0, 30.0):
            connections.step(now)
            connections.links[1]._host._thread.join(60.0)
        peer, _ = server.accept()
        assert select.select([peer], [], [], 0.0)[0] == []
        peer.close()
