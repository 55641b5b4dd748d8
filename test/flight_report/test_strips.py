# SPDX-License-Identifier: Apache-2.0
"""The report shows strips: UAV of the plan, UAV that flew, breaks, and coverage."""
import re

import pytest

from uav_task_alloc.flight_report.flight_history import read_history
from uav_task_alloc.flight_report.page import key_figures, report_page
from uav_task_alloc.flight_report.strips import covered_shares, piece_rows

BEGIN = 1000.0
CORNERS = [[0.0, 0.0, 50.0], [200.0, 0.0, 50.0], [200.0, 60.0, 50.0], [0.0, 60.0, 50.0]]
WAYS = {f'field#{k}': [[0.0, 20.0 * k - 10.0, 50.0], [200.0, 20.0 * k - 10.0, 50.0]]
        for k in (1, 2, 3)}


def state(wall, uav, x, y):
    return {'kind': 'state', 'wall': BEGIN + wall, 'uav': uav, 'mode': 'MISSION', 'active': '',
            'mission_state': 'VERIFIED', 'list_revision': 1, 'battery': None, 'available': True,
            'position': [x, y, 50.0], 'velocity': [0.0, 0.0, 0.0], 'range_remaining': None}


def listed(wall, uav, *names):
    return {'kind': 'list', 'wall': BEGIN + wall, 'uav': uav, 'revision': 1, 'distance': 0.0,
            'end': 0, 'stamp': BEGIN + wall, 'tasks': [
                {'id': name, 'position': WAYS[name][0], 'via': [], 'leg_distance': 1.0,
                 'eta': 1.0, 'way': WAYS[name]} for name in names]}


def statuses(wall, **rows):
    return {'kind': 'statuses', 'wall': BEGIN + wall, 'statuses': [
        {'task': 'field', 'state': 'ACTIVE', 'uav': '', 'reason': '', 'done': 0, 'pieces': 3},
        *({'task': f'field#{name[1:]}', 'state': word, 'uav': uav, 'reason': ''}
          for name, (word, uav) in rows.items())]}


FLIGHT = [
    {'kind': 'run', 'speedup': 1.0},
    {'kind': 'announcement', 'wall': BEGIN, 'action': 'ADD', 'tasks': [
        {'id': 'field', 'position': CORNERS[0], 'value': 1.0, 'work': 'AREA', 'path': CORNERS,
         'holes': [], 'radius': None, 'strip_width': 20.0}]},
    state(0.5, 'u1', 0.0, 10.0), state(0.5, 'u2', 0.0, 30.0),
    listed(1.0, 'u1', 'field#1', 'field#3'), listed(1.0, 'u2', 'field#2'),
    statuses(1.1, p1=('ACTIVE', 'u1'), p2=('ACTIVE', 'u2'), p3=('ASSIGNED', 'u1')),
    *(state(1.2 + k, uav, 20.0 * k, y) for k in range(11) for uav, y in (('u1', 10.0),)),
    *(state(1.3 + k, 'u2', 20.0 * k, 30.0) for k in range(6)),  # half of its strip
    statuses(12.5, p1=('COMPLETED', 'u1'), p2=('ACTIVE', 'u2'), p3=('ASSIGNED', 'u1')),
    statuses(13.0, p1=('COMPLETED', 'u1'), p2=('ASSIGNED', 'u1'), p3=('ASSIGNED', 'u1')),
    listed(13.1, 'u1', 'field#2', 'field#3')]


def test_each_piece_says_for_whom_it_was_planned_and_what_became_of_it():
    one, two, three = piece_rows(read_history(sorted(
        FLIGHT, key=lambda line: line.get('wall', 0.0))))
    assert (one.state, one.planned, one.flown_by, one.share, one.interrupted) == (
        'COMPLETED', ('u1',), 'u1', 1.0, '')
    assert (two.state, two.planned, two.flown_by) == ('ASSIGNED', ('u2', 'u1'), '')
    assert two.interrupted == 'u2 at 13 s'
    assert two.share == pytest.approx(0.52, abs=0.03)  # 100 of 200 m, and 5 m beside its end
    assert (three.share, three.metres) == (0.0, 200.0)


def test_the_covered_share_is_that_of_flown_footprints():
    history = read_history(sorted(FLIGHT, key=lambda line: line.get('wall', 0.0)))
    covered = covered_shares(history, piece_rows(history))
    assert covered == {'field': pytest.approx((1.0 + 0.5) / 3.0, abs=0.02)}
    figures = dict(key_figures(history))
    assert figures['pieces interrupted'] == 1
    assert figures['field: inside flown footprints [%]'] == pytest.approx(51.0, abs=2.0)


def test_a_record_without_the_width_of_strips_says_nothing_of_footprints():
    lines = [dict(line) for line in FLIGHT]
    lines[1] = {**lines[1], 'tasks': [{key: value for key, value in lines[1]['tasks'][0].items()
                                       if key != 'strip_width'}]}
    history = read_history(sorted(lines, key=lambda line: line.get('wall', 0.0)))
    assert covered_shares(history, piece_rows(history)) == {}


def test_the_page_has_a_table_and_the_strips_on_the_map():
    text = report_page(read_history(sorted(
        FLIGHT, key=lambda line: line.get('wall', 0.0))), 'x.mcap')
    assert re.search(r'<td>field#2</td><td>assigned</td><td>u2, u1</td><td></td>', text)
    assert 'strips flown by u1' in text
    assert 'strips interrupted' in text
    assert 'field#2: assigned; planned for u2, u1; interrupted: u2 at 13 s' in text
    assert 'outline of field' in text
