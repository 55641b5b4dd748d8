# SPDX-License-Identifier: Apache-2.0
"""The bridge in this process: failures of its threads, and hostile messages."""
import socket
import time

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from hostile_streams import stream
from pymavlink.dialects.v20 import ardupilotmega as d
from rclpy.executors import SingleThreadedExecutor
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator.list_records import ListStop
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.mavlink.transport.link import MAX_UNCONFIRMED
from uav_task_alloc.model import Leg, Task
from uav_task_alloc.nodes.conversions.messages import planned_task
from uav_task_alloc.nodes.mavlink_bridge import MavlinkBridge

pytestmark = pytest.mark.ros
HEARTBEAT = d.MAVLink_heartbeat_message(d.MAV_TYPE_QUADROTOR, d.MAV_AUTOPILOT_PX4, 0, 0, 4, 3)


class Bridge:
    """A bridge with its log in lists, and one remote that it knows."""

    def __init__(self):
        self.node = MavlinkBridge()
        self.log = {level: [] for level in self.node.log.levels}
        self.node.log.levels.update({level: lines.append for level, lines in self.log.items()})
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.remote = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.remote.bind(('127.0.0.1', 0))
        self.remote.settimeout(60.0)
        self.codec = Codec(1, 1)

    def send(self, *messages):
        for message in messages:
            self.remote.sendto(self.codec.pack(message),
                            ('127.0.0.1', self.node.connections.links[0].port))

    def received(self, kind):
        """The next message of a type that it sends to the remote."""
        while True:
            for message in self.codec.parse(self.remote.recv(65536)):
                if message.get_type() == kind:
                    return message

    def until(self, condition):
        end = time.monotonic() + 90.0
        while not condition():
            assert time.monotonic() < end, f'timed out: {self.log}'
            self.executor.spin_once(timeout_sec=0.05)

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        self.remote.close()


@pytest.fixture
def bridge(domain):
    """bridge('-p', 'name:=value') -> Bridge; closed at the end."""
    made = []

    def make(*args):
        rclpy.init(args=['--ros-args', '-p', "connections:=['udpin:127.0.0.1:0']", *args])
        made.append(Bridge())
        return made[-1]
    yield make
    for one in made:
        one.close()
    rclpy.try_shutdown()


def fact(health, name):
    """Level, line and details of a status; None where there is none yet."""
    return next(((ord(s.level), s.message, {v.key: v.value for v in s.values})
                 for array in health[-1:] for s in array.status if s.hardware_id == name), None)


def test_the_authority_in_a_state_is_stored_before_it_is_published(bridge, monkeypatch):
    """A message may have changed it since the last step, which stores it."""
    one = bridge()
    one.send(HEARTBEAT)
    one.until(lambda: one.node.ground_station.sessions)
    session, calls = one.node.ground_station.sessions[1], []
    one.node.closing = True  # ends the thread that publishes
    one.node.receiver.join(60.0)
    session.executor.telemetry.position_at = time.monotonic()
    monkeypatch.setattr(session.executor.watch, 'save_record', lambda: calls.append('stored'))
    monkeypatch.setattr(one.node.states, 'publish', lambda _: calls.append('published'))
    one.node.publish_state(session, time.monotonic())
    assert calls == ['stored', 'published']


def test_finding_12_a_heartbeat_thread_that_ends_is_reported_and_restarted(bridge, probe):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    one = bridge()
    heart = one.node.heartbeat
    good = heart._send

    def bad(message):
        heart._send = good
        raise BufferError('Existing exports of data')
    heart._send = bad
    one.send(HEARTBEAT)
    one.until(lambda: heart.restarts == 1)
    assert one.received('HEARTBEAT').get_srcSystem() == 245
    one.until(lambda: 'heartbeat: works' in one.log['info'])
    line, = one.log['error']
    assert line.startswith('heartbeat: its thread has ended: BufferError: Existing exports of')
    one.until(lambda: not probe.executor.spin_once(timeout_sec=0.0) and (
        fact(health, 'heartbeat') or [0, 0, {}])[2].get('thread_restarts') == '1')


