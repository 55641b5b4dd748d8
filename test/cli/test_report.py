# SPDX-License-Identifier: Apache-2.0
"""The key figures of a run: a completed task counts only if a vehicle was there."""
import importlib.util
import json

import pytest

from uav_task_alloc.cli import report
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.record.ground_truth import TRUTH_FILE
from uav_task_alloc.record.record_file import RECORD_FILE
from uav_task_alloc.record.run_state import RunState
from uav_task_alloc.zone_codec import JSON_ZONE, encode_zone

HUT = ThreatZone.cylinder('hut', (50.0, 0.0), 5.0)
PLACES = {'a': (0.0, 0.0, 50.0), 'b': (100.0, 0.0, 50.0), 'c': (200.0, 0.0, 50.0),
          'd': (300.0, 0.0, 50.0), 'e': (400.0, 0.0, 50.0)}
KEYS = {'tasks_announced', 'tasks_completed', 'tasks_unassigned', 'tasks_lost',
        'tasks_flown_twice', 'zone_violations', 'replans', 'resolve_ms_median',
        'resolve_ms_p99', 'uploads', 'metres_flown', 'metres_planned', 'uavs_lost', 'wall_s'}


def status(task, state, reason=''):
    return {'task': task, 'state': state, 'uav': 'u1', 'reason': reason}


def write_run(out, statuses, reached=PLACES, zones=(), solves=(100.0, 20.0, 30.0),
              plans=('ab', 'ba', 'bac'), announcements=()):
    """A run of one UAV from a to e and on, which reaches the items of `reached`."""
    lines = [{'kind': 'announcement', 'action': 'ADD', 'tasks': [
                 {'id': name, 'position': list(place)} for name, place in PLACES.items()]},
             *announcements,
             {'kind': 'zones', 'zones': [encode_zone(zone, JSON_ZONE) for zone in zones]}]
    lines += [{'kind': 'allocation', 'solve_ms': ms, 'trigger': 'x', 'lists': [
        {'uav': 'u1', 'tasks': [{'id': name} for name in names]}]}
        for ms, names in zip(solves, plans, strict=False)]
    lines += [{'kind': 'list', 'uav': 'u1', 'distance': 130.0, 'tasks': [
                   {'id': 'a', 'leg_distance': 60.0}] if first else []} for first in (1, 0)]
    lines.append({'kind': 'statuses', 'statuses': statuses})
    _jsonl(out / RECORD_FILE, [{'wall': 0.5, **line} for line in lines])
    flight = [{'t': float(k), 'wall': float(k), 'uav': 'u1', 'x': 100.0 * k, 'y': 0.0,
               'z': 50.0, 'alive': True} for k in range(5)]
    flight += [{'t': 9.0, 'wall': 9.0, 'uav': 'u1', 'event': 'item_reached', 'seq': 1,
                'x': PLACES[name][0] + 0.01, 'y': 0.0, 'z': 50.0} for name in reached]
    _jsonl(out / TRUTH_FILE, flight)


def _jsonl(path, lines):
    path.write_text(''.join(json.dumps(line) + '\n' for line in lines))


@pytest.fixture
def run(tmp_path):
    def summarise(statuses, **more):
        write_run(tmp_path, statuses, **more)
        return report.summarise(tmp_path)
    return summarise


ALL_DONE = [status(name, 'COMPLETED') for name in PLACES]


def test_a_run_without_faults(run):
    summary = run(ALL_DONE)
    assert summary.keys() >= KEYS
    assert (summary['tasks_announced'], summary['tasks_completed']) == (5, 5)
    faults = ('tasks_lost', 'tasks_flown_twice', 'tasks_unassigned', 'zone_violations')
    assert [summary[key] for key in faults] == [0, 0, 0, 0]
    assert (summary['replans'], summary['resolve_ms_median']) == (2, 25.0)
    assert summary['resolve_ms_p99'] == pytest.approx(29.9)
    assert (summary['metres_flown'], summary['metres_planned']) == (400.0, 190.0)
    json.dumps(summary, allow_nan=False)


def test_a_plan_that_changed_nothing_is_no_replan(run):
    summary = run(ALL_DONE, plans=('ab', 'ab', 'ba'))
    assert (summary['replans'], summary['plans_unchanged']) == (1, 1)
    assert summary['resolve_ms_median'] == 25.0  # it was solved for
    assert 're-plans                   1  1 more changed nothing' in (
        report.summary_table(summary))
    assert report.summary_table({**summary, 'plans_unchanged': 0}).count('nothing') == 0


