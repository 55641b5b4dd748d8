# SPDX-License-Identifier: Apache-2.0
"""The parts of the page and the entries of its logs that lines of a record change."""
import json
from types import SimpleNamespace

import pytest
from small_run import (
    BEGIN,
    FIRST,
    LATER,
    Run,
    announced,
    held,
    listed,
    planned,
    state,
    statuses,
    uavs,
    zones,
)

from uav_task_alloc.live.scene import Scene
from uav_task_alloc.record.diagnostic_records import uploads_record
from uav_task_alloc.record.progress import fleet_lines
from uav_task_alloc.record.run_state import RunState


def updates(*moments):
    """(parts, events, plans) of the last of several moments."""
    scene = Scene(RunState())
    for lines in moments:
        for line in lines:
            scene.apply(line)
        changes = scene.updates(lines[-1]['wall'])
    return changes


def event_texts(*moments):
    return [event['text'] for event in updates(*moments)[1]]


def test_only_parts_that_a_line_changed_are_sent_again():
    assert set(updates(FIRST)[0]) == {'tasks', 'uavs', 'list u1', 'list u2', 'statuses'}
    assert set(updates(FIRST, [statuses(BEGIN + 1, t1='COMPLETED u1')])[0]) == {
        'statuses', 'times'}
    assert updates(FIRST, [planned(BEGIN + 1, 2, 'background')])[0] == {}


def test_the_area_that_plans_stay_in_is_on_the_page():
    corners = [[0.04, 0.0], [900.0, 0.0], [900.0, 600.0]]
    parts, _, _ = updates(FIRST, [{'kind': 'fence_area', 'wall': BEGIN, 'corners': corners}])
    assert parts == {'fence_area': [[0.0, 0.0], [900.0, 0.0], [900.0, 600.0]]}


def test_arrivals_count_from_the_stamp_of_the_list():
    parts, _, _ = updates([{'kind': 'run', 'wall': BEGIN, 'speedup': 8.0}, *FIRST])
    assert [(task['id'], task['at']) for task in parts['list u1']['tasks']] == [
        ('t1', BEGIN + 1.2), ('t2', BEGIN + 2.5)]


def test_where_a_uav_waits_for_tasks_is_on_the_page():
    way = [[10.04, 20.0, 50.0], [30.0, 40.0, 50.0]]
    parts, _, _ = updates(FIRST, [{**listed(BEGIN + 1.0, 'u1', 2, []), 'waits': way}])
    assert parts['list u1'] == {'revision': 2, 'tasks': [], 'waits': [
        [10.0, 20.0, 50.0], [30.0, 40.0, 50.0]]}
    parts, _, _ = updates(FIRST, [{**listed(BEGIN + 1.0, 'u1', 2, []), 'waits': []}])
    assert 'waits' not in parts['list u1']


def test_arrivals_follow_the_measured_clock_of_the_fleet():
    measured = {'wall': BEGIN + 1.0, 'kind': 'uploads', 'uploads': {}, 'clock_rates': {'u1': 8.0}}
    parts, _, _ = updates(FIRST, [measured])
    assert {'list u1', 'list u2'} <= set(parts)
    assert [task['at'] for task in parts['list u1']['tasks']] == [BEGIN + 1.2, BEGIN + 2.5]


def test_ages_are_in_seconds_of_the_fleet():
    run = RunState()
    for line in ({'kind': 'run', 'wall': BEGIN, 'speedup': 8.0},
                 state(BEGIN, 'u1', (0.0, 0.0), authority='LOST'),
                 held(BEGIN, 'u1', 'LOST', 'why', 5.0)):
        run.apply(line)
    [shown] = fleet_lines(run, BEGIN + 1.0)
    assert shown.endswith('authority lost for 48 s: why')


