# SPDX-License-Identifier: Apache-2.0
"""When a solve is due: also again after one that failed, without anything new."""
import pytest
from allocation import Desk

from uav_task_alloc.allocator.replanning.schedule import MAX_RETRY


@pytest.fixture
def desk():
    desk = Desk(background_budget=0.0)
    desk.uav('u', 0.0, 0.0, 50.0)
    desk.add(('t', 100.0, 0.0))
    return desk


def fail(desk, problem):
    """The solve raised."""
    desk.now += problem.budget
    desk.core.adopt(None, desk.now, desk.now)
    desk.take()


def seconds_until_due(desk, most):
    """So long nothing happens; the problem that is due then."""
    began = desk.now
    while desk.now - began < most:
        desk.uav('u', 0.0, 0.0, 50.0)
        problem = desk.begin()
        if problem is not None:
            return desk.now - began, problem
    return most, None


def test_finding_21_a_solve_that_failed_is_tried_again_for_what_asked_for_it(desk):
    first = desk.begin()
    fail(desk, first)
    _, again = seconds_until_due(desk, MAX_RETRY)
    assert again is not None
    assert again.trigger == first.trigger
    desk.finish(again)
    assert desk.route('u') == ('t',)
    assert seconds_until_due(desk, 2.0 * MAX_RETRY)[1] is None


def test_finding_21_what_fails_again_and_again_is_tried_more_and_more_seldom(desk):
    problem, waits = desk.begin(), []
    for _ in range(10):
        fail(desk, problem)
        waited, problem = seconds_until_due(desk, 2.0 * MAX_RETRY)
        waits.append(waited)
    assert waits == sorted(waits)
    assert waits[0] < 2.0
    assert waits[-1] == pytest.approx(MAX_RETRY, rel=0.1)


def test_finding_21_something_new_does_not_wait_for_the_next_try_and_old_triggers_are_told(desk):
    problem = desk.begin()
    for _ in range(6):
        fail(desk, problem)
        _, problem = seconds_until_due(desk, 2.0 * MAX_RETRY)
    fail(desk, problem)
    desk.add(('later', 200.0, 0.0))
    problem = desk.begin()
    assert problem is not None
    assert problem.trigger == 'u reports, ADD t, ADD later'
    desk.finish(problem)
    assert desk.route('u') == ('t', 'later')


def test_finding_21_what_happened_during_a_solve_that_failed_is_solved_with_it(desk):
    problem = desk.begin()
    desk.add(('later', 200.0, 0.0))
    fail(desk, problem)
    problem = desk.begin()
    assert problem.trigger == 'u reports, ADD t, ADD later'
