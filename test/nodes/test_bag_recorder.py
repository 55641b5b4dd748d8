# SPDX-License-Identifier: Apache-2.0
"""live_view --record: what was on the topics is in the file, for readers that are not ours."""
import json
import math
import signal
from contextlib import suppress
from html import escape

import pytest
from geometry_msgs.msg import Point
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory
from nav_msgs.msg import Path as PathMsg
from rclpy.clock import ClockType
from rosgraph_msgs.msg import Clock
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.cli import report
from uav_task_alloc.model import Task
from uav_task_alloc.nodes.conversions import message_definitions as definitions
from uav_task_alloc.nodes.conversions.messages import (
    ANNOUNCEMENTS,
    EVENTS,
    LATCHED,
    STATES,
    announcement,
    header,
)
from uav_task_alloc.nodes.ros.bag_recorder import BagRecorder
from uav_task_alloc.nodes.ros.run import with_flags
from uav_task_alloc.record.bag_reader import BagReader
from uav_task_alloc.record.run_state import RunState

pytestmark = pytest.mark.ros
ADD = announcement(m.TaskAnnouncement.ADD, [Task('t1', (10.0, 20.0, 30.0), value=4.0)], 5.0)
LIST = m.TaskList(header=header(7.0), uav_id='uav_1', revision=3)


def fleet(probe):
    """Publishers of latched topics, before the recorder starts, and of states."""
    latched = [(probe.node.create_publisher(m.TaskAnnouncement, 'task_announcements',
                                            ANNOUNCEMENTS), ADD),
               (probe.node.create_publisher(m.TaskList, 'uav_1/task_list', LATCHED), LIST),
               (probe.node.create_publisher(PathMsg, 'uav_1/path', LATCHED),
                PathMsg(header=header(7.0)))]
    for publisher, message in latched:
        publisher.publish(message)
    return probe.node.create_publisher(m.UavState, 'uav_states', STATES)


def on_disk(path):
    """The topics that another reader finds in a file which has no end."""
    found = set()
    with suppress(EndOfFile, FileNotFoundError), open(path, 'rb') as file:
        for _, channel, _ in NonSeekingReader(file).iter_messages(log_time_order=False):
            found.add(channel.topic)
    return found