def test_a_uav_shows_what_the_allocator_says_of_it():
    def said(**warnings):
        return {'wall': BEGIN + 1.0, 'kind': 'uploads', 'uploads': {}, 'uav_warnings': {
            'allocator: allocation': warnings}, 'health': {'u1': [1, 'link stale']}}
    inside = said(u2='on the ground inside zone base: no tasks', u1='inside zone base')
    shown = updates(FIRST, [inside])[0]['uavs']
    assert [shown[uav]['health'] for uav in ('u1', 'u2')] == [
        'link stale; inside zone base', 'on the ground inside zone base: no tasks']
    shown = updates(FIRST, [inside], [said()])[0]['uavs']
    assert [shown[uav]['health'] for uav in ('u1', 'u2')] == ['link stale', '']


def test_a_battery_is_low_below_the_reserve_of_the_allocator():
    def low(*more):
        shown = updates([*FIRST, state(BEGIN, 'u1', (0.0, 0.0), battery=0.25)], *more)[0]['uavs']
        return [shown[uav]['low'] for uav in ('u1', 'u2')]
    values = [SimpleNamespace(key='battery reserve', value='0.3')]
    reserve = {'wall': BEGIN + 1.0, **uploads_record(SimpleNamespace(status=[
        SimpleNamespace(name='/allocator: allocation', hardware_id='', level=0, message='running',
                        values=values)]))}
    assert low() == [False, False]  # as by default
    assert low([reserve]) == [True, False]


PROPOSAL = {'kind': 'proposal', 'wall': BEGIN + 1.0, 'revision': 7, 'open': True,
            'accepted': False, 'trigger': 'ADD t9', 'deadline': BEGIN + 31.0,
            'changes': ['u1 gains t9 (new): 2 -> 3 tasks, +90 m', 'in all +90 m']}


def test_orders_and_the_plan_that_waits_for_an_operator_are_shown():
    ordered = {'wall': BEGIN + 1.0, 'kind': 'uploads', 'uploads': {}, 'orders': {
        '/allocator': {'o1': 'pin t1 to u1 (ann)', 'o3': 'pause u2 (bob)'}}}
    parts, events, _ = updates(FIRST, [ordered, PROPOSAL])
    assert parts['orders'] == {
        'orders': [['o1', 'pin t1 to u1 (ann)'], ['o3', 'pause u2 (bob)']],
        'proposal': {'revision': 7, 'trigger': 'ADD t9', 'deadline': BEGIN + 31.0,
                     'accepted': False, 'changes': PROPOSAL['changes']}}
    assert [event['text'] for event in events] == [
        'plan 7 waits for approval: u1 gains t9 (new): 2 -> 3 tasks, +90 m; in all +90 m']
    closed = {**PROPOSAL, 'open': False, 'changes': ['plan 7: rejected by ann']}
    parts, events, _ = updates(FIRST, [ordered, PROPOSAL], [closed])
    assert parts['orders']['proposal'] is None
    assert [event['text'] for event in events] == ['plan 7: rejected by ann']
    ended = {**ordered, 'orders': {'/allocator': {}}}
    assert updates(FIRST, [ordered], [ended])[0]['orders']['orders'] == []


@pytest.mark.parametrize('ahead', [300.0, -300.0, 0.4])
def test_times_are_those_of_the_page_where_its_computer_has_another_clock(ahead):
    parts, _, _ = updates([
        {'wall': BEGIN + ahead, 'kind': 'uploads', 'uploads': {}, 'stamp': BEGIN},
        {**announced(BEGIN + ahead, []), 'tasks': [
            {'id': 't1', 'position': [1.0, 2.0, 3.0], 'latest': BEGIN + 90.0}]},
        {**listed(BEGIN + ahead, 'u1', 1, ['t1']), 'stamp': BEGIN},
        {**PROPOSAL, 'wall': BEGIN + ahead}])
    offset = ahead if abs(ahead) > 1.0 else 0.0
    assert parts['list u1']['tasks'][0]['at'] == BEGIN + offset + 10.0
    assert parts['times']['t1']['window'] == [None, BEGIN + offset + 90.0]
    assert parts['orders']['proposal']['deadline'] == BEGIN + offset + 31.0


