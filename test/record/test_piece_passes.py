# SPDX-License-Identifier: Apache-2.0
"""Work counts as flown where vehicles truly flew along all its pieces, and each pass counts."""
from dataclasses import replace

import pytest

from uav_task_alloc.cli.report import run_summary
from uav_task_alloc.record.ground_truth import GroundTruth, Reached, TrueSample
from uav_task_alloc.record.piece_passes import piece_passes, served
from uav_task_alloc.record.run_state import RunState

WAYS = {f'field#{k}': [[0.0, 40.0 * k, 50.0], [200.0, 40.0 * k, 50.0]] for k in (1, 2)}


def run(state='COMPLETED'):
    made = RunState()
    corners = [[x, y, 50.0] for x, y in ((0.0, 0.0), (200.0, 0.0), (200.0, 120.0), (0.0, 120.0))]
    made.apply({'kind': 'announcement', 'wall': 0.0, 'action': 'ADD', 'tasks': [
        {'id': 'field', 'position': corners[0], 'work': 'AREA', 'path': corners, 'holes': []}]})
    made.apply({'kind': 'list', 'wall': 1.0, 'stamp': 1.0, 'uav': 'u1', 'revision': 1, 'end': 0,
                'distance': 400.0, 'tasks': [
                    {'id': name, 'leg_distance': 40.0, 'via': [], 'eta': 1.0, 'way': way}
                    for name, way in WAYS.items()]})
    rows = {'field': state, **dict.fromkeys(WAYS, 'COMPLETED')}
    made.apply({'kind': 'statuses', 'wall': 90.0, 'statuses': [
        {'task': name, 'state': each, 'uav': 'u1', 'reason': '', 'done': 2, 'pieces': 2}
        for name, each in rows.items()]})
    return made


def flown(*points):
    """The truth of one vehicle that was at each (x, y) 20 s after the one before."""
    return GroundTruth({'u1': [TrueSample(20.0 * k, (float(x), float(y), 50.0))
                               for k, (x, y) in enumerate(points)]})


BOTH = (-20, 40), (200, 40), (200, 80), (-20, 80)


def test_an_area_is_served_when_its_last_strip_is_flown():
    [reached] = served(run(), flown(*BOTH))['field']
    assert (reached.uav, reached.wall) == ('u1', pytest.approx(59.0, abs=1.5))
    summary = run_summary(run(), flown(*BOTH))
    assert (summary['tasks_completed'], summary['pieces_completed'], summary['tasks_lost']) == (
        1, 2, 0)
    assert summary['tasks_flown_twice'] == 0


@pytest.mark.parametrize('way', [
    ((-20, 40), (200, 40), (100, 120), (100, -20)),  # the second strip is only crossed
    ((-20, 40), (200, 40), (200, 80), (100, 80), (100, 120)),  # half of it
    ((-20, 40), (200, 40), (200, 88), (-20, 88))])  # beside it
def test_a_strip_that_nobody_flew_is_found(way):
    assert served(run(), flown(*way))['field'] == []
    assert run_summary(run(), flown(*way))['lost'] == {
        'field': 'reported as completed, but no vehicle was there'}


def test_a_strip_flown_twice_is_found():
    truth = flown(*BOTH, (-20, 40), (220, 40))
    assert [len(rows) for rows in piece_passes(run(), truth).values()] == [2, 1]
    assert run_summary(run(), truth)['flown_twice'] == ['field#1']


@pytest.mark.parametrize(('last', 'twice'), [(180.0, 0), (191.0, 0), (199.0, 1)])
def test_a_strip_that_a_lost_vehicle_began_is_not_flown_twice(last, twice):
    truth = flown(*BOTH)
    truth.tracks['lost'] = [TrueSample(20.0 * k, (x, 40.0, 50.0))
                            for k, x in enumerate((-20.0, last))]
    assert run_summary(run(), truth)['tasks_flown_twice'] == twice


@pytest.mark.parametrize(('items', 'twice'), [
    ((), []),  # on its way to something else
    ((-20.0,), []), ((200.0,), []),
    ((0.0, 200.0), ['field#1'])])
def test_a_second_pass_without_items_at_both_ends_leads_elsewhere(items, twice):
    truth = flown(*BOTH)
    truth.reached = [Reached('u1', wall, (x, y, 50.0)) for wall, x, y in (
        (1.8, 0.0, 40.0), (20.0, 200.0, 40.0), (40.0, 200.0, 80.0), (58.0, 0.0, 80.0))]
    truth.tracks['u2'] = [TrueSample(500.0, (-20.0, 40.0, 50.0)),
                          TrueSample(520.0, (220.0, 40.0, 50.0))]
    truth.reached += [Reached('u2', 500.0 + (x + 20.0) / 12.0, (x, 40.0, 50.0)) for x in items]
    assert run_summary(run(), truth)['flown_twice'] == twice


