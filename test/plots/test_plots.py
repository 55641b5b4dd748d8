# SPDX-License-Identifier: Apache-2.0
"""Figures are drawn for all kinds of input; legends, labels and colours are as intended."""
import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from uav_task_alloc import palette, plots
from uav_task_alloc.model import Leg, Plan, Task, ThreatZone, Uav
from uav_task_alloc.model.route_stops import route_points, route_stops
from uav_task_alloc.plots import labels, plan as plan_map, space, style, times
from uav_task_alloc.plots.flat import MapFigure
from uav_task_alloc.record.ground_truth import TRUTH_FILE
from uav_task_alloc.record.record_file import RECORD_FILE
from uav_task_alloc.separation.rule import Conflict
from uav_task_alloc.timetable import Timetable
from uav_task_alloc.zone_codec import JSON_ZONE, encode_zone

ZONES = [ThreatZone.hemisphere('dome', (100.0, 100.0, 0.0), 30.0, margin=5.0),
         ThreatZone.polygon('field', [(200.0, 0.0), (260.0, 10.0), (230.0, 60.0)])]
PNG = b'\x89PNG'


DRAW = pytest.mark.parametrize('draw', [plots.draw_plan, plots.draw_plan_3d,
                                        plots.draw_plan_times])


@DRAW
@pytest.mark.parametrize('returns', [False, True])
def test_a_plan_is_drawn(tmp_path, draw, returns):
    uavs = [Uav('u1', (0.0, 0.0, 0.0)), Uav('u2', (300.0, 0.0, 0.0))]
    tasks = [Task('a', (50.0, 90.0, 40.0)), Task('b', (220.0, 20.0, 40.0))]
    legs = (Leg(((10.0, 50.0, 20.0),), 120.0), *[Leg((), 100.0)] * returns)
    plan = Plan({'u1': ('a',), 'u2': ()}, {'b': 'inside zone field'}, 120.0, 1.0,
                legs={'u1': legs, 'u2': ()}, returns=returns)
    draw(uavs, tasks, ZONES, plan, tmp_path / 'plan.png')
    assert (tmp_path / 'plan.png').read_bytes().startswith(PNG)


@pytest.mark.parametrize('draw', [plots.draw_plan, plots.draw_plan_times])
def test_conflicts_are_marked_where_they_are_red_where_not_resolved(tmp_path, draw, monkeypatch):
    marked = []
    monkeypatch.setattr(MapFigure, 'conflict', lambda _, *mark: marked.append(mark))
    found = [Conflict(('u1', 'u2'), ('a', 'b'), 5.0, 1.0, 0.0, kind, '', place)
             for kind, place in (('height', (1.0, 2.0, 3.0)), ('', (4.0, 5.0, 6.0)),
                                 ('hold', None))]
    plan = Plan({}, conflicts=tuple(found))
    draw([], [], [], plan, tmp_path / 'plan.png')
    assert marked == [((1.0, 2.0, 3.0), '#202020'), ((4.0, 5.0, 6.0), palette.RED)]
    assert [each.get_label() for each in plan_map.legend_handles([], [], plan)] == [
        'conflicts resolved: 1', 'conflicts NOT resolved: 1']


@DRAW
def test_a_plan_with_conflicts_is_drawn(tmp_path, draw):
    each = Conflict(('u1', 'u2'), ('a', 'b'), 5.0, 1.0, 0.0, 'hold', '', (10.0, 20.0, 30.0))
    draw([], [Task('a', (50.0, 90.0, 40.0))], [], Plan({}, {'a': 'no UAV'}, conflicts=(each,)),
         tmp_path / 'plan.png')
    assert (tmp_path / 'plan.png').read_bytes().startswith(PNG)


@DRAW
def test_an_empty_plan_is_drawn(tmp_path, draw):
    draw([], [], [], Plan({}), tmp_path / 'plan.png')
    assert (tmp_path / 'plan.png').read_bytes().startswith(PNG)


@DRAW
def test_many_tasks_are_drawn_without_names(tmp_path, draw, monkeypatch):
    written, annotate = [], labels.Axes.annotate

    def record(axes, text, *args, **kwargs):
        written.append(text)
        return annotate(axes, text, *args, **kwargs)
    monkeypatch.setattr(labels.Axes, 'annotate', record)
    tasks = [Task(f't{i}', (10.0 * i, 0.0, 40.0)) for i in range(style.MAX_NAMED_TASKS + 1)]
    draw([], tasks, [], Plan({}, {task.id: 'no UAV' for task in tasks}), tmp_path / 'plan.png')
    assert not [text for text in written if text.startswith('t')]