def test_what_an_allocator_said_ends_when_it_does():
    said = {'wall': BEGIN + 1.0, 'kind': 'uploads', 'uploads': {}, 'orders': {
        '/allocator': {'o1': 'pin t1 to u1 (ann)'}}, 'uav_warnings': {
            '/allocator': {'u1': 'inside zone x'}}}
    plan = {**PROPOSAL, 'deadline': BEGIN + 900.0}
    parts, _, _ = updates(FIRST, [said, plan], [state(BEGIN + 12.0, 'u2', (0.0, 0.0))])
    assert parts['orders'] == {'proposal': None, 'orders': []}
    assert parts['uavs']['u1']['health'] == ''
    parts, _, _ = updates(FIRST, [said, plan], [state(BEGIN + 12.0, 'u2', (0.0, 0.0))],
                          [{**said, 'wall': BEGIN + 13.0}])
    assert parts['orders']['proposal']['revision'] == 7
    assert parts['orders']['orders'] == [['o1', 'pin t1 to u1 (ann)']]


def test_a_plan_does_not_wait_long_after_its_deadline():
    parts, _, _ = updates(FIRST, [PROPOSAL], [state(BEGIN + 42.0, 'u2', (0.0, 0.0))])
    assert parts['orders']['proposal'] is None


def test_a_stamp_of_another_clock_is_ignored():
    line = {**FIRST[3], 'stamp': 17.0}  # simulated time
    assert updates([line])[0]['list u1']['tasks'][0]['at'] == BEGIN + 10.0


def test_a_plan_is_compared_with_the_one_before():
    _, _, [plan] = updates(FIRST, LATER)
    assert (plan['revision'], plan['trigger'], plan['first']) == (2, 'new task t4', False)
    assert plan['changes'] == [
        {'uav': 'u1', 'added': [], 'removed': [['t2', 'u2']], 'reordered': False},
        {'uav': 'u2', 'added': [['t4', ''], ['t2', 'u1']], 'removed': [], 'reordered': False}]


def test_a_completed_task_is_no_change_even_if_its_status_comes_after_the_plan():
    moment = [planned(BEGIN + 9, 2, 't1 COMPLETED', u1=['t2'], u2=['t3']),
              statuses(BEGIN + 9, t1='COMPLETED u1')]
    assert updates(FIRST, moment)[2][0]['changes'] == []


def test_events_are_sentences():
    assert event_texts(FIRST, LATER) == [
        'new zone z1', 'announced: t4, t5', 't1 completed by u1', 't5 left out: inside zone z1',
        'plan 2 (new task t4): u1 -t2, u2 +t4 +t2']
    assert event_texts(FIRST, [zones(BEGIN, ('z1', 0.0, 0.0, 5.0))], [zones(BEGIN + 1)]) == [
        'zone z1 removed']


def test_changes_of_a_uav_are_events():
    later = state(BEGIN + 1, 'u1', (0.0, 0.0), mode='FAULT', mission_state='MIXED',
                  available=False, list_revision=2)
    assert event_texts(FIRST, [later]) == [
        'u1: fault', 'u1: not available', 'u1: the mission on board is mixed',
        'u1 has list 2 verified on board']


def test_a_change_of_authority_is_an_event_with_its_reason():
    was = state(BEGIN, 'u1', (0.0, 0.0), authority='HELD', reason='')
    lost = state(BEGIN + 1, 'u1', (0.0, 0.0), authority='LOST', available=False,
                 reason='authority LOST: AUTO -> LOITER; given back by ~/hand_over')
    none = state(BEGIN + 1, 'u1', (0.0, 0.0), authority='NONE', reason='')
    assert event_texts([was], [lost]) == [
        'u1: not available: authority LOST: AUTO -> LOITER; given back by ~/hand_over']
    assert event_texts([was], [none]) == ['u1: authority NONE']


