# SPDX-License-Identifier: Apache-2.0
"""Reports of nodes that follow one another: zones that change, several that report one UAV."""
import pytest

from uav_task_alloc.model import ThreatZone
from uav_task_alloc.record.events import sentences
from uav_task_alloc.record.run_state import RunState
from uav_task_alloc.zone_codec import JSON_ZONE, encode_zone

ONE = ThreatZone.cylinder('z1', (70.0, 0.0), 20.0)
GROWN = ThreatZone.cylinder('z1', (70.0, 0.0), 80.0)
OTHER = ThreatZone.cylinder('z2', (170.0, 0.0), 20.0)


def zones(wall, *in_force, kept=()):
    return {'kind': 'zones', 'wall': wall, 'kept': list(kept),
            'zones': [encode_zone(zone, JSON_ZONE) for zone in in_force]}


@pytest.mark.parametrize(('then', 'texts'), [
    (zones(1.0, OTHER, ONE), []), (zones(1.0, GROWN, OTHER), ['zone z1 changed']),
    (zones(1.0, OTHER, kept=['z1']), []), (zones(1.0, OTHER), ['zone z1 removed'])])
def test_a_zone_that_changes_is_an_event_and_one_that_is_repeated_is_not(then, texts):
    run = RunState()
    run.apply(zones(0.0, ONE, OTHER))
    assert [text for _, text in sentences(run, then)] == texts


def reports(wall, health=(), **uploads):
    return {'kind': 'uploads', 'wall': wall, 'uploads': uploads, 'health': {
        name: [level, text, 'u1'] for name, level, text in health}}


LINK, LENS = ('/bridge: u1', 1, 'link stale'), ('/camera: lens', 2, 'lens covered')


@pytest.mark.parametrize(('rows', 'shown'), [
    ([[LINK], [('/camera: lens', 0, 'ok')]], 'link stale'),
    ([[LINK], [LENS]], 'lens covered; link stale'), ([[LINK, LENS]], 'lens covered; link stale'),
    ([[LINK], [LENS], [('/bridge: u1', 0, 'mission VERIFIED')]], 'lens covered'),
    ([[LINK], [('/bridge_2: u1', 1, 'link stale')]], 'link stale')])
def test_a_report_of_one_node_on_a_uav_does_not_hide_that_of_another(rows, shown):
    run = RunState()
    for wall, row in enumerate(rows):
        run.apply(reports(float(wall), row))
    assert run.trouble('u1') == shown


def test_the_report_of_a_node_that_has_ended_gives_way_to_those_of_another():
    run = RunState()
    run.apply(reports(0.0, [LINK]))
    run.apply(reports(30.0, [('/bridge_2: u1', 0, 'mission VERIFIED')]))
    assert run.trouble('u1') == ''


def test_recordings_of_earlier_versions_have_one_report_of_a_uav():
    run = RunState()
    for level, shown in ((1, 'link stale'), (0, '')):
        run.apply({'kind': 'uploads', 'wall': 0.0, 'uploads': {},
                   'health': {'u1': [level, 'link stale']}})
        assert run.trouble('u1') == shown


def test_uploads_of_a_bridge_that_was_restarted_count():
    run = RunState()
    for wall, (one, two) in enumerate(((3, 1), (0, 1), (2, 1), (1, 4))):
        run.apply(reports(float(wall), u1=one, u2=two))
    assert run.uploads == 3 + 2 + 1 + 4


def test_warnings_that_are_of_no_uav_are_those_of_nodes_and_links_for_a_while():
    run = RunState()
    run.apply({'kind': 'uploads', 'wall': 0.0, 'uploads': {}, 'health': {
        '/bridge: u1': [1, 'link stale', 'u1'], '/bridge: udpin': [2, 'closed', 'udpin'],
        '/allocator: allocation': [1, '', ''], '/bridge: heartbeat': [0, '3 sent', 'heartbeat']}})
    assert run.bridges.other_warnings(['u1'], 9.0, 1.0) == [
        '/allocator: allocation: a warning without a text', '/bridge: udpin: closed']
    assert run.bridges.other_warnings(['u1'], 11.0, 1.0) == []


@pytest.mark.parametrize(('reason', 'text'), [
    ('cut again: zones changed', 'field#1, field#2 cut again: zones changed'),
    ('cancelled', 'field#1, field#2 withdrawn')])
def test_pieces_that_are_cut_again_are_not_said_to_be_withdrawn(reason, text):
    line = {'kind': 'statuses', 'wall': 1.0, 'statuses': [
        {'task': piece, 'state': 'CANCELLED', 'uav': '', 'reason': reason}
        for piece in ('field#1', 'field#2')]}
    assert list(sentences(RunState(), line)) == [('task', text)]


def test_flown_pieces_that_the_allocator_has_forgotten_are_known_until_their_task_is_a_new_one():
    def rows(wall, **states):
        return {'kind': 'statuses', 'wall': wall, 'statuses': [
            {'task': task.replace('_', '#'), 'state': state, 'uav': 'u1', 'reason': ''}
            for task, state in states.items()]}
    run = RunState()
    add = {'kind': 'announcement', 'wall': 0.0, 'action': 'ADD', 'tasks': [
        {'id': 'field', 'position': [1.0, 2.0, 3.0], 'work': 'AREA'}]}
    for line in (add, rows(1.0, field='ASSIGNED', field_1='COMPLETED', field_2='ASSIGNED'),
                 rows(2.0, field='COMPLETED', field_1='COMPLETED', field_2='COMPLETED'),
                 rows(3.0), rows(4.0)):
        run.apply(line)
    assert {name: row.state for name, row in run.statuses.known_pieces().items()} == {
        'field#1': 'COMPLETED', 'field#2': 'COMPLETED'}
    run.apply({**add, 'wall': 5.0})
    assert run.statuses.known_pieces() == {}
