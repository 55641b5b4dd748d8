# SPDX-License-Identifier: Apache-2.0
"""What was said and what was flown, folded line by line; and when a run is over."""
import json
import math

import pytest

from uav_task_alloc import scenario
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.record import ground_truth as truth, run_state as heard
from uav_task_alloc.record.ground_truth import Truth
from uav_task_alloc.record.progress import fleet, headline, is_over
from uav_task_alloc.record.run_state import RunState, SeenZone
from uav_task_alloc.zone_codec import JSON_ZONE, encode_zone

DOME = ThreatZone.hemisphere('dome', (100.0, 0.0, 0.0), 20.0, margin=10.0)
HUT = ThreatZone.cylinder('hut', (100.0, 0.0), 20.0, z_max=30.0)


def said(*lines):
    made = RunState()
    for wall, (kind, body) in enumerate(lines):
        made.take({'wall': float(wall), 'kind': kind, **body})
    return made


def flown(*points, uav='u1', wall=0.0):
    """A flight with one sample a second."""
    made = Truth()
    for k, (x, y, z) in enumerate(points):
        made.take({'t': float(k), 'wall': wall + k, 'uav': uav, 'x': x, 'y': y, 'z': z,
                   'alive': True})
    return made


def announced(action, *names):
    return 'announcement', {'action': action, 'tasks': [
        {'id': name, 'position': [1.0, 2.0, 3.0]} for name in names]}


def zones(*there):
    return 'zones', {'zones': [encode_zone(zone, JSON_ZONE) for zone in there]}


def tasks_left(*names, distance=0.0, leg=100.0, uav='u1'):
    return 'list', {'uav': uav, 'distance': distance, 'tasks': [
        {'id': name, 'leg_distance': leg, 'via': []} for name in names]}


def state(uav='u1', mode='STANDBY', mission='VERIFIED', revision=1, active='', speed=0.0):
    return 'state', {'uav': uav, 'mode': mode, 'mission_state': mission, 'active': active,
                     'list_revision': revision, 'battery': 0.5, 'velocity': [speed, 0.0, None]}


def status(*rows):
    return 'statuses', {'statuses': [
        {'task': name, 'state': its, 'uav': 'u1', 'reason': ''} for name, its in rows]}


def test_a_task_keeps_the_time_of_its_first_announcement():
    run = said(announced('ADD', 'a'), announced('UPDATE', 'a'), announced('CANCEL', 'a'))
    assert run.tasks['a'].wall == 0.0
    assert run.cancelled == {'a'}


def test_the_clock_of_a_scenario_starts_with_its_first_task():
    run = said(('run', {'speedup': 8.0}), zones(), announced('ADD', 'a'), announced('ADD', 'b'))
    assert (run.start(), run.clock(3.0)) == (2.0, 8.0)


def test_a_zone_lasts_from_the_first_picture_with_it_to_the_first_without():
    run = said(zones(DOME), zones(DOME, HUT), zones(HUT), zones(DOME, HUT))
    assert run.zones == [SeenZone(DOME, 0.0, 2.0), SeenZone(HUT, 1.0), SeenZone(DOME, 3.0)]
    assert run.zones_now() == [HUT, DOME]


def test_the_leg_of_a_task_counts_as_planned_when_it_became_the_next():
    run = said(tasks_left('a', 'b', leg=100.0), tasks_left('a', 'b', leg=40.0),
               tasks_left('b', leg=70.0), tasks_left())
    assert run.legs == {('u1', 'a'): 100.0, ('u1', 'b'): 70.0}


def test_uploads_are_revisions_on_board_unless_a_bridge_counts_them():
    run = said(state(revision=1), state(revision=1), state(mission='UPLOADING', revision=1),
               state(revision=2), state(uav='u2', revision=0))
    assert run.uploads == 2
    run.take({'wall': 9.0, 'kind': 'uploads', 'uploads': {'u1': 3, 'u2': 1}})
    assert run.uploads == 4


def test_a_last_line_that_was_cut_short_is_left_out(tmp_path):
    line = json.dumps({'wall': 1.0, 'kind': 'allocation', 'solve_ms': 5.0, 'trigger': ''})
    (tmp_path / heard.FILE).write_text(line + '\n' + line[:20])
    assert len(heard.read_record(tmp_path).solves) == 1


