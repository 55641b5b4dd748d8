# SPDX-License-Identifier: Apache-2.0
"""The history of a flight from the lines of a record, and its report."""
import json
import re
from html import escape

import pytest

from uav_task_alloc.flight_report.flight_history import (
    ReceptionGap,
    ReplanRecord,
    StateSpan,
    read_history,
)
from uav_task_alloc.flight_report.page import report_page
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.zone_codec import JSON_ZONE, encode_zone

BEGIN = 1000.0
HOSTILE = '</script><script>alert(1)</script>'


def announced(wall, **places):
    return {'kind': 'announcement', 'wall': BEGIN + wall, 'action': 'ADD', 'tasks': [
        {'id': name, 'position': place, 'value': 2.0} for name, place in places.items()]}


def statuses(wall, **states):
    return {'kind': 'statuses', 'wall': BEGIN + wall, 'statuses': [
        {'task': name, 'state': state, 'uav': 'u1' * (state in ('ACTIVE', 'COMPLETED')),
         'reason': 'inside zone <z>' * (state == 'UNASSIGNED')}
        for name, state in states.items()]}


def state(wall, x, uav='u1'):
    return {'kind': 'state', 'wall': BEGIN + wall, 'uav': uav, 'mode': 'HOLD', 'active': '',
            'mission_state': 'VERIFIED', 'list_revision': 1, 'battery': None, 'available': True,
            'position': [x, 0.0, 50.0], 'velocity': [0.0, 0.0, 0.0], 'range_remaining': None}


def tasks_left(wall, *rows):
    return {'kind': 'list', 'wall': BEGIN + wall, 'uav': 'u1', 'revision': 1, 'distance': 0.0,
            'end': 0, 'stamp': BEGIN + wall, 'tasks': [
                {'id': name, 'position': [x, 0.0, 50.0], 'via': via, 'leg_distance': 1.0,
                 'eta': 1.0} for name, x, via in rows]}


def planned(wall, trigger, *rows):
    return {'kind': 'allocation', 'wall': BEGIN + wall, 'revision': int(wall) + 1, 'fit': 5.0,
            'solve_ms': 20.0, 'trigger': trigger, 'distance': 100.0, 'iterations': 1,
            'warm_started': False, 'lists': [tasks_left(wall, *rows)]}


A, B = ('a', 100.0, [[50.0, 20.0, 50.0]]), ('b', 200.0, [])
FLIGHT = [
    {'kind': 'run', 'speedup': 2.0}, state(0.0, 0.0),
    announced(1.0, a=[100.0, 0.0, 50.0]), statuses(1.0, a='PENDING'),
    planned(1.1, 'ADD a', A), tasks_left(1.1, A), statuses(1.2, a='ASSIGNED'), state(2.0, 0.0),
    statuses(2.5, a='ACTIVE'), announced(3.0, b=[200.0, 0.0, 50.0]), state(3.0, 50.0),
    planned(3.1, 'ADD b', A, B), tasks_left(3.1, A, B),
    statuses(4.0, a='COMPLETED', b='UNASSIGNED'), tasks_left(4.0, B),
    state(9.0, 100.0), statuses(9.5, a='COMPLETED', b='UNASSIGNED')]


def test_a_task_has_a_span_for_each_state_it_was_in():
    assert read_history(FLIGHT).spans['a'] == [
        StateSpan(1001.0, 'PENDING', ''), StateSpan(1001.2, 'ASSIGNED', ''),
        StateSpan(1002.5, 'ACTIVE', 'u1'), StateSpan(1004.0, 'COMPLETED', 'u1')]


def test_a_planned_leg_begins_where_the_uav_was_when_its_task_became_the_next():
    history = read_history(FLIGHT)
    assert history.planned == {'u1': [[(0.0, 0.0, 50.0), (50.0, 20.0, 50.0), (100.0, 0.0, 50.0)],
                                      [(50.0, 0.0, 50.0), (200.0, 0.0, 50.0)]]}
    assert history.remaining('u1') == [(100.0, 0.0, 50.0), (200.0, 0.0, 50.0)]
    assert (history.metres('u1'), round(history.metres_planned('u1'), 1)) == (100.0, 257.7)