def test_each_task_has_one_fate(run):
    summary = run([status('a', 'COMPLETED'), status('b', 'UNASSIGNED', 'inside zone hut'),
                   status('c', 'UNASSIGNED'), status('d', 'COMPLETED'), status('e', 'ACTIVE')],
                  reached='a')
    assert (summary['tasks_completed'], summary['tasks_unassigned']) == (1, 1)
    assert summary['unassigned'] == {'b': 'inside zone hut'}
    assert summary['lost'] == {
        'c': 'last seen UNASSIGNED', 'd': 'reported as completed, but no vehicle was there',
        'e': 'last seen ACTIVE'}
    assert summary['tasks_lost'] == 3


def test_a_task_without_any_status_is_lost(run):
    assert run(ALL_DONE[:4])['lost'] == {'e': 'no status'}


def announced(action, name):
    task = {'id': name} if action == 'CANCEL' else {'id': name, 'position': list(PLACES[name])}
    return {'kind': 'announcement', 'action': action, 'tasks': [task]}


@pytest.mark.parametrize(('actions', 'state', 'lost'), [
    (['CANCEL'], 'CANCELLED', []), (['CANCEL'], None, []), (['CANCEL'], 'COMPLETED', ['e']),
    (['CANCEL'], 'ACTIVE', ['e']), (['CANCEL', 'ADD'], 'CANCELLED', []),
    (['CANCEL', 'ADD'], None, ['e'])])
def test_a_task_is_cancelled_only_where_its_last_status_says_so(run, actions, state, lost):
    more = [status('e', state)] if state else []
    summary = run([*ALL_DONE[:4], *more], reached='abcd',
                  announcements=[announced(action, 'e') for action in actions])
    assert list(summary['lost']) == lost
    assert summary['tasks_cancelled'] == 1 - len(lost)


def test_a_task_flown_twice_is_listed(run):
    summary = run(ALL_DONE, reached=[*PLACES, 'b'])
    assert (summary['tasks_flown_twice'], summary['flown_twice']) == (1, ['b'])


def test_an_entry_into_a_zone_is_listed_with_its_position(run):
    summary = run(ALL_DONE, zones=[HUT])
    assert summary['zone_violations'] == 0  # from 0.5 s on: appeared around the vehicle
    summary = run(ALL_DONE, zones=[ThreatZone.cylinder('hut', (250.0, 0.0), 5.0)])
    assert summary['entries'] == ['u1 into hut at (245.0, 0.0, 50.0)']


def test_losses_of_separation_and_the_least_distance_are_listed(run, tmp_path):
    assert run(ALL_DONE)['separation_min_m'] is None
    pair = {'uav': 'u1', 'other': 'u2', 't': 2.0, 'wall': 2.0, 'x': 0.0, 'y': 0.0, 'z': 0.0}
    with (tmp_path / TRUTH_FILE).open('a') as file:
        for event, apart in (('separation_lost', 8.0), ('separation_regained', 4.0),
                             ('separation_lost', 9.0), ('least_distance', 4.0)):
            file.write(json.dumps({**pair, 'event': event, 'horizontal': apart,
                                   'vertical': 3.0}) + '\n')
    summary = report.summarise(tmp_path)
    assert (summary['separation_losses'], summary['separation_min_m']) == (2, 5.0)
    assert 'u1 and u2 at 1.5 s: 4.0 m apart horizontally, 3.0 m vertically' in summary['losses']
    assert 'separation losses          2  u1 and u2' in report.summary_table(summary)


def test_a_run_without_any_plan_has_figures_too(run):
    summary = run([], solves=(), reached=())
    assert (summary['replans'], summary['resolve_ms_median'], summary['wall_s']) == (0, 0.0, 0.0)
    assert 'tasks announced' in report.summary_table(summary)


def test_the_table_has_every_key_figure(run):
    text = report.summary_table(run([*ALL_DONE[:4], status('e', 'UNASSIGNED', 'inside zone hut')]))
    for words in ('tasks announced            5', 'completed                4',
                  'unassigned               1  e: inside zone hut', 'lost                     0',
                  'planned 190 (+110.5 %)', 're-plans', '25 ms  p99 30 ms', 'uploads'):
        assert words in text


