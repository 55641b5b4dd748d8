# SPDX-License-Identifier: Apache-2.0
"""live_view as a process: it shows, records, and ends when the scenario is over."""
import json
import math
import re
import socket
import urllib.request
from types import SimpleNamespace

import pytest
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.nodes.conversions.messages import (
    ANNOUNCEMENTS,
    LATCHED,
    STATES,
    announcement,
    from_zones,
)
from uav_task_alloc.nodes.live_view import LiveView
from uav_task_alloc.nodes.ros.message_guard import MessageGuard
from uav_task_alloc.nodes.ros.udp_ports import free_port
from uav_task_alloc.record import diagnostic_records, message_records, run_state
from uav_task_alloc.record.record_file import read_lines
from uav_task_alloc.record.reported import ReportedStatus
from uav_task_alloc.zone_codec import decode_zone

TEXT = """uavs:
  - {id: uav_1, position: [0, 0, 0]}
tasks:
  - {id: t1, position: [10, 20, 30]}
"""
ORIGIN = Origin(47.0, 8.0, 400.0)
ADD = announcement(m.TaskAnnouncement.ADD, [Task('t1', (10.0, 20.0, 30.0))], 5.0)


def state(mode=m.UavState.STANDBY, speed=0.0):
    return m.UavState(uav_id='uav_1', mode=mode, mission_state=m.UavState.VERIFIED,
                      list_revision=3, battery=math.nan, available=True, velocity=_vector(speed))


def _vector(x):
    made = m.UavState().velocity
    made.x = x
    return made


def statuses(value):
    return m.TaskStatusArray(statuses=[m.TaskStatus(task_id='t1', state=value, uav_id='uav_1')])


def test_it_shows_records_and_ends_when_all_is_settled(start, probe, tmp_path):
    path = tmp_path / 'play.yaml'
    path.write_text(TEXT)
    view = start('live_view', '-p', f'scenario:={path}', '-p', f'out_dir:={tmp_path}/out',
                 '-p', 'speedup:=10.0', '-p', 'settle:=5.0', '-p', 'port:=0')
    tasks = probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    task_statuses = probe.publisher(m.TaskStatusArray, 'task_statuses', LATCHED)
    states = probe.publisher(m.UavState, 'uav_states', STATES)
    plans = probe.publisher(m.Allocation, 'allocation', LATCHED)
    tasks.publish(ADD)
    plans.publish(m.Allocation(revision=1, trigger='1 new task',
                               solve_time=Duration(nanosec=100_000_000)))
    task_statuses.publish(statuses(m.TaskStatus.ACTIVE))
    states.publish(state(m.UavState.ON_MISSION, 15.0))
    probe.until(lambda: '1 active' in view.output())
    assert view.popen.poll() is None
    task_statuses.publish(statuses(m.TaskStatus.COMPLETED))

    def over():
        states.publish(state())
        return view.popen.poll() is not None
    probe.until(over)
    assert view.popen.returncode == 0
    assert '1 of 1 tasks completed; 0 zones' in view.output()
    state_of_run = run_state.read_record(tmp_path / 'out')
    assert state_of_run.tasks['t1'].position == (10.0, 20.0, 30.0)
    lines = read_lines(tmp_path / 'out/record.jsonl')
    assert next(line for line in lines if line['kind'] == 'announcement')['stamp'] == 5.0
    assert state_of_run.statuses.tasks['t1'] == ReportedStatus('COMPLETED', 'uav_1', '')
    assert [(solve.milliseconds, solve.trigger) for solve in state_of_run.solves] == [
        (pytest.approx(100.0), '1 new task')]
    assert state_of_run.uavs['uav_1']['mode'] == 'STANDBY'
    assert state_of_run.uploads == 1


