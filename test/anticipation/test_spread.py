# SPDX-License-Identifier: Apache-2.0
"""Tasks move between lists so that idle UAVs stay where the next tasks are expected."""
import numpy as np
import pytest

from uav_task_alloc.anticipation.spread import ListEnd, Outlook, PlainTask, price, spread

SPOT = (3000.0, 0.0)  # [m] where the next tasks are expected
OUTLOOK = Outlook(np.array([SPOT[0], 0.0]), np.array([SPOT[1], 0.0]), np.array([0.95, 0.05]))
TASK = PlainTask(1500.0, 0.0, 60.0, 1.0)
EVERY = np.ones((2, 1), bool)


def at(x, y=0.0, free_in=0.0):
    return ListEnd(free_in, x, y, (x, y), 15.0)


def test_a_task_leaves_the_uav_that_the_next_tasks_need():
    fleet = [at(3000.0), at(-300.0)]  # 100 s and 120 s from the task
    assert spread(OUTLOOK, fleet, [TASK], [[0], []], EVERY) == [[], [0]]


def test_a_task_stays_where_the_way_of_the_other_uav_is_too_long():
    fleet = [at(3000.0), at(-9000.0)]
    assert spread(OUTLOOK, fleet, [TASK], [[0], []], EVERY) == [[0], []]


def test_a_task_stays_where_no_other_uav_is_allowed_to_have_it():
    fleet, allowed = [at(3000.0), at(-300.0)], np.array([[True], [False]])
    assert spread(OUTLOOK, fleet, [TASK], [[0], []], allowed) == [[0], []]


def test_valuable_tasks_do_not_wait_for_cover():
    fleet, task = [at(3000.0), at(-300.0)], TASK._replace(value=20.0)
    assert spread(OUTLOOK, fleet, [task], [[0], []], EVERY) == [[0], []]


def test_every_uav_flies_at_its_own_speed():
    fleet = [at(3000.0), at(-300.0)._replace(speed=3.0)]
    assert spread(OUTLOOK, fleet, [TASK], [[0], []], EVERY) == [[0], []]


def test_the_price_is_the_expected_wait_for_the_nearest_uav_and_its_backup():
    only = Outlook(np.array([0.0]), np.array([0.0]), np.array([1.0]))
    fleet = [at(1500.0), at(-3000.0, free_in=80.0)]  # 100 s; free 30 s after the next task: 230 s
    assert price(only, fleet, 2) == pytest.approx(2.0 * (0.8 * 100.0 + 0.2 * 230.0))
    assert price(only, fleet, 0) == pytest.approx(1.5 * (0.8 * 100.0 + 0.2 * 230.0))
    assert price(only, [], 0) == 0.0