def test_finding_10_a_bad_message_is_in_the_log_once_and_in_diagnostics(bridge, probe):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    one = bridge()
    item = d.MAVLink_mission_item_message(245, 190, 0, 3, 16, 0, 1, 0, 0, 0, 0, float('nan'),
                                          8.5, 500.0, 0)
    one.send(HEARTBEAT)
    one.received('MISSION_REQUEST_LIST')
    one.send(d.MAVLink_mission_count_message(245, 190, 1, 0))
    one.received('MISSION_REQUEST_INT')
    one.send(item, item, d.MAVLink_statustext_message(6, b'\x1b[2Jready'))
    one.until(lambda: any('?[2Jready' in line for line in one.log['info']))
    one.until(lambda: not probe.executor.spin_once(timeout_sec=0.0) and (
        fact(health, 'messages') or [0, 0, {}])[2].get('messages_refused') == '2')
    line, = (line for line in one.log['warning'] if 'MISSION_ITEM' in line)
    assert line == ('MISSION_ITEM (system 1, component 1): x = nan: expected a finite number: '
                    'dropped; logged once')
    assert one.node.receiver.is_alive()


def test_finding_13_a_timestamp_that_cannot_be_written_is_a_warning_in_flight(
        bridge, probe, tmp_path):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    tmp_path.joinpath('key').write_bytes(bytes(32))
    one = bridge('-p', f'signing_key_file:={tmp_path}/key')
    tmp_path.joinpath('key.timestamp.tmp').mkdir()
    tmp_path.joinpath('key.timestamp').unlink()
    tmp_path.joinpath('key.timestamp').symlink_to('/nowhere/at/all')
    one.until(lambda: one.log['warning'])
    assert 'signing: ' in one.log['warning'][0]
    assert 'key.timestamp: not written: ' in one.log['warning'][0]
    one.until(lambda: not probe.executor.spin_once(timeout_sec=0.0) and (
        fact(health, 'signing') or [0])[0] == 1)
    tmp_path.joinpath('key.timestamp.tmp').rmdir()
    one.until(lambda: 'signing: works' in one.log['info'])
    assert len(one.log['warning']) == 1
    assert one.node.receiver.is_alive()


def test_finding_24_a_list_of_66000_points_is_refused_and_the_previous_one_stays(bridge):
    one = bridge()
    one.send(HEARTBEAT)
    one.until(lambda: 'uav_1' in one.node.lists.known)
    short = planned_task(ListStop(Task('t', (60.0, 0.0, 50.0)), Leg((), 60.0), 0.0))
    way = Leg(((9.0, 9.0, 50.0),) * 65_998, 60.0)
    far = planned_task(ListStop(Task('far', (60.0, 0.0, 50.0)), way, 0.0))
    one.node.lists.on_list('uav_1', m.TaskList(uav_id='uav_1', revision=1, tasks=[short]))
    one.node.lists.on_list('uav_1', m.TaskList(uav_id='uav_1', revision=2, tasks=[short, far]))
    assert one.log['warning'] == [
        'uav_1/task_list: task_list of uav_1: points = 66000: expected at most 65533: ignored']
    onboard = one.node.ground_station.sessions[1].executor.onboard
    one.until(lambda: onboard.tasks is not None)
    assert onboard.tasks.revision == 1
    assert one.node.receiver.is_alive()


def test_finding_24_a_flood_of_unknown_senders_does_not_remove_a_known_vehicle(bridge):
    one = bridge()
    link, = one.node.connections.links
    one.send(HEARTBEAT)
    one.until(lambda: 'uav_1' in one.node.lists.known)
    for _ in range(200):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.bind(('127.0.0.1', 0))
            sender.sendto(b'x', ('127.0.0.1', link.port))
    one.until(lambda: one.node.connections.errors() == 200)
    assert one.remote.getsockname() in link.remotes()
    assert len(link.remotes()) == 1 + MAX_UNCONFIRMED
    assert one.received('HEARTBEAT').get_srcSystem() == 245


def test_no_mavlink_stream_ends_a_running_bridge(bridge, request):
    """`--streams 2000` sends a hundred; transport/test_hostile_streams.py sends all."""
    one = bridge('-p', 'takeoff:=true')
    ends = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(60)]
    to = ('127.0.0.1', one.node.connections.links[0].port)
    for seed in range(request.config.getoption('--streams') // 20):
        for _, end, data in stream(10_000 + seed, 400):
            ends[end].sendto(data, to)
        one.executor.spin_once(timeout_sec=0.0)
    for end in ends:
        end.close()
    one.send(HEARTBEAT)
    one.received('HEARTBEAT')
    one.until(lambda: any(line.startswith('found uav_') for line in one.log['info']))
    assert [line for level in one.log.values() for line in level if 'Error: ' in line] == []
    assert one.node.receiver.is_alive()
    assert one.node.heartbeat.restarts == 0