def test_the_page_shows_what_the_node_receives(start, probe):
    view = start('live_view', '-p', 'port:=0')
    tasks = probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    states = probe.publisher(m.UavState, 'uav_states', STATES)
    zones = probe.publisher(m.ThreatZoneArray, 'threat_zones', LATCHED)
    bad = m.ThreatZoneArray(zones=[m.ThreatZone(zone_id='no zone')])
    bad.zones += from_zones([ThreatZone.hemisphere('z1', (1.0, 2.0, 3.0), 4.0)], 0.0).zones
    tasks.publish(ADD)
    zones.publish(bad)
    address = re.search(r'Live page: (http://127\.0\.0\.1:\d+/)', view.output()).group(1)
    def parts():
        states.publish(state())
        states.publish(m.UavState(uav_id='no topic can be named so'))
        with urllib.request.urlopen(f'{address}at?wall=9e9', timeout=60) as answer:
            return json.load(answer)['parts']

    probe.until(lambda: {'tasks', 'uavs', 'zones'} <= parts().keys())
    probe.publisher(m.TaskList, 'uav_1/task_list', LATCHED).publish(m.TaskList(
        uav_id='uav_1', revision=7, tasks=[m.PlannedTask(task=ADD.tasks[0])]))
    probe.until(lambda: 'list uav_1' in parts())
    got = parts()
    assert got['tasks'] == {'t1': [10.0, 20.0, 30.0]}
    assert [zone['id'] for zone in got['zones']] == ['z1']
    assert list(got['uavs']) == ['uav_1']
    assert [task['id'] for task in got['list uav_1']['tasks']] == ['t1']
    beat = page_of(view, 'at?wall=9e9')['clock']['beat']
    probe.until(lambda: page_of(view, 'at?wall=9e9')['clock']['beat'] != beat)
    assert view.stop()[0] == 0


def test_the_speed_of_a_simulated_fleet_is_measured(start, probe, tmp_path):
    path = tmp_path / 'play.yaml'
    path.write_text(TEXT)
    port = free_port()
    start('mavlink_bridge', '-p', f"connections:=['udpin:127.0.0.1:{port}']")
    start('fleet_sim', '-p', f'scenario:={path}', '-p', 'speedup:=6.0',
          '-p', f'target:=127.0.0.1:{port}')
    view = start('live_view', '-p', 'port:=0', '-p', f'scenario:={path}')
    probe.until(lambda: 'Live page' in view.output())
    address = re.search(r'Live page: (http://127\.0\.0\.1:\d+/)', view.output()).group(1)

    def speedup():
        with urllib.request.urlopen(f'{address}at?wall=9e9', timeout=60) as answer:
            return json.load(answer)['clock'].get('speedup')

    probe.until(lambda: speedup() == 6.0, facts=speedup)


def test_a_port_in_use_is_logged_and_the_node_goes_on(start, probe):
    with socket.create_server(('127.0.0.1', 0)) as taken:
        port = taken.getsockname()[1]
        view = start('live_view', '-p', f'port:={port}')
        probe.until(lambda: '0 of 0 tasks' in view.output())
    assert f'no live page: host = 127.0.0.1, port = {port}: ' in view.output()
    assert view.stop()[0] == 0


def test_without_a_scenario_it_runs_until_it_is_stopped(start, probe):
    view = start('live_view', '-p', 'page:=false')
    states = probe.publisher(m.UavState, 'uav_states', STATES)

    def shown():
        states.publish(state())
        return '0 of 0 tasks' in view.output()
    probe.until(shown)
    assert 'page' not in view.output()
    assert view.stop()[0] == 0


def test_unknown_values_of_a_message_are_null_in_json():
    line = message_records.state_record(state(speed=math.nan))
    assert (line['battery'], line['velocity']) == (None, [None, 0.0, 0.0])
    json.dumps(line, allow_nan=False)


def test_zones_survive_the_record():
    zones = [ThreatZone.hemisphere('a', (1.0, 2.0, 3.0), 4.0, 5.0),
             ThreatZone.cylinder('b', (1.0, 2.0), 3.0),
             ThreatZone.polygon('c', [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], 0.0, 9.0)]
    text = json.dumps(message_records.zones_record(from_zones(zones, 0.0)), allow_nan=False)
    assert [decode_zone(row) for row in json.loads(text)['zones']] == zones


def test_a_bad_task_of_an_announcement_is_left_out():
    bad = announcement(m.TaskAnnouncement.ADD, [Task('t2', (1.0, 2.0, 3.0))], 0.0)
    bad.tasks[0].position = Point(x=math.nan)
    bad.tasks += ADD.tasks
    tasks = message_records.announcement_record(bad, ORIGIN)['tasks']
    assert [task['id'] for task in tasks] == ['t1']