def test_every_topic_is_recorded_with_its_type_and_times(start, probe, tmp_path):
    states, path = fleet(probe), tmp_path / 'run.mcap'
    view = start('live_view', '-p', f'record:={path}', '-p', 'speedup:=4.0', '-p', 'port:=0')
    events = probe.publisher(m.TaskEvent, 'task_events', EVENTS)
    events.publish(m.TaskEvent(header=header(8.0), task_id='t1', uav_id='uav_1', revision=3))
    probe.until(lambda: len(probe.node.get_subscriptions_info_by_topic('/uav_1/path')) == 1)

    def recorded():
        states.publish(m.UavState(header=header(11.0), uav_id='uav_1', battery=0.5))
        return {'/uav_states', '/task_events'} <= on_disk(path)
    probe.until(recorded)
    view.stop()
    with open(path, 'rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        summary = reader.get_summary()
        assert reader.get_header().profile == 'ros2'
        assert next(reader.iter_metadata()).metadata['speedup'] == '4.0'
        rows = list(reader.iter_decoded_messages())
    assert summary.statistics.message_count == len(rows) > 5
    assert summary.chunk_indexes
    for row in rows:
        assert 0 < row.message.publish_time <= row.message.log_time
        assert row.message.log_time < row.message.publish_time + 60e9
        assert row.channel.message_encoding == 'cdr'
    messages = {row.channel.topic: row.decoded_message for row in rows}
    assert {'/task_announcements', '/uav_1/task_list', '/uav_1/path', '/task_events',
            '/uav_states'} <= messages.keys()
    task, = messages['/task_announcements'].tasks
    assert (task.task_id, task.position.y, task.value) == ('t1', 20.0, 4.0)
    assert messages['/uav_1/task_list'].revision == 3
    assert messages['/uav_states'].header.stamp.sec == 11
    assert messages['/task_events'].uav_id == 'uav_1'


def test_on_simulated_time_page_record_and_recording_live_by_the_clock(start, probe, tmp_path):
    states, path = fleet(probe), tmp_path / 'run.mcap'
    view = start('live_view', '-p', f'record:={path}', '-p', f'out_dir:={tmp_path}/out', '-p',
                 'port:=0', '-p', 'use_sim_time:=true')
    probe.until(lambda: 'waiting for it' in view.output())  # by name: nothing publishes /clock
    clock, now = probe.publisher(Clock, '/clock', 10), [5000.0]

    def tick(ready):
        def published():
            clock.publish(Clock(clock=header(now[0]).stamp))
            states.publish(m.UavState(header=header(now[0]), uav_id='uav_1', battery=0.5))
            return ready()
        probe.until(published)

    def walls():
        rows = (tmp_path / 'out/record.jsonl').read_text().splitlines()
        return [row['wall'] for row in map(json.loads, rows) if row['kind'] == 'state']

    for now[0] in (5000.0, 5100.0):
        tick(lambda: now[0] in walls())
    now[0] = 4000.0  # it goes back: the record does not
    tick(lambda: '/clock went back by 1100.0 s' in view.output())
    for now[0] in (4010.0, 4015.0):  # once the page has the last, the recording has those before
        tick(lambda: now[0] + 1100.0 in walls())
    view.stop()
    assert walls() == sorted(walls())
    with open(path, 'rb') as file:
        reader = make_reader(file, validate_crcs=True)
        assert next(reader.iter_metadata()).metadata['simulated'] == 'true'
        times = {message.log_time * 1e-9 for _, channel, message in reader.iter_messages()
                 if channel.topic != '/clock'}
    assert {5000.0, 5100.0, 5110.0} <= times <= set(range(5000, 5120))
    assert json.loads((tmp_path / 'out/record.jsonl').read_text().splitlines()[0]) == {
        'wall': 5000.0, 'kind': 'run', 'speedup': 0.0, 'simulated': True}


def test_what_a_killed_recorder_had_written_can_be_read(start, probe, tmp_path):
    fleet(probe)
    path = tmp_path / 'run.mcap'
    view = start('live_view', '-p', f'record:={path}', '-p', 'port:=0')
    probe.until(lambda: '/task_announcements' in on_disk(path))
    view.stop(signal.SIGKILL)
    assert '/task_announcements' in on_disk(path)


def test_the_report_of_a_run_is_drawn_from_its_recording_alone(start, probe, tmp_path):
    path = tmp_path / 'run.mcap'
    allocator = start('allocator', '-p', 'route_end:=hold')
    view = start('live_view', '-p', f'record:={path}', '-p', 'port:=0')
    statuses = probe.collect(m.TaskStatusArray, 'task_statuses', LATCHED)
    states = probe.publisher(m.UavState, 'uav_states', STATES)
    tasks = probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    tasks.publish(announcement(m.TaskAnnouncement.ADD, [
        Task('t1', (100.0, 0.0, 50.0)), Task('t2', (1e6, 0.0, 50.0))], 0.0))

    def settled():
        states.publish(m.UavState(
            header=header(1.0), uav_id='uav_1', available=True, battery=0.5,
            home=Point(x=math.nan), range_remaining=5000.0, cruise_speed=math.nan))
        return statuses and [row.state for row in statuses[-1].statuses] == [
            m.TaskStatus.ASSIGNED, m.TaskStatus.UNASSIGNED]
    probe.until(settled)
    reason = statuses[-1].statuses[1].reason

    def recorded():  # the topics do not arrive in the order of their publication
        settled()  # else the UAV is given up
        run = RunState()
        for line in BagReader(path):
            run.apply({'wall': 0.0, **line})
        newest = run.lists.newest.get('uav_1')
        return run.solves and newest and newest['tasks'] and any(
            row.reason == reason for row in run.statuses.tasks.values())
    probe.until(recorded)
    view.stop()
    allocator.stop()
    assert report.main([str(path), '--html', str(tmp_path / 'alone.html')]) == 0
    text = (tmp_path / 'alone.html').read_text()
    assert '<td>t1</td><td>assigned</td><td>uav_1</td>' in text
    assert f'<td>{escape(reason)}</td>' in text
    assert '"uav_1 not flown yet"' in text
    assert 'new task t1' in text


def test_a_file_that_exists_or_cannot_be_created_is_refused_with_a_reason(start, tmp_path):
    (tmp_path / 'old.mcap').write_text('flight of yesterday')
    for name, text in (('old.mcap', 'a file that is not there yet'),
                       ('old.mcap/x', 'a file that can be written (')):
        view = start('live_view', '-p', f'record:={tmp_path}/{name}')
        view.popen.wait(90)
        code, out = view.stop()
        assert (code, text in out, 'Traceback' in out) == (1, True, False), out
    assert (tmp_path / 'old.mcap').read_text() == 'flight of yesterday'


def test_a_disk_that_fails_ends_the_recording_and_nothing_else(probe, tmp_path, monkeypatch):
    recorder = BagRecorder(tmp_path / 'run.mcap', context=probe.context)

    def full():
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(recorder.bag, 'flush', full)
    recorder.start()
    probe.until(lambda: recorder.bag is None)
    fleet(probe)
    assert recorder.thread.is_alive()
    recorder.stop()
    assert [line['kind'] for line in BagReader(tmp_path / 'run.mcap')] == ['run']


def test_a_clock_of_the_computer_that_goes_back_delays_no_flush(probe, tmp_path):
    recorder = BagRecorder(tmp_path / 'run.mcap', context=probe.context)
    assert [timer.clock.clock_type for timer in recorder.node.timers] == [ClockType.STEADY_TIME]
    recorder.stop()


def test_a_definition_holds_all_a_message_is_made_of():
    text = definitions.definition('uav_task_alloc_msgs/msg/TaskList')
    parts = text.split(definitions.SEPARATOR + '\nMSG: ')
    assert [part.split()[0] for part in parts[1:]] == [
        'std_msgs/Header', 'uav_task_alloc_msgs/PlannedTask', 'geometry_msgs/Point',
        'builtin_interfaces/Time', 'uav_task_alloc_msgs/Task', 'builtin_interfaces/Duration',
        'uav_task_alloc_msgs/Ring', 'uav_task_alloc_msgs/Action']


@pytest.mark.parametrize(('line', 'types'), [
    ('Task[] tasks  # all', ['p/msg/Task']), ('string<=9 name', []), ('uint8 ADD=0', []),
    ('# Task task', []), ('geometry_msgs/Point[3] p', ['geometry_msgs/msg/Point']),
    ('float64[<=3] x', []), ('Task task', ['p/msg/Task']), ('', [])])
def test_the_types_of_fields_are_found(line, types):
    assert definitions.dependencies(line, 'p') == types


@pytest.mark.parametrize(('argv', 'ros'), [
    (['x'], ['x']),
    (['x', '--record', 'a b'], ['x', '--ros-args', '-p', 'record:="a b"', '--']),
    (['x', '--record', 'f', '--ros-args', '-p', 'a:=1'],
     ['x', '--ros-args', '-p', 'a:=1', '--ros-args', '-p', 'record:="f"', '--'])])
def test_a_flag_becomes_a_parameter(argv, ros):
    assert with_flags(argv, 'record') == ros


def test_a_flag_without_its_value_is_refused(capsys):
    with pytest.raises(SystemExit) as end:
        with_flags(['x', '--record'], 'record')
    assert end.value.code == 2
    assert '--record' in capsys.readouterr().err
