# SPDX-License-Identifier: Apache-2.0
import json

from small_run import (
    BEGIN,
    FIRST,
    LATER,
    Run,
    announced,
    held,
    planned,
    state,
    statuses,
    uavs,
    zones,
)

from uav_task_alloc.live.scene import Scene
from uav_task_alloc.record.events import some
from uav_task_alloc.record.progress import fleet
from uav_task_alloc.record.run_state import RunState


def told(*moments):
    """(parts, events, plans) of the last of several moments."""
    scene = Scene(RunState())
    for lines in moments:
        for line in lines:
            scene.take(line)
        news = scene.news(lines[-1]['wall'])
    return news


def sentences(*moments):
    return [event['text'] for event in told(*moments)[1]]


def test_only_what_a_line_changed_is_told_again():
    assert set(told(FIRST)[0]) == {'tasks', 'uavs', 'list u1', 'list u2', 'statuses'}
    assert set(told(FIRST, [statuses(BEGIN + 1, t1='COMPLETED u1')])[0]) == {'statuses'}
    assert told(FIRST, [planned(BEGIN + 1, 2, 'background')])[0] == {}


def test_a_uav_reaches_its_tasks_so_long_after_the_list_was_made():
    parts, _, _ = told([{'kind': 'run', 'wall': BEGIN, 'speedup': 8.0}, *FIRST])
    assert [(task['id'], task['at']) for task in parts['list u1']['tasks']] == [
        ('t1', BEGIN + 1.2), ('t2', BEGIN + 2.5)]


def test_a_stamp_of_another_clock_is_not_believed():
    line = {**FIRST[3], 'stamp': 17.0}  # simulated time
    assert told([line])[0]['list u1']['tasks'][0]['at'] == BEGIN + 10.0


def test_a_plan_is_compared_with_the_one_before():
    _, _, [plan] = told(FIRST, LATER)
    assert (plan['revision'], plan['trigger'], plan['first']) == (2, 'new task t4', False)
    assert plan['changes'] == [
        {'uav': 'u1', 'added': [], 'removed': [['t2', 'u2']], 'reordered': False},
        {'uav': 'u2', 'added': [['t4', ''], ['t2', 'u1']], 'removed': [], 'reordered': False}]


def test_a_flown_task_is_no_change_even_where_its_status_comes_after_the_plan():
    moment = [planned(BEGIN + 9, 2, 't1 COMPLETED', u1=['t2'], u2=['t3']),
              statuses(BEGIN + 9, t1='COMPLETED u1')]
    assert told(FIRST, moment)[2][0]['changes'] == []


def test_what_happens_is_told_in_sentences():
    assert sentences(FIRST, LATER) == [
        'new zone z1', 'announced: t4, t5', 't1 completed by u1', 't5 left out: inside zone z1',
        'plan 2 (new task t4): u1 -t2, u2 +t4 +t2']
    assert sentences(FIRST, [zones(BEGIN, ('z1', 0.0, 0.0, 5.0))], [zones(BEGIN + 1)]) == [
        'zone z1 is gone']


def test_a_uav_tells_what_is_new_of_it():
    later = state(BEGIN + 1, 'u1', (0.0, 0.0), mode='FAULT', mission_state='MIXED',
                  available=False, list_revision=2)
    assert sentences(FIRST, [later]) == [
        'u1: fault', 'u1: not available', 'u1: the mission on board is mixed',
        'u1 has list 2 on board, read back']


def test_who_has_a_uav_is_told_with_the_reason():
    was = state(BEGIN, 'u1', (0.0, 0.0), authority='HELD', reason='')
    lost = state(BEGIN + 1, 'u1', (0.0, 0.0), authority='LOST', available=False,
                 reason='authority LOST: AUTO -> LOITER; given back by ~/hand_over')
    none = state(BEGIN + 1, 'u1', (0.0, 0.0), authority='NONE', reason='')
    assert sentences([was], [lost]) == [
        'u1: not available: authority LOST: AUTO -> LOITER; given back by ~/hand_over']
    assert sentences([was], [none]) == ['u1: authority NONE']