def test_uploads_and_health_are_taken_from_the_diagnostics():
    status = DiagnosticStatus(
        level=b'\1', name='mavlink_bridge: uav_1', message='link stale', hardware_id='uav_1',
        values=[KeyValue(key=key, value=value) for key, value in (
            ('uploads', '4'), ('rate', '10'), ('authority', 'LOST'), ('authority_why', 'why'),
            ('authority_for', '12 s'), ('given_back_by', '~/hand_over'),
            ('clock_rate', '7.980'))])
    assert diagnostic_records.uploads_record(DiagnosticArray(status=[status])) == {
        'kind': 'uploads', 'uploads': {'mavlink_bridge: uav_1': 4},
        'health': {'mavlink_bridge: uav_1': [1, 'link stale', 'uav_1']},
        'clock_rates': {'uav_1': 7.98}, 'uav_warnings': {}, 'orders': {},
        'battery_reserves': {}, 'waiting': {},
        'authority': {'uav_1': {'state': 'LOST', 'why': 'why', 'for': 12.0,
                                'back': '~/hand_over'}}}


@pytest.mark.parametrize(('given', 'seconds'), [('0 s', 0.0), ('nan s', None), ('', None),
                                                ('long', None)])
def test_the_duration_of_authority_is_a_number_or_unknown(given, seconds):
    status = DiagnosticStatus(hardware_id='u', values=[
        KeyValue(key='authority', value='HELD'), KeyValue(key='authority_for', value=given),
        KeyValue(key='given_back_by', value='nothing is needed')])
    line = diagnostic_records.uploads_record(DiagnosticArray(status=[status]))
    authority = line['authority']['u']
    assert (authority['for'], authority['back']) == (seconds, '')


@pytest.mark.parametrize('given', ['unknown', 'nan', 'inf', '0.0', '-1.0', '', '0.003', '1e308'])
def test_a_clock_rate_is_a_positive_number_or_unknown(given):
    status = DiagnosticStatus(hardware_id='u', values=[KeyValue(key='clock_rate', value=given)])
    assert diagnostic_records.uploads_record(DiagnosticArray(status=[status]))['clock_rates'] == {}


@pytest.mark.parametrize(('namespace', 'names'), [
    ('/', ['/allocator', 'bridge: /far/u1']), ('/north', ['/north/mavlink_bridge: u1'])])
def test_diagnostics_of_another_fleet_are_left_out(namespace, names):
    msg = DiagnosticArray(status=[DiagnosticStatus(name=name, hardware_id='u1') for name in (
        '/allocator', '/north/mavlink_bridge: u1', '/northern/allocator', 'bridge: /far/u1')])
    assert [each.name for each in diagnostic_records.of_namespace(msg, namespace)] == names


def test_a_velocity_beyond_all_bounds_is_unknown():
    line = message_records.state_record(state(speed=1.7e308))
    assert line['velocity'] == [None, 0.0, 0.0]


def test_times_of_a_clock_that_went_back_are_moved_to_those_of_the_record():
    line = message_records.shifted({
        'kind': 'x', 'stamp': 10.0, 'deadline': 0.0, 'tasks': [
            {'id': 't1', 'earliest': 20.0, 'eta': 5.0}],
        'statuses': [{'task': 't1', 'expected': 30.0}]}, 300.0)
    assert line == {
        'kind': 'x', 'stamp': 310.0, 'deadline': 0.0, 'tasks': [
            {'id': 't1', 'earliest': 320.0, 'eta': 5.0}],
        'statuses': [{'task': 't1', 'expected': 330.0}]}


def test_a_state_record_has_the_authority():
    line = message_records.state_record(m.UavState(authority=m.UavState.LOST, reason='why'))
    assert (line['authority'], line['reason']) == ('LOST', 'why')


@pytest.mark.parametrize('value', ['\u00b2', '\u0663', '-1', '', '9' * 5000, '1e3'])
def test_finding_31_a_count_of_uploads_is_plain_digits(value):
    status = DiagnosticStatus(name='b', values=[KeyValue(key='uploads', value=value)])
    assert diagnostic_records.uploads_record(DiagnosticArray(status=[status]))['uploads'] == {}


def test_finding_31_via_points_that_are_not_finite_are_left_out():
    line = message_records.task_list_record(broken_list())
    assert line['tasks'][0]['via'] == [(1.0, 2.0, 3.0)]
    json.dumps(line, allow_nan=False)


