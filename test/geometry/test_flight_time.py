# SPDX-License-Identifier: Apache-2.0
"""Flight times: the slowest of horizontal, upward and downward motion on each straight part."""
import numpy as np
import pytest

from uav_task_alloc.geometry.flight_time import (
    flight_time,
    path_time,
    service_seconds,
    straight_time,
)
from uav_task_alloc.model import Task, Uav

UAV = Uav('u', (0.0, 0.0, 0.0), cruise_speed=10.0, climb_speed=2.0, descent_speed=1.0)


@pytest.mark.parametrize(('end', 'seconds'), [
    ((30.0, 40.0, 0.0), 5.0),  # level
    ((30.0, 40.0, 9.0), 5.0),  # the climb takes 4.5 s
    ((30.0, 40.0, 20.0), 10.0),  # the climb is slower
    ((30.0, 40.0, -20.0), 20.0),
    ((0.0, 0.0, 6.0), 3.0),
    ((0.0, 0.0, 0.0), 0.0),
])
def test_the_slowest_axis_sets_the_time(end, seconds):
    assert flight_time(UAV, [(0.0, 0.0, 0.0), end]) == pytest.approx(seconds)


def test_unlimited_vertical_speeds_leave_the_horizontal_one():
    assert flight_time(Uav('u', (0.0, 0.0, 0.0)), [(0.0, 0.0, 0.0), (30.0, 0.0, 99.0)]) == 2.0


def test_the_parts_of_a_path_add_up_each_with_its_slowest_axis():
    over = [(0.0, 0.0, 0.0), (10.0, 0.0, 20.0), (110.0, 0.0, 20.0), (120.0, 0.0, 0.0)]
    assert flight_time(UAV, over) == pytest.approx(10.0 + 10.0 + 20.0)
    assert flight_time(UAV, over[:1]) == flight_time(UAV, []) == 0.0


def test_the_service_of_a_turned_path_is_that_of_the_task_flown_so():
    path = ((0.0, 0.0, 0.0), (10.0, 0.0, 20.0), (110.0, 30.0, 25.0))
    task = Task('t', path[0], service_time=3.0, path=path)
    assert service_seconds(UAV, task) == pytest.approx(3.0 + 10.0 + 10.44, abs=0.01)
    assert service_seconds(UAV, task, turned=True) == service_seconds(UAV, task.turned)
    assert service_seconds(UAV, task.turned, turned=True) == service_seconds(UAV, task)


def test_the_kernel_computes_the_same():
    points = np.random.default_rng(5).uniform(-100.0, 100.0, (20, 3))
    expected = flight_time(UAV, [tuple(point) for point in points.tolist()])
    assert path_time(points, len(points), 10.0, 2.0, 1.0) == pytest.approx(expected)
    assert straight_time(0.0, 0.0, 5.0, 1.0, np.inf, 1.0) == 0.0
