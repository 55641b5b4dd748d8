# SPDX-License-Identifier: Apache-2.0
"""Connections on real sockets: signing, the recording, the heartbeat."""
import os
import struct
import threading
import time

import pytest
from link_bench import WALL, heartbeat, nothing_received, receive
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.transport.codec import make_signing
from uav_task_alloc.mavlink.transport.connections import Connections, open_record
from uav_task_alloc.mavlink.transport.heartbeat import Heartbeat
from uav_task_alloc.mavlink.transport.signing import read_key

KEY = bytes(range(32))


@pytest.fixture
def key_file(tmp_path):
    path = tmp_path / 'key'
    path.write_bytes(KEY)
    return str(path)


def test_fault_30_only_frames_signed_with_the_key_are_accepted(
        make_connections, key_file, make_remote):
    connections = make_connections(signing_key_file=key_file)
    stamp = int((WALL - 1420070400) * 1e5)
    good = make_remote(connections, 1, make_signing(KEY, stamp + 10))
    frame = good.send(heartbeat())
    assert len(receive(connections)) == 1
    good.socket.sendto(frame, good.to)  # replayed, by the same sender
    assert nothing_received(connections)
    make_remote(connections, 2).socket.sendto(frame, good.to)  # and by another
    assert nothing_received(connections)
    make_remote(connections, 1).send(heartbeat())  # unsigned
    assert nothing_received(connections)
    other_key = make_signing(bytes(32), stamp + 10**6)
    make_remote(connections, 1, other_key).send(heartbeat())
    assert nothing_received(connections)
    good.send(heartbeat())  # the forged frame has not locked it out
    assert len(receive(connections)) == 1
    assert connections.errors() == 4


def test_fault_30_the_timestamp_survives_a_restart(
        make_connections, key_file, tmp_path, make_remote):
    first = make_connections(signing_key_file=key_file)
    remote = make_remote(first, 1, make_signing(KEY, 10**14))
    remote.send(heartbeat())
    receive(first)
    first.step(0.0)
    kept = int((tmp_path / 'key.timestamp').read_text())
    assert kept > 10**14
    second = make_connections(signing_key_file=key_file)
    assert second.signing.incoming.timestamp == kept


@pytest.mark.parametrize(('content', 'key'), [
    (KEY, KEY), (KEY.hex().encode() + b'\n', KEY),
    (b'open sesame\n', b'\xa8\xf8'), ])
def test_a_key_file_is_raw_hex_or_a_pass_phrase(tmp_path, content, key):
    path = tmp_path / 'key'
    path.write_bytes(content)
    read = read_key(str(path))
    assert len(read) == 32
    assert read == key or content.startswith(b'open')


def test_an_empty_key_file_is_refused(tmp_path):
    (tmp_path / 'key').write_bytes(b'')
    with pytest.raises(InvalidValue, match='not empty'):
        read_key(str(tmp_path / 'key'))


def test_a_tlog_holds_every_frame_both_ways_with_its_time(make_connections, tmp_path, make_remote):
    connections = make_connections(tlog=str(tmp_path / 'x.tlog'))
    remote = make_remote(connections)
    frames = [remote.send(heartbeat()),
              remote.send(d.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0))]
    receive(connections)
    connections.receive(0.2)  # both may have come at once
    connections.send_to_all(heartbeat())
    frames.append(remote.socket.recv(1000))
    connections.close()
    data = (tmp_path / 'x.tlog').read_bytes()
    stamp = struct.pack('>Q', int(WALL * 1e6))
    assert data == b''.join(stamp + f for f in frames)


@pytest.mark.skipif(not os.path.exists('/dev/full'), reason='there is no /dev/full')
def test_a_full_disk_ends_the_recording_only(make_connections, make_remote):
    connections = make_connections(tlog='/dev/full')
    remote = make_remote(connections)
    remote.send(heartbeat())
    receive(connections)
    for _ in range(1000):
        connections.send_to_all(heartbeat())
    assert remote.receive()[0].get_type() == 'HEARTBEAT'
    assert connections.record_error == 'No space left on device: no more frames are recorded'


def test_a_recording_that_cannot_be_written_is_refused():
    with pytest.raises(InvalidValue, match="tlog = '/nowhere/x': expected a file that can be"):
        open_record('/nowhere/x')


def test_fault_31_heartbeats_are_sent_while_the_node_is_busy(make_connections, make_remote):
    connections = make_connections()
    remote = make_remote(connections)
    remote.send(heartbeat())
    receive(connections)
    busy = threading.Lock()  # that of the node, held all the time
    sender = Heartbeat(connections.send_to_all, period=0.02)
    with busy:
        sender.start()
        messages = [remote.receive()[0] for _ in range(10)]
    sender.close()
    assert {m.get_type() for m in messages} == {'HEARTBEAT'}
    assert {m.get_srcSystem() for m in messages} == {245}


class OneAtATime:
    """A link that counts concurrent calls."""

    name, datagrams, opened, trouble = 'x', True, 1, ''

    def __init__(self):
        self.inside, self.collisions = threading.Lock(), 0
        self._read, self._write = os.pipe()
        os.write(self._write, b'x')  # always something to read

    def use(self, *_):
        if not self.inside.acquire(blocking=False):
            self.collisions += 1
            return []
        time.sleep(0.002)
        self.inside.release()
        return []

    read = write = step = use

    def fileno(self):
        return self._read

    def remotes(self):
        return ['y']

    def close(self):
        os.close(self._read)
        os.close(self._write)


def test_a_heartbeat_is_never_written_to_a_link_being_read_or_reopened():
    link = OneAtATime()
    connections = Connections([link], 245, 190, wall=lambda: WALL)
    sender = Heartbeat(connections.send_to_all, period=0.001)
    sender.start()
    for now in range(50):
        connections.step(float(now))
        connections.receive(0.0)
    sender.close()
    connections.close()
    assert link.collisions == 0