def broken_list():
    return m.TaskList(uav_id='uav_1', revision=7, tasks=[m.PlannedTask(task=ADD.tasks[0], via=[
        Point(x=math.nan), Point(x=1.0, y=2.0, z=3.0), Point(z=math.inf)])])


def test_finding_31_hostile_lists_counts_and_zones_do_not_end_the_view(start, probe):
    view = start('live_view', '-p', 'port:=0')
    health = probe.publisher(DiagnosticArray, '/diagnostics', 10)
    plans = probe.publisher(m.Allocation, 'allocation', LATCHED)
    zones = probe.publisher(m.ThreatZoneArray, 'threat_zones', LATCHED)
    states = probe.publisher(m.UavState, 'uav_states', STATES)
    health.publish(DiagnosticArray(status=[DiagnosticStatus(
        name='bridge', values=[KeyValue(key='uploads', value='\u00b2')])]))
    plans.publish(m.Allocation(revision=1, lists=[broken_list()]))
    turns = [2.0 * math.pi * k / 3000 for k in range(3000)]
    many = m.ThreatZone(zone_id='many', shape=m.ThreatZone.POLYGON, z_min=0.0, z_max=9.0)
    many.vertices = [Point(x=100.0 * math.cos(turn), y=100.0 * math.sin(turn)) for turn in turns]
    good = from_zones([ThreatZone.hemisphere('z1', (1.0, 2.0, 3.0), 4.0)], 0.0).zones
    zones.publish(m.ThreatZoneArray(zones=[many, *good]))
    probe.until(lambda: (states.publish(state()), probe.node.count_subscribers(
        'uav_1/task_list'))[1], 20.0, view.output)
    probe.publisher(m.TaskList, 'uav_1/task_list', LATCHED).publish(broken_list())
    address = re.search(r'Live page: (http://127\.0\.0\.1:\d+/)', view.output()).group(1)

    def parts():
        with urllib.request.urlopen(f'{address}at?wall=9e9', timeout=60) as answer:
            return json.load(answer)['parts']

    probe.until(lambda: {'list uav_1', 'zones'} <= parts().keys(), 20.0, view.output)
    assert parts()['list uav_1']['tasks'][0]['via'] == [[1.0, 2.0, 3.0]]
    assert [zone['id'] for zone in parts()['zones']] == ['z1']
    zones.publish(m.ThreatZoneArray(zones=[m.ThreatZone() for _ in range(1001)]))
    probe.until(lambda: 'threat_zones: zones: number = 1001: expected at most 1000'
                in view.output(), 20.0, view.output)
    assert view.stop()[0] == 0


def page_of(view, path):
    """The JSON value of a path of the page."""
    address = re.search(r'Live page: (http://127\.0\.0\.1:\d+/)', view.output()).group(1)
    with urllib.request.urlopen(address + path, timeout=60) as answer:
        return json.load(answer)


def test_the_page_has_the_origin_of_the_fleet_and_the_tiles_of_the_parameter(
        start, probe, tmp_path):
    (tmp_path / '14').mkdir()
    view = start('live_view', '-p', 'port:=0', '-p', f'tiles:={tmp_path}', '-p',
                 'tiles_attribution:=who made them')
    origins = probe.publisher(m.FleetOrigin, 'fleet_origin', LATCHED)
    tasks = probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    origins.publish(m.FleetOrigin(latitude=99.0))  # refused
    origins.publish(m.FleetOrigin(latitude=-33.9, longitude=151.2, altitude_amsl=7.0))
    probe.until(lambda: 'origin' in page_of(view, 'at?wall=9e9')['parts'], 20.0, view.output)
    assert page_of(view, 'at?wall=9e9')['parts']['origin'] == [-33.9, 151.2, 7.0]
    assert page_of(view, 'tiles.json') == {
        'url': 'tiles/{z}/{x}/{y}', 'attribution': 'who made them', 'min_zoom': 14,
        'max_zoom': 14}
    tasks.publish(m.TaskAnnouncement(action=m.TaskAnnouncement.ADD, tasks=[m.Task(
        task_id='w', frame=m.Task.WGS84, latitude=-33.9, longitude=151.2, altitude=3.0,
        value=1.0)]))
    probe.until(lambda: 'tasks' in page_of(view, 'at?wall=9e9')['parts'], 20.0, view.output)
    assert page_of(view, 'at?wall=9e9')['parts']['tasks'] == {'w': [0.0, 0.0, 3.0]}
    assert view.stop()[0] == 0


