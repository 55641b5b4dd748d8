# SPDX-License-Identifier: Apache-2.0
"""Findings 11 to 13 and 24: links that fail, heartbeats, signing, floods of remotes."""
import os
import socket
import threading

import pytest
from link_bench import WALL, heartbeat, nothing_received, receive
from mission_bench import ORIGIN

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.mavlink.transport.connections import Connections
from uav_task_alloc.mavlink.transport.heartbeat import Heartbeat
from uav_task_alloc.mavlink.transport.link import MAX_UNCONFIRMED
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.udp_fleet import UdpFleet


@pytest.fixture
def servers():
    """Two TCP servers; the first one does not listen yet."""
    sockets = [socket.socket(), socket.socket()]
    for one in sockets:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        one.bind(('127.0.0.1', 0))
        one.settimeout(60.0)
    yield sockets
    for one in sockets:
        one.close()


def free_until(number):
    """Occupy all free file numbers below `number`, so that the next open file gets it."""
    held = [os.dup(0)]
    while held[-1] < number:
        held.append(os.dup(0))
    os.close(held.pop())
    return held


# 11: a file number that is reused by another link


def test_finding_11_a_file_number_may_be_reused_by_another_link(make_connections, servers):
    one = make_connections(*(f'tcp:127.0.0.1:{s.getsockname()[1]}' for s in servers))
    two = servers[1]
    first, second = one.links
    two.listen()
    one.step(0.0)  # the first is refused, the second is connected
    remote, _ = two.accept()
    assert nothing_received(one)
    assert first.fileno() == -1
    number = second.fileno()
    remote.close()
    held = free_until(number)
    second._broken('closed by the remote')  # as a heartbeat does on a failed link
    servers[0].listen()
    one.step(10.0)
    for file in held:
        os.close(file)
    assert first.fileno() == number
    remote, _ = servers[0].accept()
    remote.sendall(Codec(1, 1).pack(heartbeat()))
    assert [address[0] for address, _ in receive(one)] == [0]
    remote.close()


def test_finding_11_two_links_may_exchange_their_file_numbers(make_connections, servers):
    one = make_connections(*(f'tcp:127.0.0.1:{s.getsockname()[1]}' for s in servers))
    for server in servers:
        server.listen()
    one.step(0.0)
    remotes = [server.accept()[0] for server in servers]
    assert nothing_received(one)
    first, second = one.links
    first._file, second._file = second._file, first._file  # as if both were reopened
    first.opened, second.opened = 2, 2
    for number, remote in enumerate(remotes):
        remote.sendall(Codec(1, 1).pack(heartbeat()))
        assert [address[0] for address, _ in receive(one)] == [1 - number]
        remote.close()


def test_finding_11_a_link_closed_by_a_sender_is_not_read(make_connections, servers):
    servers[0].listen()
    one = make_connections(f'tcp:127.0.0.1:{servers[0].getsockname()[1]}')
    one.step(0.0)
    assert nothing_received(one)
    link, = one.links
    link.trouble = 'Broken pipe'
    link.close()
    assert link.read() == []
    assert link.trouble == 'Broken pipe'


# 12: one stream, two threads


class LockChecked:
    """A link that records what is called while the lock of its connections is free."""

    name, datagrams, trouble = 'x', False, ''

    def __init__(self):
        self.connections, self.unlocked = None, []
        self.files = os.pipe()
        os.write(self.files[1], b'x')  # always something to read

    def __getattr__(self, name):
        if not self.connections._lock.locked():
            self.unlocked.append(name)
        return {'fileno': lambda: self.files[0], 'opened': 1, 'read': lambda: [('y', b'x')],
                'remotes': lambda: ['y']}.get(name, lambda *_: None)


def test_finding_12_no_link_is_used_without_the_lock(tmp_path):
    link = LockChecked()
    connections = link.connections = Connections(
        [link], 245, 190, wall=lambda: WALL, tlog=str(tmp_path / 'x.tlog')
    )
    connections.step(0.0)
    connections.receive(0.0)
    connections.send_to_all(heartbeat())
    connections.send([((0, 'y'), heartbeat())])
    connections.close()
    for file in link.files:
        os.close(file)
    assert link.unlocked == []


