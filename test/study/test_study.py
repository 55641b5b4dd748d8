# SPDX-License-Identifier: Apache-2.0
"""The experiments run and print their figures; their instances are reproducible."""
import math

import pytest

from uav_task_alloc.cli.study import main
from uav_task_alloc.study import warm
from uav_task_alloc.study.instances import CLEAR, make_dome_scene, make_instance
from uav_task_alloc.study.learning import confidence


def test_an_instance_is_reproducible_and_its_tasks_are_within_range():
    first, second = make_instance(4, 20, 3), make_instance(4, 20, 3)
    assert first == second != make_instance(4, 20, 4)
    base = make_instance(4, 20, 3, one_base=True)
    assert len({uav.position for uav in base.uavs}) == 1
    assert all(math.dist(task.position, base.uavs[0].position) < base.uavs[0].range
               for task in base.tasks)


def test_a_scene_is_reproducible_and_its_domes_contain_no_task_or_start():
    scene = make_dome_scene(3, 40, 8, 2)
    assert scene == make_dome_scene(3, 40, 8, 2) != make_dome_scene(3, 40, 8, 3)
    assert all(math.dist(each.position, zone.center) > zone.radius + CLEAR
               for each in (*scene.uavs, *scene.tasks) for zone in scene.zones)


@pytest.mark.parametrize('name', ['scouts', 'whole', 'warm'])
def test_an_experiment_prints_its_figures(name, capsys):
    assert main([name, '--budget', '0.002', '--runs', '2', '--size', '3x12']) == 0
    assert '%' in capsys.readouterr().out


def test_events_go_on_with_another_instance_when_the_ranges_are_used_up(monkeypatch, capsys):
    monkeypatch.setattr(warm, '_EVENTS', 2)
    seeds = []
    monkeypatch.setattr(warm, 'make_instance', lambda uavs, tasks, seed, one_base: (
        seeds.append(seed) or make_instance(uavs, tasks, seed, one_base)))
    warm.run_events(0.002, 3, '2x5')
    assert seeds == [11, 12, 11, 12]
    assert 'spread: 3 of 3 events' in capsys.readouterr().err


def test_plans_that_serve_nothing_have_no_gap(monkeypatch, capsys):
    monkeypatch.setattr(warm, '_RANGE_FACTOR', 1e-9)
    warm.run_events(0.002, 1, '2x5')
    assert capsys.readouterr().out.count('worst 0.00 %') == 2


def test_a_confidence_interval_is_that_of_student():
    mean, half = confidence([1.0, 2.0, 3.0])
    assert mean == 2.0
    assert half == pytest.approx(4.303 / math.sqrt(3.0), rel=1e-3)
    assert confidence([1.0])[1] == math.inf