def wgs84_task(latitude, longitude, value=1.0):
    return m.Task(task_id='w', frame=m.Task.WGS84, latitude=latitude, longitude=longitude,
                  altitude=3.0, value=value)


def test_tasks_in_wgs84_wait_for_the_origin_and_refused_ones_move_nothing(start, probe):
    view = start('live_view', '-p', 'port:=0')
    tasks = probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    for action, each in ((m.TaskAnnouncement.ADD, wgs84_task(-33.9, 151.2)),
                         (m.TaskAnnouncement.UPDATE, wgs84_task(-33.8, 151.2, value=0.0)),
                         (9, wgs84_task(-33.8, 151.2)), (m.TaskAnnouncement.ADD, ADD.tasks[0])):
        tasks.publish(m.TaskAnnouncement(action=action, tasks=[each]))
    probe.until(lambda: 'wait for fleet_origin' in view.output(), 20.0, view.output)
    assert 'tasks' not in page_of(view, 'at?wall=9e9')['parts']
    probe.publisher(m.FleetOrigin, 'fleet_origin', LATCHED).publish(
        m.FleetOrigin(latitude=-33.9, longitude=151.2, altitude_amsl=7.0))
    probe.until(lambda: 't1' in page_of(view, 'at?wall=9e9')['parts'].get('tasks', ()), 20.0,
                view.output)
    assert page_of(view, 'at?wall=9e9')['parts']['tasks'] == {
        'w': [0.0, 0.0, 3.0], 't1': [10.0, 20.0, 30.0]}
    assert 'task_announcements: action = 9: expected' in view.output()
    assert view.stop()[0] == 0


def test_an_update_that_fails_is_logged_and_ends_nothing():
    def fail(*_):
        raise ValueError('why')

    done = []
    view = SimpleNamespace(
        clock=lambda: 0.0, now=lambda: 0.0, is_finished=lambda _: False, state=None,
        terminal=SimpleNamespace(update=fail), update_page=lambda: done.append('page'),
        record=SimpleNamespace(flush=lambda: done.append('record')),
        guard=MessageGuard(done.append))
    LiveView.on_timer(view)
    assert done == ['terminal: ValueError: why: ignored; logged once', 'page', 'record']


def test_a_full_disk_ends_the_record_and_not_the_view(start, probe, tmp_path):
    (tmp_path / 'record.jsonl').symlink_to('/dev/full')
    view = start('live_view', '-p', f'out_dir:={tmp_path}', '-p', 'page:=false')
    plans = probe.publisher(m.Allocation, 'allocation', LATCHED)
    probe.until(lambda: 'No space left on device: the record ends' in view.output(), 20.0,
                view.output)
    plans.publish(m.Allocation(revision=1, trigger='\x1b[2J'))
    probe.until(lambda: 'ms (?[2J)' in view.output(), 20.0, view.output)
    assert view.stop()[0] == 0


def test_a_folder_without_tiles_is_refused(start, probe):
    view = start('live_view', '-p', 'port:=0', '-p', 'tiles:=/no/such/folder')
    probe.until(lambda: view.popen.poll() is not None, 20.0, view.output)
    assert view.popen.returncode == 1
    assert view.output().startswith(
        "tiles = '/no/such/folder': expected a folder with {z}/{x}/{y}.png")


def test_the_page_says_that_the_run_has_ended(start, probe, tmp_path):
    path = tmp_path / 'play.yaml'
    path.write_text(TEXT)
    view = start('live_view', '-p', f'scenario:={path}', '-p', 'stay:=true', '-p', 'port:=0')
    tasks = probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    task_statuses = probe.publisher(m.TaskStatusArray, 'task_statuses', LATCHED)
    states = probe.publisher(m.UavState, 'uav_states', STATES)

    def ended():
        states.publish(state())
        return page_of(view, 'at?wall=9e9')['clock'].get('ended')

    tasks.publish(ADD)
    task_statuses.publish(statuses(m.TaskStatus.ACTIVE))
    probe.until(lambda: ended() is False, 20.0, view.output)
    task_statuses.publish(statuses(m.TaskStatus.COMPLETED))
    probe.until(ended, 20.0, view.output)
    assert view.stop()[0] == 0
