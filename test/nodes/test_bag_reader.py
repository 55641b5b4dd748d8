# SPDX-License-Identifier: Apache-2.0
"""A bag read back as lines: whole, cut short anywhere, damaged, of WGS84, and what is no bag."""
import math

import pytest
from geometry_msgs.msg import Point
from hypothesis import HealthCheck, given, settings, strategies as st
from mcap.writer import Writer
from rclpy.serialization import serialize_message
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.cli import report
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.flight_report.flight_history import read_history
from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.nodes.conversions.message_definitions import definition
from uav_task_alloc.nodes.conversions.messages import announcement, from_zones, header
from uav_task_alloc.nodes.conversions.path_messages import area_message
from uav_task_alloc.record.bag import Bag
from uav_task_alloc.record.bag_reader import BagReader

OURS = 'uav_task_alloc_msgs/msg/'
ZONES = [ThreatZone.hemisphere('a', (1.0, 2.0, 3.0), 4.0, 5.0),
         ThreatZone.cylinder('b', (1.0, 2.0), 3.0),
         ThreatZone.polygon('c', [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], 0.0, 9.0)]
WGS = m.TaskAnnouncement(tasks=[m.Task(task_id='w', frame=1, latitude=47.01, longitude=8.0,
                                       altitude=20.0, value=1.0)])


def state(k):
    return m.UavState(header=header(float(k)), uav_id='u1', position=Point(x=10.0 * k, z=50.0),
                      battery=math.nan, mode=m.UavState.ON_MISSION)


MESSAGES = [
    ('/task_announcements', announcement(m.TaskAnnouncement.ADD,
                                         [Task('t1', (10.0, 20.0, 30.0), value=4.0)], 0.0)),
    ('/threat_zones', from_zones(ZONES, 0.0)),
    ('/task_statuses', m.TaskStatusArray(statuses=[m.TaskStatus(
        task_id='t1', state=m.TaskStatus.UNASSIGNED, reason='inside zone a')])),
    ('/allocation', m.Allocation(revision=1, trigger='ADD t1')),
    *(('/fleet/uav_states', state(k)) for k in range(5))]


def write(path, messages, about=None, flush_every=2, seconds=range(1000)):
    """A bag with a chunk for each two messages, 1 s apart or at other `seconds`."""
    with Bag(path, about or {'speedup': '2.0'}) as bag:
        for k, (topic, message) in enumerate(messages):
            package, kind, _ = type(message).__module__.split('.')
            name = f'{package}/{kind}/{type(message).__name__}'
            if topic not in bag.channels:
                bag.open(topic, name, definition(name))
            when = 1_700_000_000_000_000_000 + round(seconds[k] * 1e9)
            bag.add(topic, serialize_message(message), when, when - 5)
            if k % flush_every:
                bag.flush()
    return path


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    return write(tmp_path_factory.mktemp('bag') / 'whole.mcap', MESSAGES)


def test_a_bag_is_read_as_lines_in_any_namespace(whole):
    reader = BagReader(whole)
    run, tasks, zones, statuses, plan, *states = reader
    assert run == {'kind': 'run', 'speedup': 2.0, 'simulated': False}
    assert tasks == {'kind': 'announcement', 'wall': 1.7e9, 'action': 'ADD', 'tasks': [
        {'id': 't1', 'position': (10.0, 20.0, 30.0), 'service': 0.0, 'value': 4.0}]}
    assert [row['id'] for row in zones['zones']] == ['a', 'b', 'c']
    assert statuses['statuses'] == [{'task': 't1', 'state': 'UNASSIGNED', 'uav': '',
                                     'reason': 'inside zone a'}]
    assert (plan['trigger'], len(states)) == ('ADD t1', 5)
    assert states[4]['position'] == [40.0, 0.0, 50.0]
    assert states[4]['battery'] is None
    assert (reader.damage, reader.undecodable) == ('', {})


@pytest.mark.parametrize(('about', 'count'), [
    ({}, 0), ({'origin.latitude': '47.0', 'origin.longitude': '8.0',
               'origin.altitude_amsl': '400.0'}, 1)])
