# SPDX-License-Identifier: Apache-2.0
"""The history of a flight from the lines of a record, and its report."""
import json
import re
from html import escape

import pytest

from uav_task_alloc.flight_report.figures import all_figures
from uav_task_alloc.flight_report.flight_history import (
    MAX_EVENTS,
    ReceptionGap,
    ReplanRecord,
    StateSpan,
    read_history,
)
from uav_task_alloc.flight_report.page import key_figures, report_page
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
            'position': [x, 0.0, 50.0], 'velocity': [None, None, None], 'range_remaining': None}


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


def flying(wall, uav, **more):
    return {**state(wall, 10.0 * wall, uav), 'mode': 'ON_MISSION', 'battery': 0.9 - 0.01 * wall,
            'home': [0.0, 0.0, 20.0], **more}


def test_a_uav_that_falls_silent_in_flight_is_lost_where_it_was_last():
    landed = {'mode': 'STANDBY'}
    history = read_history([*(flying(k, 'u1') for k in range(5)),
                            *(flying(k, 'u2') for k in range(20)),
                            *(flying(k, 'u3', **landed) for k in range(5))])
    assert {uav: (sample.wall, sample.point) for uav, sample in history.lost().items()} == {
        'u1': (1004.0, (40.0, 0.0, 50.0))}
    text = report_page(history, 'x.mcap')
    traces, _ = figure(text, 'map')
    [cross] = [trace for trace in traces if trace.get('name') == 'lost']
    assert (cross['text'], cross['x']) == (['u1 lost at 4 s'], [40.0])
    assert '<td class="n">4.0</td><td>40 m east, 0 m north, 50 m up</td>' in text


def test_where_the_recording_of_all_uavs_ends_together_none_is_lost():
    lines = [*(flying(k, uav) for k in range(5) for uav in ('u1', 'u2')),
             statuses(20.0, a='ACTIVE')]
    assert read_history(lines).lost() == {}
    gone = flying(4.5, 'u2', available=False)
    assert list(read_history([*lines[:-1], gone, lines[-1]]).lost()) == ['u2']


def test_the_last_position_of_a_uav_is_in_degrees_where_the_origin_is_known():
    origin = {'kind': 'origin', 'wall': BEGIN, 'latitude': 47.0, 'longitude': 8.0,
              'altitude_amsl': 400.0}
    text = report_page(read_history([origin, flying(0.0, 'u1')]), 'x.mcap')
    assert '<td>47.000000, 8.000000, 450 m AMSL</td>' in text


def test_height_above_home_and_battery_are_drawn_over_mission_time():
    text = report_page(read_history([{'kind': 'run', 'speedup': 4.0}, announced(0.0, a=[0, 0, 0]),
                                     *(flying(k, 'u1') for k in range(3))]), 'x.mcap')
    (height, battery), layout = figure(text, 'levels')
    assert (height['x'], height['y'], battery['y']) == (
        [0.0, 4.0, 8.0], [30.0, 30.0, 30.0], [90.0, 89.0, 88.0])
    assert layout['yaxis']['title']['text'] == 'height above home [m]'


def test_the_report_says_which_seconds_are_those_of_the_mission():
    begin = [{'kind': 'run', 'speedup': 2.0}, state(-30.0, 0.0), announced(0.0, a=[0, 0, 0]),
             statuses(1.0, a='ACTIVE')]
    end = [statuses(40.0, a='COMPLETED'), state(55.0, 0.0)]
    text = report_page(read_history([*begin, *end]), 'x')
    said = re.search('<p id="times">(.*?)</p>', text)[1]
    assert said == (
        'All times are mission time: 0 s is the first task announced, at 00:16:40 UTC. The '
        'mission is from 0 s to 80 s, when the last task ended; the recording is from -60 s to '
        '110 s, grey in the figures where it is not the mission. One second of the clock is 2 s '
        'of the mission.')
    _, layout = figure(text, 'timeline')
    assert [(shape['x0'], shape['x1']) for shape in layout['shapes']] == [(-60.0, 0.0),
                                                                          (80.0, 110.0)]
    assert 'when the recording ended with open tasks' in report_page(read_history(begin), 'x')
    forgotten = read_history([*begin, *end, statuses(50.0)])
    assert said in report_page(forgotten, 'x')


def test_a_plan_that_changed_nothing_is_no_replan():
    text = report_page(read_history([*FLIGHT, planned(9.4, 'background', B)]), 'x.mcap')
    assert '<td>re-plans</td><td class="n">1</td>' in text
    assert '<td>plans that changed nothing</td><td class="n">1</td>' in text
    replans = re.search('id="re-plans".*?</details>', text, re.DOTALL)[0]
    assert replans.count('<tr>') == 3  # the head, the first plan, the one for b


