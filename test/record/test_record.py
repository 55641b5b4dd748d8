# SPDX-License-Identifier: Apache-2.0
"""The reported state and the ground truth of a run, its progress and its end."""
import json
import math

import pytest

from uav_task_alloc import scenario
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.record.ground_truth import GroundTruth, visits, zone_entries
from uav_task_alloc.record.progress import fleet_lines, headline, run_is_over
from uav_task_alloc.record.record_file import RECORD_FILE, RecordWriter, read_lines
from uav_task_alloc.record.reported import ZoneInterval
from uav_task_alloc.record.run_state import RunState, read_record
from uav_task_alloc.zone_codec import JSON_ZONE, encode_zone

DOME = ThreatZone.hemisphere('dome', (100.0, 0.0, 0.0), 20.0, margin=10.0)
HUT = ThreatZone.cylinder('hut', (100.0, 0.0), 20.0, z_max=30.0)


def run_state(*lines):
    """The state after these lines, one a second."""
    run = RunState()
    for wall, (kind, body) in enumerate(lines):
        run.apply({'wall': float(wall), 'kind': kind, **body})
    return run


def flown(*points, uav='u1', wall=0.0):
    """A flight with one sample a second."""
    truth = GroundTruth()
    for k, (x, y, z) in enumerate(points):
        truth.apply({'t': float(k), 'wall': wall + k, 'uav': uav, 'x': x, 'y': y, 'z': z,
                     'alive': True})
    return truth


def announced(action, *names):
    return 'announcement', {'action': action, 'tasks': [
        {'id': name, 'position': [1.0, 2.0, 3.0]} for name in names]}


def zones(*in_force):
    return 'zones', {'zones': [encode_zone(zone, JSON_ZONE) for zone in in_force]}


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
    run = run_state(announced('ADD', 'a'), announced('UPDATE', 'a'), announced('CANCEL', 'a'))
    assert run.tasks['a'].wall == 0.0
    assert run.cancelled == {'a'}


def test_the_clock_of_a_scenario_starts_with_its_first_task():
    run = run_state(('run', {'speedup': 8.0}), zones(), announced('ADD', 'a'),
                    announced('ADD', 'b'))
    assert (run.start(), run.clock(3.0)) == (2.0, 8.0)


def rates(**by_uav):
    return 'uploads', {'uploads': {}, 'clock_rates': by_uav}


@pytest.mark.parametrize(('given', 'measured', 'speedup'), [
    (0.0, {'u1': 7.91, 'u2': 8.05, 'lost': 0.3}, 8.0),  # the median of the fleet
    (0.0, {'u1': 5.51}, 5.51), (0.0, {'u1': 1.07}, 1.0), (0.0, {'u1': 0.5}, 0.5),
    (8.0, {'u1': 7.0}, 8.0), (0.0, {}, 1.0),
])
def test_the_clock_of_a_run_is_measured_where_no_speedup_is_given(given, measured, speedup):
    run = run_state(('run', {'speedup': given}), announced('ADD', 'a'), rates(**measured))
    assert run.scale.speedup == speedup
    assert run.clock(5.0) == pytest.approx(4.0 * speedup)


def test_a_measured_clock_does_not_follow_small_changes():
    run = run_state(('run', {'speedup': 0.0}), rates(u1=5.5), rates(u1=5.6), rates(u1=5.4))
    assert run.scale.speedup == 5.5
    run.apply({'wall': 9.0, 'kind': 'uploads', 'uploads': {}, 'clock_rates': {'u1': 20.1}})
    assert run.scale.speedup == 20.0


def test_a_zone_is_in_force_from_the_first_set_with_it_to_the_first_without():
    run = run_state(zones(DOME), zones(DOME, HUT), zones(HUT), zones(DOME, HUT))
    assert run.zones == [
        ZoneInterval(DOME, 0.0, 2.0), ZoneInterval(HUT, 1.0), ZoneInterval(DOME, 3.0)]
    assert run.zones_now() == [HUT, DOME]


def test_the_planned_leg_of_a_task_is_that_when_it_became_the_next():
    run = run_state(tasks_left('a', 'b', leg=100.0), tasks_left('a', 'b', leg=40.0),
               tasks_left('b', leg=70.0), tasks_left())
    assert run.lists.legs == {('u1', 'a'): 100.0, ('u1', 'b'): 70.0}