def test_authority_has_its_time_its_reason_and_what_gives_it_back():
    lost = state(BEGIN + 9, 'u1', (0.0, 0.0), authority='LOST', reason='why', available=False)
    expected = {'state': 'LOST', 'why': 'AUTO -> LOITER', 'since': round(BEGIN + 6), 'back': 'x',
            'reason': 'why'}
    first = [held(BEGIN + 10, 'u1', 'LOST', 'AUTO -> LOITER', 4.0, 'x')]
    assert updates([lost], first)[0]['authority'] == {'u1': expected}
    # a second later the same, but for rounding: not sent again
    assert 'authority' not in updates([lost], first, [
        held(BEGIN + 11, 'u1', 'LOST', 'AUTO -> LOITER', 4.0, 'x')])[0]
    assert updates([lost, held(BEGIN + 10, 'u1', 'HELD', 'older', 4.0)])[0]['authority'] == {
        'u1': {'state': 'LOST', 'why': '', 'since': None, 'back': '', 'reason': 'why'}}
    assert 'authority' not in updates(FIRST)[0]  # a record of a former version


def test_the_terminal_shows_authority():
    run = RunState()
    for line in (state(BEGIN, 'u1', (0.0, 0.0), authority='LOST', reason='lost: why'),
                 state(BEGIN, 'u2', (0.0, 0.0), authority='HELD', reason='no position yet'),
                 state(BEGIN, 'u3', (0.0, 0.0)), held(BEGIN, 'u1', 'LOST', 'why', 5.0, '~/x'),
                 held(BEGIN, 'u2', 'HELD', 'takeoff is true', None)):
        run.apply(line)
    one, two, three = fleet_lines(run, BEGIN + 1.0)
    assert one.endswith('authority lost for 6 s: why; given back by ~/x')
    assert two.endswith('authority held: takeoff is true; not available: no position yet')
    assert three.endswith('battery  75 %  ')
    run.apply(state(BEGIN, 'u1', (0.0, 0.0), authority='NONE', reason='words'))
    assert fleet_lines(run, BEGIN)[0].endswith('authority none: words')


def test_an_alert_whose_difference_in_height_is_unknown_is_an_event():
    alert = {'kind': 'separation', 'wall': BEGIN + 1.0, 'uavs': ['u1', 'u2'], 'horizontal': 4.0,
             'vertical': None, 'until': 3.0, 'action': 'HOLD', 'holder': 'u1',
             'reason': 'u1 holds'}
    assert event_texts(FIRST, [alert]) == ['u1 and u2 would be 4 m apart, in 3 s: u1 holds']


def test_silence_and_its_end_are_one_event_each():
    assert event_texts(FIRST, [statuses(BEGIN + 3)]) == ['u1 is silent', 'u2 is silent']
    assert event_texts(FIRST, [statuses(BEGIN + 3)], [statuses(BEGIN + 4)]) == []
    assert event_texts(FIRST, [statuses(BEGIN + 3)], uavs(BEGIN + 4)) == [
        'u1 reports again', 'u2 reports again']


def test_tasks_left_out_for_one_reason_share_a_sentence():
    rows = {f'x{k}': 'UNASSIGNED  too far' for k in range(5000)}
    assert event_texts([statuses(BEGIN, **rows)]) == [
        'x0, x1, x2 and 4997 more left out: too far']


def test_the_health_of_a_uav_is_that_of_the_diagnostics():
    health = {'kind': 'uploads', 'wall': BEGIN, 'uploads': {},
              'health': {'u1': [1, 'link stale'], 'u2': [0, 'mission VERIFIED']}}
    parts, _, _ = updates([*FIRST, health])
    assert [parts['uavs'][uav]['health'] for uav in ('u1', 'u2')] == ['link stale', '']
    parts, _, _ = updates([*FIRST, {**health, 'health': {'u1': [2, '']}}])
    assert parts['uavs']['u1']['health'] == 'a warning without a text'


