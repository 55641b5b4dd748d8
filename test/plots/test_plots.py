# SPDX-License-Identifier: Apache-2.0
"""Pictures are drawn for what can happen; what they look like is for eyes to judge."""
import itertools
import json
import math

import numpy as np
import pytest

from uav_task_alloc import plots
from uav_task_alloc.model import Leg, Plan, Task, ThreatZone, Uav
from uav_task_alloc.plots import labels, plan as plan_map, space, style
from uav_task_alloc.plots.flat import Map
from uav_task_alloc.record import ground_truth as truth, run_state as heard
from uav_task_alloc.zone_codec import JSON_ZONE, encode_zone

ZONES = [ThreatZone.hemisphere('dome', (100.0, 100.0, 0.0), 30.0, margin=5.0),
         ThreatZone.polygon('field', [(200.0, 0.0), (260.0, 10.0), (230.0, 60.0)])]
PNG = b'\x89PNG'


DRAW = pytest.mark.parametrize('draw', [plots.draw_plan, plots.draw_plan_3d])


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


@DRAW
def test_a_plan_of_nothing_is_drawn(tmp_path, draw):
    draw([], [], [], Plan({}), tmp_path / 'plan.png')
    assert (tmp_path / 'plan.png').read_bytes().startswith(PNG)


@DRAW
def test_a_crowd_is_drawn_without_names(tmp_path, draw, monkeypatch):
    written, annotate = [], labels.Axes.annotate

    def listen(axes, text, *args, **kwargs):
        written.append(text)
        return annotate(axes, text, *args, **kwargs)
    monkeypatch.setattr(labels.Axes, 'annotate', listen)
    tasks = [Task(f't{i}', (10.0 * i, 0.0, 40.0)) for i in range(style.CROWD + 1)]
    draw([], tasks, [], Plan({}, {task.id: 'no UAV' for task in tasks}), tmp_path / 'plan.png')
    assert not [text for text in written if text.startswith('t')]


def test_a_picture_fills_a_full_hd_projector(tmp_path):
    plots.draw_plan([], [], [], Plan({}), tmp_path / 'plan.png')
    header = (tmp_path / 'plan.png').read_bytes()[16:24]
    assert (int.from_bytes(header[:4], 'big'), int.from_bytes(header[4:], 'big')) == (1920, 1080)


def test_the_axes_tell_their_units():
    flat, deep = Map([], 0).axes, space.Figure().add_subplot(projection='3d')
    space._frame(deep, np.zeros(3), np.array((1000.0, 900.0, 80.0)))
    assert (flat.get_xlabel(), flat.get_ylabel()) == ('east [m]', 'north [m]')
    assert (deep.get_xlabel(), deep.get_ylabel(), deep.get_zlabel()) == (
        'east [m]', 'north [m]', 'up [m], drawn 3 times')


def test_the_legend_of_a_large_fleet_has_an_end():
    uavs = [Uav(f'u{i}', (float(i), 0.0, 0.0)) for i in range(40)]
    made = Plan({uav.id: ('t',) * (i < 30) for i, uav in enumerate(uavs)})
    texts = [handle.get_label() for handle in plan_map.handles_of(uavs, made)]
    assert texts[0] == 'u0: 1 task, 0 m'
    assert texts[style.ROWS:] == [f'{30 - style.ROWS} more UAVs with tasks', '10 without tasks']


def test_in_space_a_zone_is_drawn_as_high_as_it_is_and_cut_where_it_towers():
    points = [(0.0, 0.0, 0.0), (100.0, 0.0, 50.0)]
    low, high = space.limits(points, [ThreatZone.cylinder('c', (0.0, 0.0), 10.0, z_max=70.0)])
    assert (low[2], high[2] > 70.0) == (0.0, True)
    _, high = space.limits(points, [ThreatZone.cylinder('c', (0.0, 0.0), 10.0, z_max=700.0)])
    assert 50.0 < high[2] < 75.0
    _, high = space.limits(points, [ThreatZone.hemisphere('h', (0.0, 0.0, 0.0), 300.0)])
    assert high[2] > 300.0