def test_a_figure_has_the_size_of_a_full_hd_projector(tmp_path):
    plots.draw_plan([], [], [], Plan({}), tmp_path / 'plan.png')
    header = (tmp_path / 'plan.png').read_bytes()[16:24]
    assert (int.from_bytes(header[:4], 'big'), int.from_bytes(header[4:], 'big')) == (1920, 1080)


def test_the_axes_are_labelled_with_units():
    flat, deep = MapFigure([], 0).axes, space.Figure().add_subplot(projection='3d')
    space._set_axes(deep, np.zeros(3), np.array((1000.0, 900.0, 80.0)))
    assert (flat.get_xlabel(), flat.get_ylabel()) == ('east [m]', 'north [m]')
    assert (deep.get_xlabel(), deep.get_ylabel(), deep.get_zlabel()) == (
        'east [m]', 'north [m]', 'up [m], drawn 3 times')


def test_the_legend_of_a_large_fleet_is_limited():
    uavs = [Uav(f'u{i}', (float(i), 0.0, 0.0)) for i in range(40)]
    result = Plan({uav.id: ('t',) * (i < 30) for i, uav in enumerate(uavs)})
    texts = [handle.get_label() for handle in plan_map.legend_handles(
        uavs, [Task('t', (0.0, 0.0, 0.0))], result)]
    assert texts[0] == 'u0: 1 task, 0 m'
    assert texts[style.LEGEND_ROWS:] == [
        f'{30 - style.LEGEND_ROWS} more UAVs with tasks', '10 without tasks']


def test_in_3d_a_zone_is_drawn_to_its_height_and_cut_where_that_is_excessive():
    points = [(0.0, 0.0, 0.0), (100.0, 0.0, 50.0)]
    low, high = space.box_limits(points, [ThreatZone.cylinder('c', (0.0, 0.0), 10.0, z_max=70.0)])
    assert (low[2], high[2] > 70.0) == (0.0, True)
    _, high = space.box_limits(points, [ThreatZone.cylinder('c', (0.0, 0.0), 10.0, z_max=700.0)])
    assert 50.0 < high[2] < 75.0
    _, high = space.box_limits(points, [ThreatZone.hemisphere('h', (0.0, 0.0, 0.0), 300.0)])
    assert high[2] > 300.0


def test_labels_of_close_markers_do_not_overlap():
    axes = labels.Axes(space.Figure(figsize=(5.0, 5.0)), (0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, 100.0), ylim=(0.0, 100.0))
    labels.place_labels(axes, [labels.Label(name, x, 50.0, 10.0, 8.0)
                        for name, x in (('first', 50.0), ('second', 53.0))], [])
    axes.figure.draw_without_rendering()
    first, second = (text.get_window_extent() for text in axes.texts)
    assert not first.overlaps(second)


def test_a_long_label_does_not_cover_a_marker_though_lines_are_beside_it():
    axes = labels.Axes(space.Figure(figsize=(5.0, 5.0)), (0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, 100.0), ylim=(0.0, 100.0))
    lines = [((x, 0.0), (x, 100.0)) for x in (30.0, 40.0, 45.0, 50.0)]
    lines += [((50.0, y), (100.0, y)) for y in (47.0, 53.0)]
    labels.place_labels(axes, [labels.Label('a long label of a place', 50.0, 50.0, 10.0, 5.0),
                               labels.Label('b', 60.0, 50.0, 1.0, 4.0)], lines)
    axes.figure.draw_without_rendering()
    assert not axes.texts[0].get_window_extent().contains(*axes.transData.transform((60.0, 50.0)))


# Machado, Oliveira and Fernandes 2009, "A Physiologically-based Model for Simulation of Color
# Vision Deficiency", severity 1.0; on linear RGB
COLOUR_VISION = {
    'all colours': np.eye(3),
    'no red': [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
               [-0.003882, -0.048116, 1.051998]],
    'no green': [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                 [-0.011820, 0.042940, 0.968881]],
    'no blue': [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                [0.004733, 0.691367, 0.303900]],
}


