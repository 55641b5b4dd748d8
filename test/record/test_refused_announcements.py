# SPDX-License-Identifier: Apache-2.0
"""What the allocator refuses changes nothing of a recorded run: tasks announced twice, zones."""
from types import SimpleNamespace

import pytest

from uav_task_alloc.model import ThreatZone
from uav_task_alloc.record.events import sentences
from uav_task_alloc.record.message_records import zones_record
from uav_task_alloc.record.run_state import RunState
from uav_task_alloc.zone_codec import JSON_ZONE, encode_zone


def announce(run, action, x, wall):
    run.apply({'kind': 'announcement', 'wall': wall, 'action': action,
               'tasks': [{'id': 't1', 'position': [x, 0.0, 50.0]}]})


def status(run, state):
    run.apply({'kind': 'statuses', 'wall': 2.0, 'statuses': [
        {'task': 't1', 'state': state, 'uav': '', 'reason': ''}]})


@pytest.mark.parametrize('state', ['ASSIGNED', 'FAILED'])
def test_a_second_add_of_a_task_moves_nothing_and_an_update_does(state):
    run = RunState()
    announce(run, 'ADD', 100.0, 1.0)
    status(run, state)
    announce(run, 'ADD', 900.0, 3.0)
    assert run.tasks['t1'].position == (100.0, 0.0, 50.0)
    announce(run, 'UPDATE', 200.0, 4.0)
    assert run.tasks['t1'].position == (200.0, 0.0, 50.0)


@pytest.mark.parametrize('state', ['COMPLETED', 'CANCELLED'])
def test_a_task_that_has_ended_moves_only_after_the_allocator_has_forgotten_it(state):
    run = RunState()
    announce(run, 'ADD', 100.0, 1.0)
    status(run, state)
    announce(run, 'UPDATE', 900.0, 3.0)
    announce(run, 'ADD', 900.0, 4.0)
    assert run.tasks['t1'].position == (100.0, 0.0, 50.0)
    run.apply({'kind': 'statuses', 'wall': 5.0, 'statuses': []})
    announce(run, 'ADD', 900.0, 6.0)
    assert run.tasks['t1'].position == (900.0, 0.0, 50.0)


@pytest.mark.parametrize('more', [{'work': 'AREA', 'path': []}, {'latest': 90.0}])
def test_an_update_to_another_kind_or_to_a_time_that_has_passed_moves_nothing(more):
    run = RunState()
    announce(run, 'ADD', 100.0, 1.0)
    status(run, 'ASSIGNED')
    row = {'id': 't1', 'position': [900.0, 0.0, 50.0]}
    for wall, change, east in ((100.0, more, 100.0), (101.0, {'latest': 200.0}, 900.0)):
        run.apply({'kind': 'announcement', 'wall': wall, 'action': 'UPDATE',
                   'tasks': [{**row, **change}]})
        assert run.tasks['t1'].position[0] == east


@pytest.mark.parametrize(('action', 'state', 'more', 'texts'), [
    ('UPDATE', 'ASSIGNED', {}, ['changed: t1']),
    ('UPDATE', 'FAILED', {}, ['changed: t1']),
    ('UPDATE', 'COMPLETED', {}, []),
    ('UPDATE', 'CANCELLED', {}, []),
    ('UPDATE', 'REJECTED', {}, []),
    ('UPDATE', 'ASSIGNED', {'latest': 1.0}, []),
    ('UPDATE', 'ASSIGNED', {'id': 't9'}, []),
    ('ADD', 'ASSIGNED', {}, []),
    ('ADD', 'REJECTED', {}, ['announced: t1']),
    ('ADD', 'ASSIGNED', {'id': 't9'}, ['announced: t9']),
    ('CANCEL', 'ASSIGNED', {}, ['to be withdrawn: t1']),
    ('CANCEL', 'FAILED', {}, ['to be withdrawn: t1']),
    ('CANCEL', 'REJECTED', {}, []),
    ('CANCEL', 'ASSIGNED', {'id': 't9'}, []),
    ('CANCEL', 'CANCELLED', {}, [])])