def test_a_task_in_degrees_has_a_position_where_the_bag_has_the_origin(tmp_path, about, count):
    *_, tasks = BagReader(write(tmp_path / 'w.mcap', [('/task_announcements', WGS)], about))
    assert len(tasks['tasks']) == count
    for task in tasks['tasks']:
        assert task['position'] == pytest.approx((0.0, 1111.8, 19.9), abs=0.3)


def test_the_origin_that_the_fleet_published_is_that_of_the_bag(tmp_path):
    origin = m.FleetOrigin(latitude=47.0, longitude=8.0, altitude_amsl=400.0)
    lines = list(BagReader(write(tmp_path / 'w.mcap', [
        ('/fleet_origin', origin), ('/task_announcements', WGS)])))
    assert lines[1] == {'kind': 'origin', 'wall': 1.7e9, 'latitude': 47.0, 'longitude': 8.0,
                        'altitude_amsl': 400.0}
    assert len(lines[2]['tasks']) == 1


def test_the_fence_area_is_the_polygon_of_that_name(tmp_path):
    area = area_message(((0.0, 0.0), (9.0, 0.0), (9.0, 9.0)), 0.0)
    many = area_message(tuple((float(k), float(k * k)) for k in range(21)), 0.0)  # nodes take 20
    reader = BagReader(write(tmp_path / 'a.mcap', [
        ('/fence_area', area), ('/field/outline', area), ('/fence_area', many),
        ('/fence_area', area_message((), 0.0))]))
    lines = list(reader)
    assert [(line['kind'], list(line['corners'])) for line in lines[1:]] == [
        ('fence_area', [(0.0, 0.0), (9.0, 0.0), (9.0, 9.0)]), ('fence_area', [])]
    assert reader.undecodable == {'/fence_area': 1}


def test_a_task_in_degrees_that_was_announced_before_the_origin_has_its_place(tmp_path):
    origin = m.FleetOrigin(latitude=47.0, longitude=8.0, altitude_amsl=400.0)
    _, first, second, _ = BagReader(write(tmp_path / 'w.mcap', [
        ('/task_announcements', WGS), ('/task_announcements', WGS), ('/fleet_origin', origin)]))
    for line in (first, second):
        assert line['tasks'][0]['position'] == pytest.approx((0.0, 1111.8, 19.9), abs=0.3)


def test_the_report_says_how_many_tasks_have_no_place(tmp_path, capsys):
    path = write(tmp_path / 'w.mcap', [('/task_announcements', WGS), *MESSAGES[4:]])
    assert report.main([str(path)]) == 0
    assert 'Warning: left out: 1 task in degrees, as there is no fleet_origin' in (
        capsys.readouterr().err)


TWO_FLEETS = [
    *((f'/{name}/uav_states', state(k)) for k in range(3) for name in ('north', 'south')),
    *((f'/{name}/u1/task_list', m.TaskList(uav_id='u1', revision=revision))
      for revision, name in enumerate(('north', 'south'), 1)),
    ('/threat_zones', from_zones(ZONES, 0.0))]


def test_of_several_fleets_in_a_bag_one_is_chosen(tmp_path, capsys):
    path = write(tmp_path / 'two.mcap', TWO_FLEETS)
    with pytest.raises(InvalidValue, match=r'expected one fleet, found uav_states of /north and of'
                                           r' /south; choose one with --namespace'):
        report.main([str(path)])
    for namespace, revision in (('/north', 1), ('south', 2)):
        _, *states, tasks = BagReader(path, namespace)
        assert ([line['kind'] for line in states], tasks['revision']) == (['state'] * 3, revision)
        assert report.main([str(path), '--namespace', namespace]) == 0
    assert [line['kind'] for line in BagReader(path, '/')] == ['run', 'zones']
    with pytest.raises(InvalidValue, match='none of /west'):
        report.main([str(path), '--namespace', 'west'])


def test_the_report_prints_its_path_and_its_figures(whole, tmp_path, capsys):
    html = tmp_path / 'flight.html'
    assert report.main([str(whole), '--html', str(html)]) == 0
    out, err = capsys.readouterr()
    assert f'Report: {html}' in out
    assert 'tasks unassigned' in out
    assert err == ''
    text = html.read_text()
    for words in ('<td>t1</td><td>unassigned</td>', 'inside zone a', '"u1 flown"'):
        assert words in text