def test_finding_12_an_error_on_one_link_leaves_the_heartbeats_of_the_others(
        make_connections, make_remote):
    both = make_connections('udpin:127.0.0.1:0', 'udpin:127.0.0.1:0')
    remote = make_remote(both)
    remote.send(heartbeat())
    receive(both)
    both.links.reverse()  # the failing one comes first

    def write(remote, data):
        raise BufferError('Existing exports of data: object cannot be re-sized')
    both.links[0].remotes, both.links[0].write = lambda: ['x'], write
    both.send_to_all(heartbeat())
    assert remote.receive()[0].get_type() == 'HEARTBEAT'
    assert 'HEARTBEAT (to x): BufferError: Existing exports' in both.refusals.last


def test_finding_12_a_recording_that_ends_in_one_thread_does_not_end_the_other(
        make_connections, tmp_path):
    one = make_connections(tlog=str(tmp_path / 'x.tlog'))
    one._record.close()  # as the receiver does on a full disk
    one._write_record(b'x')
    assert one._record is None


@pytest.fixture
def heartbeats():
    """A heartbeat whose first two messages fail, and a semaphore of those that succeed."""
    failing, sent = [BufferError('x'), RuntimeError('y')], threading.Semaphore(0)

    def send(message):
        if failing:
            raise failing.pop(0)
        sent.release()
    heartbeats = Heartbeat(send, period=0.01)
    yield heartbeats, sent
    heartbeats.close()


def wait_for_end(heartbeats):
    """Wait for the end of its thread."""
    heartbeats._thread.join(5.0)
    assert not heartbeats._thread.is_alive()


def test_finding_12_a_heartbeat_thread_that_ends_is_reported_and_restarted(heartbeats):
    sender, sent = heartbeats
    sender.start()
    for number, words in enumerate(('BufferError: x', 'RuntimeError: y'), 1):
        wait_for_end(sender)
        assert sender.trouble.startswith(f'its thread has ended: {words} (at ')
        sender.watch(float(number))
        assert sender.restarts == number
    assert sent.acquire(timeout=60.0)
    assert sent.acquire(timeout=60.0)
    assert sender.trouble == ''
    sender.watch(10.0)
    assert sender.restarts == 2


def test_finding_12_a_heartbeat_that_is_blocked_is_reported():
    free = threading.Event()
    sender = Heartbeat(lambda message: free.wait(5.0), period=0.01)
    sender.start()
    sender.watch(0.0)
    sender.watch(0.02)
    assert sender.trouble == ''
    sender.watch(0.04)
    assert sender.trouble == 'none was sent for more than 0.03 s'
    free.set()
    sender.close()
    assert sender.restarts == 0


# 13: the timestamp of signing


@pytest.fixture
def key_file(tmp_path):
    path = tmp_path / 'key'
    path.write_bytes(bytes(range(32)))
    return path


def forbid(key_file):
    """Make the timestamp of a key impossible to replace or write, also for root."""
    key_file.with_name('key.timestamp.tmp').mkdir()
    stamp = key_file.with_name('key.timestamp')
    stamp.unlink(missing_ok=True)
    stamp.symlink_to('/nowhere/at/all')


@pytest.mark.parametrize('content', [b'', b'soon', b'-1', b'12 34', b'1e5', b'\xff\x00', b'9' * 40,
                                     b'281474976710656'])
def test_finding_13_a_damaged_timestamp_is_refused_at_the_start(
        make_connections, key_file, content):
    path = key_file.with_name('key.timestamp')
    path.write_bytes(content)
    with pytest.raises(InvalidValue) as refused:
        make_connections(signing_key_file=str(key_file))
    assert str(refused.value).startswith(f'signing timestamp in {path} = ')
    assert 'expected a whole number in [0, 281474976710655]; delete the file' in str(refused.value)
    assert path.read_bytes() == content


def test_finding_13_a_timestamp_that_cannot_be_read_is_refused_at_the_start(
        make_connections, key_file):
    key_file.with_name('key.timestamp').mkdir()
    with pytest.raises(InvalidValue, match=r'signing timestamp = .*: expected a readable file'):
        make_connections(signing_key_file=str(key_file))


def test_finding_13_a_timestamp_that_cannot_be_written_is_refused_at_the_start(
        make_connections, key_file):
    forbid(key_file)
    with pytest.raises(InvalidValue, match=r'signing timestamp = .*: expected a file that can be'):
        make_connections(signing_key_file=str(key_file))