def test_the_report_has_the_services_as_planned_and_flown_and_their_windows():
    timed = announced(1.0, a=[100.0, 0.0, 50.0])
    timed['tasks'][0].update(service=4.0, earliest=BEGIN + 2.0)
    rows = tasks_left(1.1, A, B)
    for k, row in enumerate(rows['tasks']):
        row.update(eta=10.0 * (k + 1), wait=2.0, finish=10.0 * (k + 1) + 6.0)
    flight = [{'kind': 'run', 'speedup': 8.0, 'simulated': True}, state(0.0, 0.0), timed, rows,
              statuses(20.0, a='COMPLETED', b='ASSIGNED'), state(21.0, 100.0)]
    history = read_history(flight)
    names = {name: figure for name, _, figure in all_figures(history)}
    bars = {trace.name: list(zip(trace.base, trace.x, strict=True))
            for trace in names['services'].data}
    assert bars['planned'] == [pytest.approx((12.1, 4.0)), pytest.approx((22.1, 4.0))]
    assert bars['flown'] == [pytest.approx((15.0, 4.0))]
    assert bars['window'] == [pytest.approx((1.0, 30.0))]
    assert ('last task completed at [s]', 19.0) in key_figures(history)
    assert 'services' in report_page(history, 'x')
    assert 'services' not in {name for name, _, _ in all_figures(read_history(FLIGHT[:2]))}


def moving(wall, x, speed, mode='ON_MISSION'):
    return {**state(wall, x), 'mode': mode, 'velocity': [speed, 0.0, 0.0]}


def test_the_metres_flown_are_those_in_flight_without_jumps_of_the_estimate():
    standing = [moving(0.2 * k, 0.1 * (k % 2), 0.0, 'STANDBY') for k in range(1000)]
    assert read_history(standing).metres('u1') == 0.0
    jump = [moving(0.0, 0.0, 10.0), moving(1.0, 10.0, 10.0), moving(1.3, 80.0, 10.0),
            moving(1.6, 14.0, 10.0), moving(2.6, 24.0, 10.0), moving(3.0, 27.0, 0.0, 'LANDING'),
            moving(4.0, 28.0, 0.0, 'STANDBY'), moving(5.0, 29.0, 0.0, 'STANDBY')]
    assert read_history(jump).metres('u1') == 24.0


def test_what_a_uav_flew_while_its_states_were_not_received_counts():
    assert read_history([moving(0.0, 0.0, 0.0), moving(40.0, 400.0, 0.0)]).metres('u1') == 400.0


def row_of(text, name):
    """Cells of a row of the report."""
    cells = re.search(rf'<tr><td>{name}</td>(.*?)</tr>', text)[1]
    return [cell for cell in re.sub('<.*?>', '|', cells).split('|') if cell]


def test_a_task_ends_when_it_ended_last():
    history = read_history([announced(0.0, a=[0, 0, 0]), statuses(1.0, a='REJECTED'),
                            statuses(5.0, a='ACTIVE'), statuses(9.0, a='COMPLETED')])
    assert row_of(report_page(history, 'x'), 'a') == [
        'completed', 'u1', '2.0', '0.0', '5.0', '9.0']


def test_a_task_that_the_allocator_has_forgotten_stays_as_it_ended():
    history = read_history([announced(0.0, a=[0, 0, 0], b=[9, 0, 0]), state(0.0, 0.0),
                            statuses(10.0, a='COMPLETED', b='ACTIVE'),
                            statuses(20.0, b='COMPLETED')])
    figures = dict(key_figures(history))
    assert (figures['tasks completed'], figures.get('tasks pending')) == (2, None)
    assert row_of(report_page(history, 'x'), 'u1')[0] == '2'


def test_a_task_from_before_the_recording_is_counted_after_the_allocator_has_forgotten_it():
    begin = [state(0.0, 0.0), statuses(1.0, a='ACTIVE', b='ACTIVE'),
             statuses(10.0, a='COMPLETED', b='ACTIVE')]
    for more in ([], [statuses(20.0, b='ACTIVE')]):
        figures = dict(key_figures(read_history([*begin, *more])))
        assert figures['tasks completed'] == 1


def test_the_pieces_that_a_uav_flew_are_counted_for_it():
    whole = {'task': 'f', 'state': 'COMPLETED', 'uav': '', 'reason': '', 'done': 2, 'pieces': 2}
    line = statuses(10.0, **{'f#1': 'COMPLETED', 'f#2': 'COMPLETED'})
    line['statuses'].append(whole)
    history = read_history([announced(0.0, f=[0, 0, 0]), state(0.0, 0.0), line])
    assert row_of(report_page(history, 'x'), 'u1')[0] == '2'
    assert 'f completed' in [text for _, _, text in history.events]


def test_of_many_events_the_newest_and_the_faults_are_kept():
    modes = [{**state(float(k), 0.0), 'mode': ('HOLD', 'ON_MISSION')[k % 2]}
             for k in range(4 * MAX_EVENTS)]
    modes[50]['mode'] = 'FAULT'
    history = read_history(modes)
    assert history.events[0] == (1050.0, 'fault', 'u1: fault')
    assert (history.events[-1][0], len(history.events)) == (modes[-1]['wall'], MAX_EVENTS + 1)
    assert f'{history.dropped} earlier events are left out.' in report_page(history, 'x')
    assert history.dropped == 4 * MAX_EVENTS - len(history.events)
