# SPDX-License-Identifier: Apache-2.0
"""The report says how soon tasks were served, and what idle UAVs flew to wait for them."""
import pytest

from uav_task_alloc.flight_report.flight_history import read_history
from uav_task_alloc.flight_report.page import key_figures, report_page
from uav_task_alloc.flight_report.waiting import demand_figure, mean_response, waiting_rows

BEGIN = 1000.0


def announced(wall, name, x, y):
    return {'kind': 'announcement', 'wall': BEGIN + wall, 'action': 'ADD', 'tasks': [
        {'id': name, 'position': [x, y, 50.0], 'value': 1.0, 'service': 4.0}]}


def completed(wall, name):
    return {'kind': 'statuses', 'wall': BEGIN + wall, 'statuses': [
        {'task': name, 'state': 'COMPLETED', 'uav': 'u1', 'reason': ''}]}


def at(wall, x):
    return {'kind': 'state', 'wall': BEGIN + wall, 'uav': 'u1', 'mode': 'HOLD', 'active': '',
            'mission_state': 'VERIFIED', 'list_revision': 1, 'battery': None, 'available': True,
            'position': [x, 0.0, 50.0], 'velocity': [None, None, None], 'range_remaining': None}


def sent(wall, *waits, tasks=()):
    return {'kind': 'list', 'wall': BEGIN + wall, 'uav': 'u1', 'revision': 1, 'distance': 0.0,
            'end': 0, 'stamp': BEGIN + wall, 'waits': [list(point) for point in waits],
            'tasks': [{'id': name, 'position': [400.0, 0.0, 50.0], 'via': [], 'leg_distance': 1.0,
                       'eta': 1.0} for name in tasks]}


PLACE, OTHER = (100.0, 0.0, 50.0), (150.0, 0.0, 50.0)
FLIGHT = [
    announced(0.0, 'a', 0.0, 0.0), at(0.0, 0.0), completed(14.0, 'a'), at(20.0, 0.0),
    sent(20.0, (50.0, 0.0, 50.0), PLACE), at(25.0, 60.0), sent(26.0, PLACE), at(30.0, 100.0),
    announced(30.0, 'b', 400.0, 0.0), sent(31.0, tasks=('b',)), at(40.0, 400.0),
    completed(60.0, 'b'), sent(61.0, OTHER), at(70.0, 300.0)]


def test_a_move_counts_once_and_metres_only_while_there_is_a_place():
    [row] = waiting_rows(read_history(FLIGHT))
    assert (row.uav, row.moves, row.metres) == ('u1', 2, 100.0)


def test_the_response_is_the_time_to_the_start_of_the_service():
    assert mean_response(read_history(FLIGHT)) == pytest.approx((10.0 + 26.0) / 2.0)


def test_the_report_has_a_section_on_waiting():
    history = read_history(FLIGHT)
    figures = dict(key_figures(history))
    assert (figures['response, mean [s]'], figures['moves to waiting places'],
            figures['metres flown for waiting']) == (18.0, 2, 100)
    text = report_page(history, 'x.mcap')
    assert '<summary>Waiting</summary>' in text
    assert 'Demand: tasks announced, and waiting places' in text
    [tasks, places] = demand_figure(history)[0].data
    assert (list(tasks.x), list(places.x)) == ([0.0, 400.0], [100.0, 100.0, 150.0])


def test_without_waiting_places_there_is_no_section():
    history = read_history([line for line in FLIGHT if not line.get('waits')])
    assert 'moves to waiting places' not in dict(key_figures(history))
    text = report_page(history, 'x.mcap')
    assert '<summary>Waiting</summary>' not in text
    assert 'id="demand"' not in text


def test_tasks_that_ended_before_the_recording_do_not_count():
    old = [{'task': f'o{k}', 'state': 'COMPLETED', 'uav': 'u1', 'reason': ''} for k in range(9)]
    flight = [{**completed(0.0, 'n'), 'statuses': old}, announced(0.1, 'o0', 0.0, 0.0),
              announced(0.1, 'n', 0.0, 0.0),
              {**completed(84.1, 'n'), 'statuses': [*old, *completed(0.0, 'n')['statuses']]}]
    history = read_history(flight)
    assert mean_response(history) == pytest.approx(80.0)
    assert list(history.run.flown) == list(history.spans) == ['n']


def test_a_task_was_announced_when_its_stamp_says_where_that_is_before_the_recording():
    flight = [{**announced(0.0, 'a', 0.0, 0.0), 'stamp': BEGIN - 50.0}, completed(14.0, 'a')]
    assert mean_response(read_history(flight)) == pytest.approx(60.0)
    late = {**announced(9.0, 'b', 0.0, 0.0), 'stamp': BEGIN - 50.0}  # of another clock
    assert read_history([*flight, late]).run.tasks['b'].wall == BEGIN + 9.0