def test_finding_13_a_timestamp_that_cannot_be_written_in_flight_is_reported(
        make_connections, make_remote, key_file):
    one = make_connections(signing_key_file=str(key_file))
    one.step(0.0)
    assert one.signing.trouble == ''
    forbid(key_file)
    one.step(10.0)
    assert 'key.timestamp: not written: ' in one.signing.trouble
    before = one.signing.outgoing.timestamp
    one.send([((0, ('127.0.0.1', 9)), heartbeat())])
    assert one.signing.outgoing.timestamp == before + 1
    key_file.with_name('key.timestamp.tmp').rmdir()
    one.step(12.0)
    assert one.signing.trouble != ''  # the next attempt is after 5 s
    one.step(15.0)
    assert one.signing.trouble == ''
    assert int(key_file.with_name('key.timestamp').read_text()) > before


def test_finding_13_a_file_in_a_folder_that_is_read_only_is_written_in_place(
        make_connections, key_file):
    key_file.with_name('key.timestamp.tmp').mkdir()
    make_connections(signing_key_file=str(key_file))
    assert key_file.with_name('key.timestamp').read_text().isdigit()


def test_finding_13_a_computer_whose_clock_was_never_set_signs(key_file):
    one = Connections([], 245, 190, wall=lambda: 0.0, signing_key_file=str(key_file))
    one.step(0.0)
    assert one._encoder.pack(heartbeat())
    one.close()


# 24: a flood of remotes


def flood(connections, count, data=b'\xfd\x00x'):
    """As many unknown senders send something."""
    to = ('127.0.0.1', connections.links[0].port)
    for _ in range(count):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.bind(('127.0.0.1', 0))
            sender.sendto(data, to)
            connections.receive(5.0)


def test_finding_24_of_unknown_senders_only_the_latest_receive_heartbeats(
        make_connections, make_remote):
    one = make_connections()
    flood(one, 200)
    last = make_remote(one, 9)
    last.send(heartbeat())
    receive(one)
    assert len(one.links[0].remotes()) == MAX_UNCONFIRMED
    assert len(one._parsers) <= MAX_UNCONFIRMED + 1
    one.send_to_all(heartbeat())
    assert last.receive()[0].get_type() == 'HEARTBEAT'


def test_finding_24_a_known_vehicle_is_not_removed_for_unknown_senders(
        make_connections, make_remote):
    one = make_connections()
    vehicles = [make_remote(one, system) for system in range(1, 41)]  # > MAX_UNCONFIRMED
    known = set()
    for vehicle in vehicles:
        vehicle.send(heartbeat())
        known |= {address for address, _ in receive(one)}
        one.keep(known)
    parsers = {address: one._parsers[address] for address in known}
    flood(one, 200)
    assert {(0, remote) for remote in one.links[0].remotes()} > known
    assert len(one.links[0].remotes()) == 40 + MAX_UNCONFIRMED
    assert all(one._parsers[address] is parsers[address] for address in known)
    one.send_to_all(heartbeat())
    assert {vehicle.receive()[0].get_type() for vehicle in vehicles} == {'HEARTBEAT'}


def test_finding_24_a_configured_remote_is_not_removed(make_connections):
    remote = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    remote.bind(('127.0.0.1', 0))
    one = make_connections(f'udpout:127.0.0.1:{remote.getsockname()[1]}')
    one.keep(())
    flood(one, 100)
    assert remote.getsockname() in one.links[0].remotes()
    remote.close()


def test_finding_24_refused_frames_are_counted_after_their_sender_is_removed(make_connections):
    one = make_connections()
    flood(one, 100, b'xxx')
    assert one.errors() == 100


def test_finding_24_a_simulated_vehicle_sends_to_its_target_and_the_latest_stations():
    fleet = UdpFleet([(VehicleConfig('uav_1', 1, ORIGIN, (0.0, 0.0, 0.0)), 'px4')],
                  ('127.0.0.1', 9))
    to = ('127.0.0.1', fleet.ports['uav_1'])
    endpoint = fleet._endpoints['uav_1']
    for _ in range(100):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.bind(('127.0.0.1', 0))
            sender.sendto(b'x', to)
            endpoint.receive(0.0)
    fleet.close()
    assert len(endpoint._parsers) == 17
    assert ('127.0.0.1', 9) in endpoint._parsers
