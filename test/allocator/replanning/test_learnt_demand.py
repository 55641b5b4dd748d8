# SPDX-License-Identifier: Apache-2.0
"""What was announced is kept in rows, learnt step by step, and forgotten; and its area."""
import numpy as np
import pytest

from uav_task_alloc.allocator.replanning.demand_area import LearntDemand, area_around
from uav_task_alloc.allocator.state.seen_tasks import SeenTasks
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Task
from uav_task_alloc.params import AllocatorParams

AREA = (-4000.0, -4000.0, 4000.0, 4000.0)


def test_the_rows_of_the_demand_are_few_and_the_oldest_are_dropped():
    seen = SeenTasks()
    for k in range(2100):
        seen.add(Task(f't{k}', (float(k), 0.0, 0.0)), float(k))
    assert len(seen.blocks) == 40
    assert max(map(len, seen.blocks.values())) == 50
    assert seen.seen[-1][:2] == (2099.0, 2099.0)
    assert len(seen.seen) == 2000
    assert seen.forget() == 2000
    assert seen.seen == []


def test_the_demand_is_the_same_after_a_restart_and_follows_step_by_step():
    seen, whole, steps = SeenTasks(), LearntDemand(), LearntDemand()
    rng = np.random.default_rng(3)
    for k in range(120):
        seen.add(Task(f't{k}', (*rng.uniform(-3000.0, 3000.0, 2), 0.0)), 10.0 * k)
        steps.follow(seen, AllocatorParams())
    whole.follow(SeenTasks([(int(n), rows) for n, rows in seen.blocks.items()]),
                 AllocatorParams())
    assert steps.area == whole.area
    assert steps.weight(True, 1200.0) == pytest.approx(whole.weight(True, 1200.0), abs=1e-15)


def test_what_is_forgotten_is_not_learnt_though_as_much_was_announced_since():
    seen, learnt = SeenTasks(), LearntDemand()
    seen.add(Task('a', (0.0, 0.0, 0.0)), 1.0)
    learnt.follow(seen, AllocatorParams())
    seen.forget()
    for k in range(2):
        seen.add(Task(f'b{k}', (10.0, 10.0, 0.0)), 2.0)
    learnt.follow(seen, AllocatorParams())
    assert [each.at for each in learnt.demand.seen] == [2.0, 2.0]


def test_an_area_that_is_no_longer_given_is_around_the_tasks_at_once():
    seen, learnt = SeenTasks(), LearntDemand()
    seen.add(Task('a', (0.0, 0.0, 0.0)), 1.0)
    learnt.follow(seen, AllocatorParams(anticipate_area=AREA))
    assert learnt.area == AREA
    learnt.follow(seen, AllocatorParams())
    assert learnt.area == area_around(seen.seen)


def test_the_area_of_work_holds_all_tasks_and_changes_seldom():
    rng = np.random.default_rng(5)
    seen, areas = [], []
    for k in range(300):
        seen.append((float(k), *rng.uniform(-5000.0, 5000.0, 2), 1.0))
        areas.append(area_around(seen))
        west, south, east, north = areas[-1]
        assert all(west < x < east and south < y < north for _, x, y, _ in seen)
        assert east - west == pytest.approx(north - south)
    assert len(set(areas)) < 15
    assert area_around([]) is None


@pytest.mark.parametrize('area', [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 1.0, 1.0)])
def test_an_area_without_extent_is_refused(area):
    with pytest.raises(InvalidValue, match='anticipate_area'):
        AllocatorParams(anticipate_area=area)
