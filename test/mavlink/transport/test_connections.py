# SPDX-License-Identifier: Apache-2.0
"""The radio on real sockets: signing, the recording, the heartbeat."""
import os
import struct
import threading
import time

import pytest
from link_bench import WALL, heartbeat, nothing, receive
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


def test_fault_30_only_frames_signed_with_the_key_are_heard(connections, key_file, far):
    connections = connections(signing_key_file=key_file)
    stamp = int((WALL - 1420070400) * 1e5)
    good = far(connections, 1, make_signing(KEY, stamp + 10))
    frame = good.say(heartbeat())
    assert len(receive(connections)) == 1
    good.socket.sendto(frame, good.to)  # replayed, by the same sender
    assert nothing(connections)
    far(connections, 2).socket.sendto(frame, good.to)  # and by another
    assert nothing(connections)
    far(connections, 1).say(heartbeat())  # unsigned
    assert nothing(connections)
    far(connections, 1, make_signing(bytes(32), stamp + 10**6)).say(heartbeat())  # another key
    assert nothing(connections)
    good.say(heartbeat())  # the forger has not locked it out
    assert len(receive(connections)) == 1
    assert connections.errors() == 4


def test_fault_30_the_timestamp_survives_a_restart(connections, key_file, tmp_path, far):
    first = connections(signing_key_file=key_file)
    end = far(first, 1, make_signing(KEY, 10**14))
    end.say(heartbeat())
    receive(first)
    first.step(0.0)
    kept = int((tmp_path / 'key.timestamp').read_text())
    assert kept > 10**14
    second = connections(signing_key_file=key_file)
    assert second.signing.incoming.timestamp == kept


@pytest.mark.parametrize(('content', 'key'), [
    (KEY, KEY), (KEY.hex().encode() + b'\n', KEY),
    (b'open sesame\n', b'\xa8\xf8'), ])
def test_a_key_file_is_raw_hex_or_a_pass_phrase(tmp_path, content, key):
    path = tmp_path / 'key'
    path.write_bytes(content)
    found = read_key(str(path))
    assert len(found) == 32
    assert found == key or content.startswith(b'open')


def test_an_empty_key_file_is_refused(tmp_path):
    (tmp_path / 'key').write_bytes(b'')
    with pytest.raises(InvalidValue, match='not empty'):
        read_key(str(tmp_path / 'key'))


def test_a_tlog_holds_every_frame_both_ways_with_its_time(connections, tmp_path, far):
    connections = connections(tlog=str(tmp_path / 'x.tlog'))
    end = far(connections)
    frames = [end.say(heartbeat()), end.say(d.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0))]
    receive(connections)
    connections.receive(0.2)  # both may have come at once
    connections.send_to_all(heartbeat())
    frames.append(end.socket.recv(1000))
    connections.close()
    data = (tmp_path / 'x.tlog').read_bytes()
    stamp = struct.pack('>Q', int(WALL * 1e6))
    assert data == b''.join(stamp + f for f in frames)


@pytest.mark.skipif(not os.path.exists('/dev/full'), reason='there is no /dev/full')
def test_a_full_disk_ends_the_recording_and_nothing_else(connections, far):
    connections = connections(tlog='/dev/full')
    end = far(connections)
    end.say(heartbeat())
    receive(connections)
    for _ in range(1000):
        connections.send_to_all(heartbeat())
    assert end.hear()[0].get_type() == 'HEARTBEAT'


def test_a_recording_that_cannot_be_written_is_refused():
    with pytest.raises(InvalidValue, match="tlog = '/nowhere/x': expected a file that can be"):
        open_record('/nowhere/x')


def test_fault_31_the_heart_beats_while_the_node_is_busy(connections, far):
    connections = connections()
    end = far(connections)
    end.say(heartbeat())
    receive(connections)
    busy = threading.Lock()  # that of the node, held all the time
    heart = Heartbeat(connections.send_to_all, period=0.02)
    with busy:
        heart.start()
        beats = [end.hear()[0] for _ in range(10)]
    heart.close()
    assert {m.get_type() for m in beats} == {'HEARTBEAT'}
    assert {m.get_srcSystem() for m in beats} == {245}


class OneAtATime:
    """A link that notices when two threads are in it."""

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

    def ends(self):
        return ['y']

    def close(self):
        os.close(self._read)
        os.close(self._write)


def test_a_beat_never_writes_to_a_line_that_is_read_or_opened_again():
    link = OneAtATime()
    connections = Connections([link], 245, 190, wall=lambda: WALL)
    heart = Heartbeat(connections.send_to_all, period=0.001)
    heart.start()
    for now in range(50):
        connections.step(float(now))
        connections.receive(0.0)
    heart.close()
    connections.close()
    assert link.collisions == 0