def test_uploads_are_revisions_on_board_unless_a_bridge_counts_them():
    run = run_state(state(revision=1), state(revision=1), state(mission='UPLOADING', revision=1),
               state(revision=2), state(uav='u2', revision=0))
    assert run.uploads == 2
    run.apply({'wall': 9.0, 'kind': 'uploads', 'uploads': {'u1': 3, 'u2': 1}})
    assert run.uploads == 4


def planned(milliseconds, trigger, **lists):
    return 'allocation', {'solve_ms': milliseconds, 'trigger': trigger, 'lists': [
        {'uav': uav, 'tasks': [{'id': name} for name in names]} for uav, names in lists.items()]}


def test_a_plan_that_changes_no_list_is_no_replan():
    first = planned(90.0, 'ADD a', u1='ab')
    run = run_state(announced('ADD', 'a', 'b', 'c'), first, planned(5.0, 'u2 silent', u1='ab'))
    assert '; 0 re-plans, last 90 ms (ADD a)' in headline(run, 1.0)
    for wall, (kind, body) in enumerate((
            planned(7.0, 'ADD c', u1='abc'), planned(8.0, 'background', u1='bc'),
            status(('a', 'COMPLETED'))), 9):  # the status arrives after the list without the task
        run.apply({'wall': float(wall), 'kind': kind, **body})
    assert '; 1 re-plan, last 7 ms (ADD c)' in headline(run, 2.0)
    run.apply({'wall': 20.0, 'kind': 'allocation', **planned(6.0, 'CANCEL b', u1='c')[1]})
    assert [each.trigger for each in run.replans()] == ['ADD c', 'CANCEL b']
    assert len(run.solves) == 5


def test_an_unfinished_last_line_is_ignored(tmp_path):
    line = json.dumps({'wall': 1.0, 'kind': 'allocation', 'solve_ms': 5.0, 'trigger': ''})
    (tmp_path / RECORD_FILE).write_text(line + '\n' + line[:20])
    assert len(read_record(tmp_path).solves) == 1


@pytest.mark.parametrize(('points', 'count'), [
    ([(0, 0, 10), (60, 0, 10)], 0),  # not there yet
    ([(0, 0, 10), (75, 0, 10)], 0),  # in the margin only
    ([(0, 0, 10), (100, 0, 10)], 1),
    ([(0, 0, 10), (200, 0, 10)], 1),  # through it between two samples
    ([(0, 0, 40), (200, 0, 40)], 0),  # over it
    ([(0, 0, 10), (100, 0, 10), (0, 0, 10), (100, 0, 10)], 2),
    ([(100, 0, 10), (0, 0, 10)], 0),  # appeared around the vehicle
    ([(100, 0, 10), (0, 0, 10), (100, 0, 10)], 1),
    ([], 0),
])
@pytest.mark.parametrize('zone', [DOME, HUT], ids=['dome', 'hut'])
def test_an_entry_leads_from_outside_to_inside(points, count, zone):
    assert len(zone_entries(flown(*points), [ZoneInterval(zone, -math.inf)])) == count


def test_a_zone_is_entered_only_while_it_is_in_force():
    track = flown((0, 0, 10), (200, 0, 10), wall=100.0)  # inside from 100.4 to 100.6
    assert zone_entries(track, [ZoneInterval(HUT, 0.0, 100.3)]) == []
    assert zone_entries(track, [ZoneInterval(HUT, 100.5)]) == []  # appeared around the vehicle
    entry, = zone_entries(track, [ZoneInterval(HUT, 100.2)])
    assert (entry.uav, entry.zone) == ('u1', 'hut')
    assert entry.point[0] == pytest.approx(80.0, abs=1.0)


def test_an_item_counts_for_the_nearest_task_if_it_is_near():
    run = GroundTruth()
    for x in (0.2, 10.1, 50.0):
        run.apply({'t': 0.0, 'wall': 0.0, 'uav': 'u1', 'event': 'item_reached', 'seq': 1,
                   'x': x, 'y': 0.0, 'z': 0.0})
    reached = visits(run, {'a': (0.0, 0.0, 0.0), 'b': (10.0, 0.0, 0.0)})
    assert {name: len(items) for name, items in reached.items()} == {'a': 1, 'b': 1}
    assert visits(run, {}) == {}