@pytest.mark.parametrize(('speedup', 'passes'), [(5, 1), (1, 0)])
def test_a_corner_that_is_overshot_for_a_moment_does_not_end_a_pass(speedup, passes):
    made = run()
    made.lists.ways['field#1'] = [(0.0, 40.0, 50.0), (20.0, 40.0, 50.0), (20.0, 60.0, 50.0),
                            (200.0, 60.0, 50.0)]
    truth = flown((-20, 40), (38, 40), (20, 62), (200, 60), (200, 80), (-20, 80))
    truth.tracks['u1'] = [replace(each, wall=each.wall / speedup) for each in truth.tracks['u1']]
    assert [len(rows) for rows in piece_passes(made, truth).values()] == [passes, 1]


def test_a_strip_that_was_left_in_between_is_not_flown():
    ways = (-20, 40), (60, 40), (60, 70), (140, 70), (140, 40), (200, 40), (200, 80), (-20, 80)
    assert [len(rows) for rows in piece_passes(run(), flown(*ways)).values()] == [0, 1]


@pytest.mark.parametrize(('again', 'passes'), [
    (60, 1), (30, 1), (0, 1), (65, 1), (85, 0), (160, 0)])
def test_a_strip_that_was_left_is_flown_when_the_vehicle_goes_on_where_it_left_it(again, passes):
    ways = (-20, 40), (60, 40), (60, 120), (again, 100), (again, 40), (200, 40), (200, 80)
    assert len(piece_passes(run(), flown(*ways))['field#1']) == passes


@pytest.mark.parametrize(('meets_at', 'passes'), [(50, 1), (60, 1), (72, 1), (90, 0), (150, 0)])
def test_a_strip_that_was_left_is_flown_when_the_rest_is_flown_from_its_other_end(
        meets_at, passes):
    ways = ((-20, 40), (60, 40), (60, 120), (220, 120), (220, 40), (meets_at, 40),
            (meets_at, 120), (150, 120))
    assert len(piece_passes(run(), flown(*ways))['field#1']) == passes


def test_a_strip_flown_in_parts_and_then_whole_is_flown_twice():
    ways = ((-20, 40), (60, 40), (60, 120), (220, 120), (220, 40), (50, 40), (50, 120), (-20, 120),
            (-20, 40), (220, 40))
    assert len(piece_passes(run(), flown(*ways))['field#1']) == 2


@pytest.mark.parametrize('stayed', [0.5, 30.0])  # [s]
@pytest.mark.parametrize(('items', 'twice'), [((0.0,), 0), ((0.0, 200.0), 1)])
def test_a_lost_vehicle_has_flown_a_strip_where_it_reached_the_end(items, twice, stayed):
    truth = flown(*BOTH)
    truth.tracks['lost'] = [TrueSample(20.0 * k, (x, 40.0, 50.0))
                            for k, x in enumerate((-20.0, 199.0))]
    truth.tracks['lost'].append(TrueSample(20.0 + stayed, (199.0, 40.0, 50.0)))
    truth.died['lost'] = truth.tracks['lost'][-1]
    truth.reached = [Reached(uav, (x + 20.0) / 10.95, (x, 40.0, 50.0)) for uav, ends in (
        ('u1', (0.0, 200.0)), ('lost', items)) for x in ends]
    assert len(piece_passes(run(), truth)['field#1']) == 1 + twice


def test_a_short_way_that_is_crossed_on_the_way_elsewhere_is_not_flown():
    made = run()
    made.lists.ways['field#1'] = [(50.0, 40.0, 50.0), (67.0, 41.0, 50.0)]
    truth = flown((62, 10), (54, 70), (54, 100), (20, 40), (90, 43))
    [reached] = piece_passes(made, truth)['field#1']
    assert reached.wall > 60.0


def test_a_task_above_the_ground_is_judged_at_the_place_in_the_list_of_its_uav():
    made = RunState()
    made.apply({'kind': 'announcement', 'wall': 0.0, 'action': 'ADD', 'tasks': [
        {'id': 'a', 'position': [100.0, 0.0, 30.0], 'vertical': 'TERRAIN'}]})
    truth = GroundTruth(reached=[Reached('u1', 9.0, (100.0, 0.0, 55.0))])
    assert served(made, truth) == {'a': []}
    made.apply({'kind': 'list', 'wall': 1.0, 'uav': 'u1', 'distance': 100.0, 'tasks': [
        {'id': 'a', 'leg_distance': 100.0, 'via': [], 'position': [100.0, 0.0, 55.0]}]})
    assert served(made, truth) == {'a': truth.reached}