def lab(colour, vision):
    """CIE L*a*b* (D65) of a colour, after the matrix of a colour vision."""
    rgb = np.array(palette.rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722],
                    [0.0193, 0.1192, 0.9505]]) @ np.clip(vision @ linear, 0.0, 1.0)
    f = np.cbrt(xyz / (0.9505, 1.0, 1.089))
    return 116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])


@pytest.mark.parametrize('vision', COLOUR_VISION)
def test_colours_are_distinct_with_every_kind_of_colour_vision(vision):
    perceived = {colour: lab(colour, np.array(COLOUR_VISION[vision]))
                 for colour in (*palette.UAV_COLOURS, palette.RED)}
    for a, b in itertools.combinations(perceived, 2):  # 2.3 is the just noticeable difference
        assert math.dist(perceived[a], perceived[b]) > 12.0, (a, b)


def write(path, *lines):
    path.write_text(''.join(json.dumps(line) + '\n' for line in lines))


def test_a_flight_with_a_late_zone_a_late_task_and_a_lost_uav_is_drawn(tmp_path):
    def add(wall, name, *place):
        return {'wall': wall, 'kind': 'announcement', 'action': 'ADD',
                'tasks': [{'id': name, 'position': place}]}
    write(tmp_path / RECORD_FILE,
          add(1.0, 'a', 50.0, 90.0, 40.0), add(2.0, 'b', 10.0, 20.0, 30.0),
          {'wall': 1.0, 'kind': 'zones', 'zones': [encode_zone(ZONES[0], JSON_ZONE)]},
          {'wall': 2.0, 'kind': 'zones',
           'zones': [encode_zone(zone, JSON_ZONE) for zone in ZONES]})
    write(tmp_path / TRUTH_FILE,
          *({'t': float(k), 'wall': float(k), 'uav': 'u1', 'x': 25.0 * k, 'y': 45.0 * k,
             'z': 40.0, 'alive': True} for k in range(4)),
          {'t': 2.0, 'wall': 2.0, 'uav': 'u1', 'event': 'item_reached', 'x': 50.0, 'y': 90.0,
           'z': 40.0},
          {'t': 3.0, 'wall': 3.0, 'uav': 'u1', 'event': 'died'})
    plots.draw_flight(tmp_path, tmp_path / 'map.png')
    assert (tmp_path / 'map.png').read_bytes().startswith(PNG)


def test_tasks_that_the_allocator_has_forgotten_count_for_the_uav_that_flew_them(
        tmp_path, monkeypatch):
    row = {'task': 'a', 'state': 'COMPLETED', 'uav': 'u1', 'reason': ''}
    write(tmp_path / RECORD_FILE,
          {'wall': 1.0, 'kind': 'announcement', 'action': 'ADD',
           'tasks': [{'id': 'a', 'position': [50.0, 90.0, 40.0]}]},
          {'wall': 2.0, 'kind': 'statuses', 'statuses': [row]},
          {'wall': 3.0, 'kind': 'statuses', 'statuses': []})
    write(tmp_path / TRUTH_FILE, {'t': 0.0, 'wall': 0.0, 'uav': 'u1', 'x': 0.0, 'y': 0.0,
                                  'z': 40.0, 'alive': True})
    texts = []
    monkeypatch.setattr(MapFigure, 'finish', lambda _, title, handles, png: texts.extend(
        [title, *(handle.get_label() for handle in handles)]))
    plots.draw_flight(tmp_path, tmp_path / 'map.png')
    assert texts[0].startswith('1 of 1 tasks completed')
    assert texts[1].startswith('u1: 1 task, ')


def test_an_empty_record_is_drawn(tmp_path):
    write(tmp_path / RECORD_FILE)
    write(tmp_path / TRUTH_FILE)
    plots.draw_flight(tmp_path, tmp_path / 'map.png')
    assert (tmp_path / 'map.png').read_bytes().startswith(PNG)


def test_uavs_beyond_the_last_colour_repeat_it_with_another_line_style():
    count = len(palette.UAV_COLOURS)
    assert plots.uav_colour(0) == plots.uav_colour(count)
    assert style.line_style(0) == style.line_style(count - 1) != style.line_style(count)