def test_a_big_fleet_fits_through_the_stream():
    lists = {f'u{u}': [f't{t}' for t in range(u, 5000, 200)] for u in range(200)}
    run = Run().add(
        announced(BEGIN, [f't{t}' for t in range(5000)]),
        statuses(BEGIN, **{t: f'ASSIGNED {u}' for u, tasks in lists.items() for t in tasks}),
        planned(BEGIN, 1, 'ADD t0', **lists), *planned(BEGIN, 1, '', **lists)['lists'],
        *(state(BEGIN, uav, (1234.5, 6789.0)) for uav in lists))
    version, everything = run.snapshots.updates_since(0)
    run.add(*(state(BEGIN + 1, uav, (1235.5, 6789.0)) for uav in lists))
    _, tick = run.snapshots.updates_since(version)
    assert len(json.loads(everything)['parts']['tasks']) == 5000
    assert len(everything) < 1_000_000  # once
    assert len(tick) < 50_000  # twice a second


@pytest.mark.parametrize(('velocity', 'speed', 'course'), [
    ([0.0, 12.0, 0.0], 12.0, 0), ([3.0, -3.0, 5.0], 4.2, 135), ([-2.0, 0.0, 0.0], 2.0, 270),
    ([-1e-3, 9.0, 0.0], 9.0, 0), ([0.2, 0.1, 3.0], 0.2, None), ([None, None, None], None, None)])
def test_a_uav_has_its_speed_and_while_it_moves_its_course(velocity, speed, course):
    part = updates([state(BEGIN, 'u1', (0.0, 0.0), velocity=velocity)])[0]['uavs']['u1']
    assert (part['speed'], part['course'], part['home']) == (speed, course, None)


def test_the_height_of_the_home_and_the_origin_are_sent_where_they_are_known():
    origin = {'kind': 'origin', 'wall': BEGIN, 'latitude': 47.0, 'longitude': 8.0,
              'altitude_amsl': 400.0}
    parts, _, _ = updates([origin, state(BEGIN, 'u1', (0.0, 0.0), home=[1.0, 2.0, -6.04])])
    assert (parts['origin'], parts['uavs']['u1']['home']) == ([47.0, 8.0, 400.0], -6.0)


def test_a_plan_that_changed_nothing_is_no_event():
    assert event_texts(FIRST, [planned(BEGIN + 1, 2, 'background', u1=['t1', 't2'],
                                       u2=['t3'])]) == []


def test_services_are_shown_as_planned_and_as_flown_with_their_windows():
    timed = announced(BEGIN, ['t1', 't2'])
    timed['tasks'][0].update(service=4.0, earliest=BEGIN + 11.0, latest=BEGIN + 30.0)
    lines = [timed, *FIRST[1:], statuses(BEGIN + 17, t1='COMPLETED u1', t2='ACTIVE u1')]
    for simulated, flown_for in ((True, 4.0), (False, 0.5)):
        run = {'kind': 'run', 'wall': BEGIN, 'speedup': 8.0, 'simulated': simulated}
        parts, _, _ = updates([run, *lines])
        quick = 1.0 if simulated else 8.0
        assert parts['times'] == {'t1': {
            'planned': ['u1', BEGIN + 12 / quick, round(BEGIN + 15 / quick, 1)],
            'flown': ['u1', BEGIN + 17 - flown_for, BEGIN + 17],
            'window': [BEGIN + 11, BEGIN + 30]}}
        assert parts['list u1']['tasks'][1]['service'] == [
            round(BEGIN + 22 / quick, 1), round(BEGIN + 25 / quick, 1)]


def test_a_list_of_an_earlier_version_has_no_services():
    old = listed(BEGIN, 'u1', 1, ['t1'])
    del old['tasks'][0]['finish']
    parts, _, _ = updates([announced(BEGIN, ['t1']), old])
    assert 'service' not in parts['list u1']['tasks'][0]
    assert 'times' not in parts


def test_an_ended_task_that_the_allocator_has_forgotten_stays_as_it_ended():
    done = statuses(BEGIN + 10, t1='COMPLETED u1', t2='CANCELLED', t3='ACTIVE u2')
    forgotten = statuses(BEGIN + 20, t3='ACTIVE u2')
    parts, events, _ = updates(FIRST, [done], [forgotten])
    assert parts['statuses'] == {'t1': ['COMPLETED', 'u1', ''], 't2': ['CANCELLED', '', ''],
                                 't3': ['ACTIVE', 'u2', '']}
    assert events == []