def test_a_plan_that_waited_for_an_operator_is_an_event_of_the_report(tmp_path):
    asked = m.PlanProposal(plan=m.Allocation(revision=7, lists=[m.TaskList(uav_id='u1')]),
                           changes=['u1 gains t1'])
    answered = m.PlanProposal(plan=m.Allocation(revision=7), changes=['plan 7: rejected by ann'])
    path = write(tmp_path / 'asked.mcap', [*MESSAGES, ('/plan_proposal', asked),
                                           ('/plan_proposal', answered)])
    assert [text for _, kind, text in read_history(BagReader(path, '/')).events
            if kind == 'plan'] == ['plan 7 waits for approval: u1 gains t1',
                                   'plan 7: rejected by ann']


def test_of_a_bag_cut_short_anywhere_all_whole_chunks_are_read(whole, tmp_path):
    data, most = whole.read_bytes(), 0
    for length in range(8, len(data), 97):
        (tmp_path / 'cut.mcap').write_bytes(data[:length])
        reader = BagReader(tmp_path / 'cut.mcap')
        count = len(list(reader))
        assert reader.damage
        assert count >= most
        most = count
    assert most == len(MESSAGES) + 1


def test_the_report_of_a_cut_bag_says_that_it_is_cut(whole, tmp_path, capsys):
    data = whole.read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(data[:len(data) * 3 // 4])
    assert report.main([str(tmp_path / 'cut.mcap')]) == 0
    assert 'Warning: cut.mcap: it was not closed' in capsys.readouterr().err
    assert 'it was not closed' in (tmp_path / 'cut.html').read_text()


@given(st.data())
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.data_too_large,
          HealthCheck.function_scoped_fixture])
def test_a_corrupt_bag_is_read_up_to_its_fault_or_refused_with_a_reason(whole, tmp_path, data):
    damaged = bytearray(whole.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    (tmp_path / 'bad.mcap').write_bytes(damaged)
    try:
        lines = list(BagReader(tmp_path / 'bad.mcap'))
    except InvalidValue:
        lines = []
    assert len(lines) <= len(MESSAGES) + 1


def test_a_message_of_another_type_is_counted_and_left_out(tmp_path):
    with Bag(tmp_path / 'x.mcap', {}) as bag:
        bag.open('/task_statuses', OURS + 'TaskStatusArray', definition(OURS + 'TaskStatusArray'))
        bag.open('/uav_states', OURS + 'UavState', 'Nonsense[ x')
        for topic in ('/task_statuses', '/uav_states'):
            bag.add(topic, b'\0\1\0\0\xff\xff', 1, 1)
    reader = BagReader(tmp_path / 'x.mcap')
    assert [line['kind'] for line in reader] == ['run']
    assert reader.undecodable == {'/task_statuses': 1, '/uav_states': 1}


def test_a_file_that_is_no_recording_is_refused_with_a_reason(tmp_path):
    for name, data, text in (('empty.mcap', b'', 'expected an MCAP file'),
                             ('text.mcap', b'hello, this is no bag', 'expected an MCAP file')):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InvalidValue, match=text):
            report.main([str(tmp_path / name)])
    with open(tmp_path / 'other.mcap', 'wb') as file:
        writer = Writer(file)
        writer.start()
        writer.finish()
    with pytest.raises(InvalidValue, match='messages of a fleet in it, found 0'):
        report.main([str(tmp_path / 'other.mcap')])
    with pytest.raises(SystemExit, match=r'none\.mcap: No such file'):
        report.main([str(tmp_path / 'none.mcap')])


def test_times_go_on_where_the_clock_of_the_recorder_went_back(tmp_path):
    seconds = [5.0, 6.0, 5.9, -3590.0, -3589.0, -3589.1]  # messages out of order are no step
    messages = [('/u1/task_list', m.TaskList(uav_id='u1', header=header(1.7e9 + at)))
                for at in seconds]
    lines = list(BagReader(write(tmp_path / 'back.mcap', messages, seconds=seconds)))[1:]
    expected = [1.7e9 + at for at in (5.0, 6.0, 5.9, 6.0, 7.0, 6.9)]
    assert [line['wall'] for line in lines] == pytest.approx(expected, abs=1e-3)
    assert [line['stamp'] for line in lines] == pytest.approx(expected, abs=1e-3)