def test_a_uav_says_who_has_it_since_when_and_what_gives_it_back():
    lost = state(BEGIN + 9, 'u1', (0.0, 0.0), authority='LOST', reason='why', available=False)
    seen = {'state': 'LOST', 'why': 'AUTO -> LOITER', 'since': round(BEGIN + 6), 'back': 'x',
            'reason': 'why'}
    first = [held(BEGIN + 10, 'u1', 'LOST', 'AUTO -> LOITER', 4.0, 'x')]
    assert told([lost], first)[0]['authority'] == {'u1': seen}
    # a second later the same, but for rounding: not sent again
    assert 'authority' not in told([lost], first, [
        held(BEGIN + 11, 'u1', 'LOST', 'AUTO -> LOITER', 4.0, 'x')])[0]
    assert told([lost, held(BEGIN + 10, 'u1', 'HELD', 'older', 4.0)])[0]['authority'] == {
        'u1': {'state': 'LOST', 'why': '', 'since': None, 'back': '', 'reason': 'why'}}
    assert 'authority' not in told(FIRST)[0]  # a record of a former version


def test_the_terminal_says_who_has_a_uav():
    heard = RunState()
    for line in (state(BEGIN, 'u1', (0.0, 0.0), authority='LOST', reason='lost: why'),
                 state(BEGIN, 'u2', (0.0, 0.0), authority='HELD', reason='no position yet'),
                 state(BEGIN, 'u3', (0.0, 0.0)), held(BEGIN, 'u1', 'LOST', 'why', 5.0, '~/x'),
                 held(BEGIN, 'u2', 'HELD', 'takeoff is true', None)):
        heard.take(line)
    one, two, three = fleet(heard, BEGIN + 1.0)
    assert one.endswith('authority lost for 6 s: why; given back by ~/x')
    assert two.endswith('authority held: takeoff is true; not available: no position yet')
    assert three.endswith('battery  75 %  ')
    heard.take(state(BEGIN, 'u1', (0.0, 0.0), authority='NONE', reason='words'))
    assert fleet(heard, BEGIN)[0].endswith('authority none: words')


def test_silence_is_told_once_and_its_end_too():
    assert sentences(FIRST, [statuses(BEGIN + 3)]) == ['u1 is silent', 'u2 is silent']
    assert sentences(FIRST, [statuses(BEGIN + 3)], [statuses(BEGIN + 4)]) == []
    assert sentences(FIRST, [statuses(BEGIN + 3)], uavs(BEGIN + 4)) == [
        'u1 is heard again', 'u2 is heard again']


def test_tasks_left_out_for_one_reason_share_a_sentence():
    rows = {f'x{k}': 'UNASSIGNED  too far' for k in range(5000)}
    assert sentences([statuses(BEGIN, **rows)]) == [
        'x0, x1, x2 and 4997 more left out: too far']
    assert some(['a', 'b', 'c']) == 'a, b, c'


def test_what_the_bridge_says_is_wrong_is_with_the_uav():
    health = {'kind': 'uploads', 'wall': BEGIN, 'uploads': {},
              'health': {'u1': [1, 'link stale'], 'u2': [0, 'mission VERIFIED']}}
    parts, _, _ = told([*FIRST, health])
    assert [parts['uavs'][uav]['health'] for uav in ('u1', 'u2')] == ['link stale', '']


def test_a_big_fleet_fits_through_the_stream():
    lists = {f'u{u}': [f't{t}' for t in range(u, 5000, 200)] for u in range(200)}
    run = Run().hear(
        announced(BEGIN, [f't{t}' for t in range(5000)]),
        statuses(BEGIN, **{t: f'ASSIGNED {u}' for u, tasks in lists.items() for t in tasks}),
        planned(BEGIN, 1, 'ADD t0', **lists), *planned(BEGIN, 1, '', **lists)['lists'],
        *(state(BEGIN, uav, (1234.5, 6789.0)) for uav in lists))
    version, everything = run.board.news(0)
    run.hear(*(state(BEGIN + 1, uav, (1235.5, 6789.0)) for uav in lists))
    _, tick = run.board.news(version)
    assert len(json.loads(everything)['parts']['tasks']) == 5000
    assert len(everything) < 1_000_000  # once
    assert len(tick) < 50_000  # twice a second