def test_only_what_may_change_a_task_is_an_event(action, state, more, texts):
    run = RunState()
    announce(run, 'ADD', 100.0, 1.0)
    status(run, state)
    line = {'kind': 'announcement', 'wall': 3.0, 'action': action,
            'tasks': [{'id': 't1', 'position': [900.0, 0.0, 50.0], **more}]}
    assert [text for _, text in sentences(run, line)] == texts


def test_a_second_cancel_before_the_next_statuses_is_no_event():
    run = RunState()
    announce(run, 'ADD', 100.0, 1.0)
    status(run, 'ASSIGNED')
    assert texts_of(run, 'CANCEL') == ['to be withdrawn: t1']
    announce(run, 'CANCEL', 100.0, 3.0)
    assert texts_of(run, 'CANCEL') == []
    status(run, 'CANCELLED')
    run.apply({'kind': 'statuses', 'wall': 5.0, 'statuses': []})  # forgotten
    announce(run, 'ADD', 100.0, 6.0)
    status(run, 'ASSIGNED')
    assert texts_of(run, 'CANCEL') == ['to be withdrawn: t1']


def texts_of(run, action, task_id='t1'):
    line = {'kind': 'announcement', 'wall': 3.0, 'action': action,
            'tasks': [{'id': task_id, 'position': [900.0, 0.0, 50.0]}]}
    return [text for _, text in sentences(run, line)]


@pytest.mark.parametrize(('action', 'text'), [
    ('UPDATE', 'changed: t1'), ('CANCEL', 'to be withdrawn: t1')])
def test_a_change_before_the_first_statuses_is_an_event(action, text):
    assert texts_of(RunState(), action) == [text]
    run = RunState()
    run.apply({'kind': 'statuses', 'wall': 1.0, 'statuses': [
        {'task': 't2', 'state': 'ASSIGNED', 'uav': '', 'reason': ''}]})
    assert texts_of(run, action) == []
    announce(run, 'ADD', 100.0, 2.0)
    assert texts_of(run, action) == [text]


@pytest.mark.parametrize(('action', 'text'), [
    ('UPDATE', 'changed: t1'), ('CANCEL', 'to be withdrawn: t1')])
def test_a_change_of_a_refused_task_is_an_event_once_it_was_announced_again(action, text):
    run = RunState()
    announce(run, 'ADD', 100.0, 1.0)
    status(run, 'REJECTED')
    announce(run, 'UPDATE', 200.0, 2.0)
    assert texts_of(run, action) == []
    announce(run, 'ADD', 300.0, 3.0)
    assert texts_of(run, action) == [text]
    status(run, 'REJECTED')  # so was the second one
    assert texts_of(run, action) == []


def test_the_withdrawal_of_a_piece_is_an_event():
    run = RunState()
    run.apply({'kind': 'statuses', 'wall': 1.0, 'statuses': [
        {'task': 'a1', 'state': 'ASSIGNED', 'uav': '', 'reason': ''},
        {'task': 'a1#1', 'state': 'ASSIGNED', 'uav': '', 'reason': ''}]})
    assert texts_of(run, 'CANCEL', 'a1#1') == ['to be withdrawn: a1#1']
    assert texts_of(run, 'CANCEL', 'a1#2') == []


def zone_message(zone_id, margin):
    return SimpleNamespace(zone_id=zone_id, shape=1, center=SimpleNamespace(x=50.0, y=0.0, z=0.0),
                           radius=20.0, vertices=[], z_min=0.0, z_max=200.0, margin=margin)


def test_a_zone_that_is_invalid_in_a_message_stays_as_it_was():
    run, events = RunState(), []
    for wall, zones in ((1.0, [zone_message('z1', 0.0), zone_message('z2', 0.0)]),
                        (2.0, [zone_message('z1', -1.0)])):
        line = {'wall': wall, **zones_record(SimpleNamespace(zones=zones))}
        events += [text for _, text in sentences(run, line)]
        run.apply(line)
    assert events == ['new zone z1, z2', 'zone z2 removed']
    assert [zone.id for zone in run.zones_now()] == ['z1']
    moved = ThreatZone.cylinder('z1', (70.0, 0.0), 20.0)
    run.apply({'kind': 'zones', 'wall': 3.0, 'zones': [encode_zone(moved, JSON_ZONE)],
               'kept': ['z1']})
    assert run.zones_now() == [moved]