def flies_into_a_zone(step):
    """Entries of a UAV at 10 m/s into a zone that is sent at 10 Hz, moved by `step` [m]."""
    moving = [ThreatZone.hemisphere('dome', (100.0 + step * k, 0.0, 0.0), 20.0)
              for k in range(200)]
    sent = [ZoneInterval(zone, 0.1 * k, 0.1 * (k + 1)) for k, zone in enumerate(moving)]
    return zone_entries(flown(*((10.0 * k, 0.0, 5.0) for k in range(20))), sent)


def test_a_zone_that_is_sent_often_is_entered_like_one_that_stays():
    assert [len(flies_into_a_zone(step)) for step in (0.0, 0.01, -0.01)] == [1, 1, 1]


def test_a_zone_that_moves_over_a_vehicle_is_not_entered():
    moving = [ZoneInterval(ThreatZone.hemisphere('dome', (60.0 - 5.0 * k, 0.0, 0.0), 20.0),
                           float(k), k + 1.0) for k in range(30)]
    assert zone_entries(flown(*[(0.0, 0.0, 5.0)] * 30), moving) == []


def items_at_one_place(*uavs):
    truth = GroundTruth()
    for wall, uav in enumerate(uavs):
        truth.apply({'uav': uav, 'wall': float(wall), 'event': 'item_reached', 'x': 10.0,
                     'y': 0.0, 'z': 5.0})
    return truth


def test_items_at_the_place_of_several_tasks_count_for_each_of_them():
    places = dict.fromkeys('ab', (10.0, 0.0, 5.0))

    def counts(*uavs, **more):
        found = visits(items_at_one_place(*uavs), places, **more)
        return [len(found[name]) for name in 'ab']
    assert counts('u1') == [1, 0]
    assert counts('u1', 'u1') == [1, 1]
    assert counts('u1', 'u1', 'u1') == [2, 1]
    assert counts('u1', 'u1', 'u1', waited={'a'}) == [1, 1]  # one of them waited there
    assert counts('u1', owners={'b': 'u1'}) == [0, 1]
    assert counts('u1', 'u1', owners={'a': 'u1', 'b': 'u2'}) == [2, 0]


def test_a_lost_vehicle_has_no_further_track():
    run = flown((0, 0, 0), (30, 40, 0))
    run.apply({'t': 2.0, 'wall': 2.0, 'uav': 'u1', 'event': 'died'})
    run.apply({'t': 3.0, 'wall': 3.0, 'uav': 'u1', 'x': 90.0, 'y': 0.0, 'z': 0.0,
               'alive': False})
    assert run.metres() == 50.0
    assert run.died['u1'].point == (30, 40, 0)


TWO = scenario.parse("""uavs:
  - {id: u1, position: [0, 0, 0]}
  - {id: u2, position: [9, 0, 0], dies_at: 5}
tasks: [{id: a, position: [1, 2, 3]}, {id: b, position: [1, 2, 3], at: 8}]
""")
DONE = (announced('ADD', 'a', 'b'), status(('a', 'COMPLETED'), ('b', 'UNASSIGNED')), state())


def test_a_run_is_over_when_all_tasks_are_final_and_the_uavs_are_at_rest():
    assert run_is_over(run_state(*DONE), TWO, clock=9.0)


@pytest.mark.parametrize(('waits', 'over'), [([[9.0, 9.0, 50.0]], True), ([], False)])
def test_a_run_is_over_where_a_uav_stands_at_its_waiting_place(waits, over):
    waiting = 'list', {'uav': 'u1', 'revision': 2, 'tasks': [], 'end': 0, 'distance': 0.0,
                       'stamp': 3.0, 'waits': waits}
    run = run_state(*DONE, waiting, state(mode='ON_MISSION', revision=2))
    assert run_is_over(run, TWO, clock=9.0) is over


@pytest.mark.parametrize('more', [
    state(mode='RETURNING'), state(speed=3.0),
    status(('a', 'COMPLETED'), ('b', 'ACTIVE')), status(('a', 'COMPLETED'))])
def test_a_run_is_not_over_while_a_uav_moves_or_a_task_is_open(more):
    assert not run_is_over(run_state(*DONE, more), TWO, clock=9.0)