def test_a_forgotten_task_that_is_announced_again_is_a_new_one():
    rounds = [[announced(BEGIN + wall, ['t1']), statuses(BEGIN + wall, t1='ACTIVE u1'),
               statuses(BEGIN + wall + 9.0, t1='COMPLETED u1'), statuses(BEGIN + wall + 10.0)]
              for wall in (0.0, 100.0)]
    scene = Scene(RunState())
    for line in [*rounds[0], *rounds[1]]:
        scene.apply(line)
    assert scene.run.flown['t1'].end == BEGIN + 109.0
    assert scene.run.tasks['t1'].wall == BEGIN + 100.0
    assert scene.run.start() == BEGIN  # the clock of the mission goes on
    scene.apply(announced(BEGIN + 200.0, ['t1']))
    assert scene.part('statuses') == {}


FIELD = {'id': 'field', 'position': [0.0, 0.0, 40.0], 'value': 1.0, 'service': 0.0,
         'work': 'AREA', 'holes': [], 'radius': None,
         'path': [[0.0, 0.0, 40.0], [200.0, 0.0, 40.0], [200.0, 40.0, 40.0], [0.0, 40.0, 40.0]]}


def with_ways(line):
    """A list whose pieces `field#k` are strips from west to east."""
    rows = [{**row, 'way': [[0.0, 20.0 * int(row['id'][-1]) - 10.0, 40.0],
                            [200.0, 20.0 * int(row['id'][-1]) - 10.0, 40.0]]}
            for row in line['tasks']]
    return {**line, 'tasks': rows}


def survey(wall, done):
    """The statuses of a field of two strips, of which so many are done."""
    states = ['COMPLETED'] * done + ['ASSIGNED'] * (2 - done)
    return {'kind': 'statuses', 'wall': wall, 'statuses': [
        {'task': 'field', 'state': 'ASSIGNED', 'uav': 'u1', 'reason': f'{done} of 2 strips',
         'done': done, 'pieces': 2},
        *({'task': f'field#{k}', 'state': state, 'uav': 'u1', 'reason': ''}
          for k, state in enumerate(states, 1))]}


def test_an_area_has_its_outline_its_strips_and_those_that_are_flown():
    begin = [{'kind': 'announcement', 'wall': BEGIN, 'action': 'ADD', 'tasks': [FIELD]},
             with_ways(listed(BEGIN, 'u1', 1, ['field#1', 'field#2'])), survey(BEGIN, 0)]
    parts, _, _ = updates(begin)
    assert parts['works']['field'] == {
        'kind': 'AREA', 'path': FIELD['path'], 'holes': [], 'radius': 0.0, 'done': 0,
        'pieces': 2, 'strips': [], 'by': {}}
    assert parts['statuses'] == {'field': ['ASSIGNED', 'u1', '0 of 2 strips']}
    first = parts['list u1']['tasks'][0]
    assert (first['id'], first['way']) == ('field#1', [[0.0, 10.0, 40.0], [200.0, 10.0, 40.0]])
    parts, _, _ = updates(begin, [survey(BEGIN + 9.0, 1),
                                  with_ways(listed(BEGIN + 9.0, 'u1', 2, ['field#2']))])
    assert parts['works']['field']['done'] == 1
    assert parts['works']['field']['by'] == {'u1': 1}
    assert parts['works']['field']['strips'] == [[[0.0, 10.0, 40.0], [200.0, 10.0, 40.0]]]


def test_the_state_of_a_piece_is_one_event():
    flown = {'field': 'ACTIVE', 'field#1': 'COMPLETED u1', 'field#2': 'ACTIVE u1'}
    first, then = statuses(BEGIN + 1, **flown), statuses(BEGIN + 2, **flown)
    assert 'field#1 completed by u1' in event_texts(FIRST, [first])
    assert event_texts(FIRST, [first], [then]) == []