def test_names_part_where_their_marks_are_close():
    axes = labels.Axes(space.Figure(figsize=(5.0, 5.0)), (0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, 100.0), ylim=(0.0, 100.0))
    labels.place_labels(axes, [labels.Label(name, x, 50.0, 10.0, 8.0)
                        for name, x in (('first', 50.0), ('second', 53.0))], [])
    axes.figure.draw_without_rendering()
    first, second = (text.get_window_extent() for text in axes.texts)
    assert not first.overlaps(second)


# Machado, Oliveira and Fernandes 2009, "A Physiologically-based Model for Simulation of Color
# Vision Deficiency", severity 1.0; on linear RGB
EYES = {
    'all colours': np.eye(3),
    'no red': [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
               [-0.003882, -0.048116, 1.051998]],
    'no green': [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                 [-0.011820, 0.042940, 0.968881]],
    'no blue': [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                [0.004733, 0.691367, 0.303900]],
}


def lab(colour, eye):
    """CIE L*a*b* (D65) of a colour as an eye sees it."""
    rgb = np.array([int(colour[i:i + 2], 16) for i in (1, 3, 5)]) / 255.0
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722],
                    [0.0193, 0.1192, 0.9505]]) @ np.clip(eye @ linear, 0.0, 1.0)
    f = np.cbrt(xyz / (0.9505, 1.0, 1.089))
    return 116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])


@pytest.mark.parametrize('eye', EYES)
def test_colours_stay_apart_for_every_kind_of_eye(eye):
    seen = {each: lab(each, np.array(EYES[eye])) for each in (*plots.COLOURS, style.RED)}
    for a, b in itertools.combinations(seen, 2):  # 2.3 is what an eye can just tell apart
        assert math.dist(seen[a], seen[b]) > 12.0, (a, b)


def write(path, *lines):
    path.write_text(''.join(json.dumps(line) + '\n' for line in lines))


def test_a_flight_with_a_late_zone_a_late_task_and_a_dead_uav_is_drawn(tmp_path):
    def add(wall, name, *place):
        return {'wall': wall, 'kind': 'announcement', 'action': 'ADD',
                'tasks': [{'id': name, 'position': place}]}
    write(tmp_path / heard.FILE,
          add(1.0, 'a', 50.0, 90.0, 40.0), add(2.0, 'b', 10.0, 20.0, 30.0),
          {'wall': 1.0, 'kind': 'zones', 'zones': [encode_zone(ZONES[0], JSON_ZONE)]},
          {'wall': 2.0, 'kind': 'zones',
           'zones': [encode_zone(zone, JSON_ZONE) for zone in ZONES]})
    write(tmp_path / truth.FILE,
          *({'t': float(k), 'wall': float(k), 'uav': 'u1', 'x': 25.0 * k, 'y': 45.0 * k,
             'z': 40.0, 'alive': True} for k in range(4)),
          {'t': 2.0, 'wall': 2.0, 'uav': 'u1', 'event': 'item_reached', 'x': 50.0, 'y': 90.0,
           'z': 40.0},
          {'t': 3.0, 'wall': 3.0, 'uav': 'u1', 'event': 'died'})
    plots.draw_flight(tmp_path, tmp_path / 'map.png')
    assert (tmp_path / 'map.png').read_bytes().startswith(PNG)


def test_a_run_in_which_nothing_happened_is_drawn(tmp_path):
    write(tmp_path / heard.FILE)
    write(tmp_path / truth.FILE)
    plots.draw_flight(tmp_path, tmp_path / 'map.png')
    assert (tmp_path / 'map.png').read_bytes().startswith(PNG)


def test_uavs_beyond_the_last_colour_start_again():
    count = len(plots.COLOURS)
    assert plots.colour(0) == plots.colour(count)
    assert style.line(0) == style.line(count - 1) != style.line(count)