def test_each_plan_has_its_changes_and_its_trigger():
    first, second = read_history(FLIGHT).replans
    assert first == ReplanRecord(1001.1, 2, 'new task a', 'u1 +a', 20.0, 5.0, 100.0, 1)
    assert (second.trigger, second.changed, second.listed) == ('new task b', 'u1 +b', 2)


def test_a_silent_uav_leaves_a_gap_also_at_the_end():
    history = read_history([*FLIGHT, state(9.6, 0.0, 'u2'), state(13.0, 0.0, 'u2')])
    assert history.gaps == [
        ReceptionGap('', 1004.0, 1009.0), ReceptionGap('u1', 1003.0, 1009.0),
        ReceptionGap('', 1009.6, 1013.0), ReceptionGap('u2', 1009.6, 1013.0),
        ReceptionGap('u1', 1009.0, 1013.0)]


def figure(text, name):
    """The traces and the layout of a figure in the report."""
    match = re.search(rf'Plotly\.newPlot\(\s*"{name}",\s*(\[.*?\]),\s*(\{{.*?\}}),\s*'
                      r'\{"displaylogo', text, re.DOTALL)
    return json.loads(match[1]), json.loads(match[2])


def test_the_report_has_each_task_with_its_reason_and_a_row_in_the_timeline():
    zone = ThreatZone.polygon('z', [(0, 0), (9, 0), (9, 9)], margin=2.0)
    text = report_page(read_history([*FLIGHT, {'kind': 'zones', 'wall': 1009.5,
                                'zones': [encode_zone(zone, JSON_ZONE)]}]), 'x.mcap')
    assert '<td>b</td><td>unassigned</td>' in text
    assert '<td>inside zone &lt;z&gt;</td>' in text
    traces, layout = figure(text, 'timeline')
    assert layout['yaxis']['ticktext'] == ['a', 'b']
    bars = {(trace['name'], row) for trace in traces if trace['type'] == 'bar'
            for row in trace['y']}
    assert bars == {('pending', 0), ('assigned', 0), ('active', 0), ('unassigned', 1)}
    active = next(trace for trace in traces if trace['name'] == 'active')
    assert (active['base'], active['x']) == ([3.0], [3.0])  # twice as fast as the wall
    traces, _ = figure(text, 'map')
    named = [trace['name'] for trace in traces if 'name' in trace]
    assert named == ['z', 'z', 'u1 flown', 'u1 planned', 'u1 not flown yet', '1 completed',
                     '1 unassigned']
    assert {'map', 'timeline', 'solving', 'gaps'} <= set(re.findall(r'id="(\w+)"', text))


def test_the_report_loads_nothing_from_elsewhere():
    text = report_page(read_history(FLIGHT), 'x.mcap')
    assert not re.search(r'<(script|link|img|iframe)[^>]+(src|href)=', text)
    assert "default-src 'none'" in text


def test_names_from_the_network_are_only_text():
    text = report_page(read_history([announced(0.0, **{HOSTILE: [0.0, 0.0, 0.0]}),
                      statuses(0.5, **{HOSTILE: 'ACTIVE'}), {**state(1.0, 0.0), 'uav': HOSTILE}]),
                HOSTILE, [HOSTILE])
    assert HOSTILE not in text
    assert f'<td>{escape(HOSTILE)}</td>' in text
    assert text.count('<script') == report_page(read_history(FLIGHT), 'x.mcap').count('<script')


@pytest.mark.parametrize('count', range(len(FLIGHT)))
def test_a_report_is_made_at_any_point_of_a_flight(count):
    assert 'Key figures' in report_page(read_history(FLIGHT[:count]), 'x.mcap')