def test_the_report_command_prints_the_table_and_draws_the_map(run, tmp_path, capsys):
    (tmp_path / 'summary.json').write_text(json.dumps({**run(ALL_DONE), 'wall_s': 77.0}))
    for place, wall in ((tmp_path, '0.0 s'), (tmp_path / 'summary.json', '77.0 s')):
        assert report.main([str(place)]) == 0
        assert wall in capsys.readouterr().out
    assert (tmp_path / 'map.png').stat().st_size > 10_000


def test_the_report_command_refuses_to_draw_a_demo_as_a_page(run, tmp_path):
    (tmp_path / 'summary.json').write_text(json.dumps({**run(ALL_DONE), 'wall_s': 77.0}))
    with pytest.raises(InvalidValue, match=r'--html = .*expected a recording, FILE.mcap'):
        report.main([str(tmp_path), '--html', str(tmp_path / 'page.html')])
    with pytest.raises(InvalidValue, match=r"--namespace = 'north': expected a recording"):
        report.main([str(tmp_path), '--namespace', 'north'])
    assert not (tmp_path / 'page.html').exists()


def test_the_report_command_refuses_a_folder_without_a_run(tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, 'find_spec', lambda name: None)  # with or without [view]
    with pytest.raises(SystemExit, match=r'record\.jsonl: No such file .*expected a recorded run'):
        report.main([str(tmp_path)])
    with pytest.raises(SystemExit, match=r'none: No such file .*expected a recorded run'):
        report.main([str(tmp_path / 'none')])
    with pytest.raises(SystemExit, match='2'):
        report.main([])


@pytest.mark.parametrize(('name', 'cut', 'warning'), [
    (RECORD_FILE, -5, 'record.jsonl is cut: its last line is not finished'),
    (RECORD_FILE, 0, 'record.jsonl is empty'), (TRUTH_FILE, 0, 'flight.jsonl is empty'),
    (TRUTH_FILE, -5, 'flight.jsonl is cut: its last line is not finished')])
def test_the_report_command_warns_of_a_cut_or_empty_file(
        run, tmp_path, capsys, name, cut, warning):
    run(ALL_DONE)
    data = (tmp_path / name).read_bytes()
    assert report.main([str(tmp_path)]) == 0
    assert capsys.readouterr().err == ''
    (tmp_path / name).write_bytes(data[:cut])
    assert report.main([str(tmp_path)]) == 0
    assert f'Warning: {warning}' in capsys.readouterr().err


def test_the_report_command_warns_where_a_file_ends_before_the_run(run, tmp_path, capsys):
    run([*ALL_DONE[:4], status('e', 'ACTIVE')])
    with (tmp_path / RECORD_FILE).open('a') as file:
        file.write(json.dumps({'wall': 50.0, 'kind': 'zones', 'zones': []}) + '\n')
    assert report.main([str(tmp_path)]) == 0
    assert capsys.readouterr().err.splitlines() == [
        'Warning: record.jsonl ends while 1 of 5 tasks are open',
        'Warning: flight.jsonl ends 46 s before record.jsonl']


def trip(wall, tasks, distance):
    return {'wall': wall, 'kind': 'list', 'uav': 'u1', 'distance': distance, 'tasks': [
        {'id': name, 'leg_distance': 60.0} for name in tasks]}


@pytest.mark.parametrize(('mode', 'planned'), [
    (None, 320.0), ('STANDBY', 320.0), ('RETURNING', 190.0)])
@pytest.mark.parametrize('empty', [130.0, 0.0])  # [m] of a list without tasks, where it has any
def test_each_flight_home_is_planned_length_but_one_that_was_given_up(mode, planned, empty):
    state = RunState()
    state.apply(trip(1.0, 'a', 190.0))
    state.apply(trip(2.0, '', empty))
    if mode:
        state.apply({'wall': 2.5, 'kind': 'state', 'uav': 'u1', 'mode': mode,
                     'mission_state': 'VERIFIED', 'list_revision': 2})
    state.apply(trip(3.0, 'b', 190.0))
    if mode:
        state.uavs['u1'] = {**state.uavs['u1'], 'mode': 'RETURNING'}
    state.apply(trip(4.0, '', empty))
    state.apply({'wall': 5.0, 'kind': 'statuses', 'statuses': [status('a', 'COMPLETED')]})
    assert report.planned_length(state, ['a']) == planned