@pytest.mark.parametrize(('points', 'count'), [
    ([(0, 0, 10), (60, 0, 10)], 0),  # not there yet
    ([(0, 0, 10), (75, 0, 10)], 0),  # in the margin only
    ([(0, 0, 10), (100, 0, 10)], 1),
    ([(0, 0, 10), (200, 0, 10)], 1),  # through it between two samples
    ([(0, 0, 40), (200, 0, 40)], 0),  # over it
    ([(0, 0, 10), (100, 0, 10), (0, 0, 10), (100, 0, 10)], 2),
    ([(100, 0, 10), (0, 0, 10)], 0),  # it came around the vehicle
    ([(100, 0, 10), (0, 0, 10), (100, 0, 10)], 1),
    ([], 0),
])
@pytest.mark.parametrize('zone', [DOME, HUT], ids=['dome', 'hut'])
def test_an_entry_is_a_way_from_outside_to_inside(points, count, zone):
    assert len(truth.entries(flown(*points), [SeenZone(zone, -math.inf)])) == count


def test_a_zone_is_entered_only_while_it_is_there():
    track = flown((0, 0, 10), (200, 0, 10), wall=100.0)  # inside from 100.4 to 100.6
    assert truth.entries(track, [SeenZone(HUT, 0.0, 100.3)]) == []
    assert truth.entries(track, [SeenZone(HUT, 100.5)]) == []  # it came around the vehicle
    entry, = truth.entries(track, [SeenZone(HUT, 100.2)])
    assert (entry.uav, entry.zone) == ('u1', 'hut')
    assert entry.point[0] == pytest.approx(80.0, abs=1.0)


def test_an_item_counts_for_the_task_nearest_to_it_within_reach():
    run = Truth()
    for x in (0.2, 10.1, 50.0):
        run.take({'t': 0.0, 'wall': 0.0, 'uav': 'u1', 'event': 'item_reached', 'seq': 1,
                  'x': x, 'y': 0.0, 'z': 0.0})
    visits = truth.visits(run, {'a': (0.0, 0.0, 0.0), 'b': (10.0, 0.0, 0.0)})
    assert {name: len(reached) for name, reached in visits.items()} == {'a': 1, 'b': 1}
    assert truth.visits(run, {}) == {}


def test_a_dead_vehicle_flies_no_further():
    run = flown((0, 0, 0), (30, 40, 0))
    run.take({'t': 2.0, 'wall': 2.0, 'uav': 'u1', 'event': 'died'})
    run.take({'t': 3.0, 'wall': 3.0, 'uav': 'u1', 'x': 90.0, 'y': 0.0, 'z': 0.0,
              'alive': False})
    assert run.metres() == 50.0
    assert run.died['u1'].point == (30, 40, 0)


TWO = scenario.parse("""uavs:
  - {id: u1, position: [0, 0, 0]}
  - {id: u2, position: [9, 0, 0], dies_at: 5}
tasks: [{id: a, position: [1, 2, 3]}, {id: b, position: [1, 2, 3], at: 8}]
""")
DONE = (announced('ADD', 'a', 'b'), status(('a', 'COMPLETED'), ('b', 'UNASSIGNED')), state())


def test_a_run_is_over_when_all_is_settled_and_the_living_are_at_rest():
    assert is_over(said(*DONE), TWO, clock=9.0)


@pytest.mark.parametrize('more', [
    state(mode='RETURNING'), state(speed=3.0),
    status(('a', 'COMPLETED'), ('b', 'ACTIVE')), status(('a', 'COMPLETED'))])
def test_a_run_is_not_over_while_something_is_under_way(more):
    assert not is_over(said(*DONE, more), TWO, clock=9.0)


def test_a_run_is_not_over_before_the_last_event_of_its_scenario():
    assert not is_over(said(*DONE), TWO, clock=7.0)
    assert not is_over(said(announced('ADD', 'a'), *DONE[1:]), TWO, clock=9.0)
    assert not is_over(said(*DONE[:2]), TWO, clock=9.0)


def test_the_lines_for_a_person_say_how_far_it_is():
    run = said(*DONE, zones(HUT), ('allocation', {'solve_ms': 101.4, 'trigger': '1 new task'}),
               tasks_left('a', 'b'))
    assert headline(run, 12.3) == (
        '   12 s  1 of 2 tasks completed, 1 unassigned; 1 zones; 0 re-plans, last 101 ms '
        '(1 new task)')
    line, = fleet(run, now=3.0)
    assert line.split() == ['u1', 'standby', '-', '2', 'to', 'fly', 'mission', 'verified',
                            'battery', '50', '%']
    assert 'silent' in fleet(run, now=9.0)[0]