def test_tasks_that_the_allocator_has_forgotten_count_as_they_ended():
    ended, rest = status(('a', 'COMPLETED'), ('b', 'FAILED')), status(('b', 'FAILED'))
    run = run_state(*DONE, ended, rest)
    assert headline(run, 9.0).startswith('    9 s  1 of 2 tasks completed, 1 failed;')
    assert run_is_over(run, TWO, clock=9.0)


def test_a_task_that_a_restarted_allocator_does_not_know_says_so_until_it_is_announced_again():
    run = run_state(*DONE, status(('a', 'ACTIVE'), ('b', 'PENDING')), status(('b', 'PENDING')))
    known = run.statuses.known()
    assert known['a'].reason.startswith('the allocator does not know it any more')
    assert (known['a'].state, known['b'].reason) == ('PENDING', '')
    run = run_state(*DONE, status(('a', 'ACTIVE')), status(), announced('ADD', 'a'),
                    status(('a', 'ACTIVE')))
    assert run.statuses.known()['a'].state == 'ACTIVE'


def test_tasks_whose_announcement_was_not_received_count():
    run = run_state(announced('ADD', 'a'), status(('t1', 'COMPLETED'), ('t2', 'PENDING')))
    assert headline(run, 9.0).startswith('    9 s  1 of 3 tasks completed, 1 pending;')


def test_a_run_is_not_over_before_the_last_event_of_its_scenario():
    assert not run_is_over(run_state(*DONE), TWO, clock=7.0)
    assert not run_is_over(run_state(announced('ADD', 'a'), *DONE[1:]), TWO, clock=9.0)
    assert not run_is_over(run_state(*DONE[:2]), TWO, clock=9.0)


def test_the_status_lines_show_the_progress():
    allocation = 'allocation', {'solve_ms': 101.4, 'trigger': '1 new task'}
    run = run_state(*DONE, zones(HUT), allocation, tasks_left('a', 'b'))
    assert headline(run, 12.3) == (
        '   12 s  1 of 2 tasks completed, 1 unassigned; 1 zone; 0 re-plans, last 101 ms '
        '(1 new task)')
    line, = fleet_lines(run, now=3.0)
    assert line.split() == ['u1', 'standby', '-', '2', 'to', 'fly', 'mission', 'verified',
                            'battery', '50', '%']
    assert 'silent' in fleet_lines(run, now=9.0)[0]


def test_a_wait_at_a_task_is_no_second_visit_but_a_second_flight_to_it_is():
    truth = GroundTruth()
    for uav, wall, x in (('u1', 1.0, 10.0), ('u1', 31.0, 10.0), ('u1', 40.0, 20.0),
                         ('u1', 50.0, 10.0), ('u2', 60.0, 20.0), ('u2', 61.0, 20.0)):
        truth.apply({'uav': uav, 'wall': wall, 'event': 'item_reached', 'x': x, 'y': 0.0,
                     'z': 5.0})
    places = {'a': (10.0, 0.0, 5.0), 'b': (20.0, 0.0, 5.0)}
    assert [r.wall for r in visits(truth, places)['a']] == [1.0, 31.0, 50.0]
    seen = visits(truth, places, {'a'})
    assert [r.wall for r in seen['a']] == [1.0, 50.0]
    assert [r.wall for r in seen['b']] == [40.0, 60.0, 61.0]


def test_the_places_of_waits_are_those_of_the_task_and_of_the_stop_before():
    run = RunState()
    rows = [{'id': name, 'leg_distance': 1.0, 'via': [], 'eta': 1.0, 'wait': wait, 'finish': 9.0}
            for name, wait in (('a', 0.0), ('b', 12.0), ('c', 0.0))]
    run.apply({'kind': 'list', 'wall': 1.0, 'uav': 'u1', 'revision': 1, 'distance': 0.0,
               'stamp': 1.0, 'tasks': rows})
    assert run.lists.waited == {'a', 'b'}


def test_a_record_that_is_there_already_is_moved_and_never_overwritten(tmp_path):
    for k in range(3):
        record = RecordWriter(tmp_path / 'out')
        record.write({'wall': float(k)})
        record.close()
    assert record.earlier == tmp_path / 'out/earlier_2'
    assert [list(read_lines(folder / RECORD_FILE)) for folder in (
        tmp_path / 'out/earlier_1', tmp_path / 'out/earlier_2', tmp_path / 'out')] == [
        [{'wall': 0.0}], [{'wall': 1.0}], [{'wall': 2.0}]]