def timed_plan(count):
    """Two trips of one UAV over `count` tasks, the last of them late."""
    names = [f't{i}' for i in range(count)]
    arrivals = {name: 10.0 * i for i, name in enumerate(names, 1)}
    starts = {name: arrival + 2.0 for name, arrival in arrivals.items()}
    rows = tuple(names[:count // 2]), tuple(names[count // 2:])
    table = Timetable(arrivals, starts, {'u1': rows}, {'u1': (3.0, 10.0 * (count // 2) + 8.0)},
                      {'u1': 10.0 * count + 9.0}, late={names[-1]: 1.0})
    legs = (Leg((), 5.0),) * (count + 2)
    return Plan({'u1': tuple(names), 'u2': ()}, distance=90.0, returns=True,
                legs={'u1': legs, 'u2': ()}, timetable=lambda: table)


@pytest.mark.parametrize('count', [4, times.MAX_TASK_ROWS + 1])
def test_times_are_drawn_in_their_windows(tmp_path, monkeypatch, count):
    drawn = []
    monkeypatch.setattr(MapFigure, 'finish', lambda figure, *_: drawn.append(figure.beside))
    uavs = [Uav('u1', (0.0, 0.0, 0.0)), Uav('u2', (300.0, 0.0, 0.0))]
    tasks = [Task(f't{i}', (10.0 * i, 50.0, 40.0), service_time=4.0, earliest=10.0 * i,
                  latest=10.0 * count + 1.0) for i in range(count)]
    plots.draw_plan_times(uavs, tasks, ZONES, timed_plan(count), tmp_path / 'times.png')
    axes, = drawn
    rows = [label.get_text() for label in axes.get_yticklabels()]
    assert rows == ([task.id for task in tasks] if count == 4 else ['u1'])
    bars = [(patch.get_x(), patch.get_width()) for patch in axes.patches]
    assert (12.0, 4.0) in bars  # the service of t0
    assert (10.0, 2.0) in bars  # its waiting
    assert ((10.0, 31.0) in bars) == (count == 4)  # the window of t1
    assert axes.get_xlabel() == 'time [s]'


@pytest.mark.parametrize('count', [4, times.MAX_TASK_ROWS + 1])
def test_the_bar_of_a_service_contains_the_flight_along_its_path(tmp_path, monkeypatch, count):
    drawn = []
    monkeypatch.setattr(MapFigure, 'finish', lambda figure, *_: drawn.append(figure.beside))
    ends = (0.0, 50.0, 40.0), (30.0, 50.0, 80.0)  # 20 s up, 40 s down
    tasks = [Task(f't{i}', ends[0], service_time=1.0, path=ends, reversible=True)
             for i in range(count)]
    uav = Uav('u1', (0.0, 0.0, 0.0), cruise_speed=3.0, climb_speed=2.0, descent_speed=1.0)
    plan = replace(timed_plan(count), reversed=frozenset({'t1'}))
    plots.draw_plan_times([uav], tasks, [], plan, tmp_path / 'times.png')
    bars = {patch.get_x(): patch.get_width() for patch in drawn[0].patches}
    assert (bars[12.0], bars[22.0]) == pytest.approx((21.0, 41.0))


def test_a_path_is_part_of_a_route_and_turned_where_it_is_flown_from_its_end():
    uav = Uav('u1', (0.0, 0.0, 0.0))
    tasks = {f't{i}': Task(f't{i}', (10.0 * i, 50.0, 40.0),
                           path=[(10.0 * i, 50.0, 40.0), (10.0 * i, 90.0, 40.0)])
             for i in range(4)}
    turned = replace(timed_plan(4), reversed=frozenset({'t1'}))
    points = route_points(uav, turned, tasks)
    assert points[1:5] == [tasks['t0'].position, tasks['t0'].end, tasks['t1'].end,
                           tasks['t1'].position]
    stops = route_stops(turned, 'u1', tasks, uav.base)
    assert [stop.task for stop in stops] == ['t0', 't1', None, 't2', 't3', None]


def test_a_route_of_two_trips_is_drawn_over_its_base():
    uav = Uav('u1', (0.0, 0.0, 0.0))
    places = {f't{i}': (10.0 * i, 50.0, 40.0) for i in range(4)}
    points = route_points(uav, timed_plan(4), {
        name: Task(name, place) for name, place in places.items()})
    assert points == [uav.base, places['t0'], places['t1'], uav.base, places['t2'], places['t3'],
                      uav.base]
