# SPDX-License-Identifier: Apache-2.0
"""When a solve is due; a failed one is retried without a new trigger."""
import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.replanning.schedule import MAX_RETRY


@pytest.fixture
def driver():
    driver = AllocatorDriver(background_budget=0.0)
    driver.uav('u', 0.0, 0.0, 50.0)
    driver.add(('t', 100.0, 0.0))
    return driver


def fail(driver, problem):
    """The solve raised."""
    driver.now += problem.budget
    driver.core.adopt(None, driver.now, driver.now)
    driver.take()


def seconds_until_due(driver, most):
    """Seconds until a problem is due, and that problem."""
    began = driver.now
    while driver.now - began < most:
        driver.uav('u', 0.0, 0.0, 50.0)
        problem = driver.begin()
        if problem is not None:
            return driver.now - began, problem
    return most, None


def test_finding_21_a_failed_solve_is_retried_with_its_triggers(driver):
    first = driver.begin()
    fail(driver, first)
    _, again = seconds_until_due(driver, MAX_RETRY)
    assert again is not None
    assert again.trigger == first.trigger
    driver.finish(again)
    assert driver.route('u') == ('t',)
    assert seconds_until_due(driver, 2.0 * MAX_RETRY)[1] is None


def test_finding_21_repeated_failures_are_retried_less_and_less_often(driver):
    problem, waits = driver.begin(), []
    for _ in range(10):
        fail(driver, problem)
        waited, problem = seconds_until_due(driver, 2.0 * MAX_RETRY)
        waits.append(waited)
    assert waits == sorted(waits)
    assert waits[0] < 2.0
    assert waits[-1] == pytest.approx(MAX_RETRY, rel=0.1)


def test_finding_21_a_new_trigger_does_not_wait_for_the_retry_and_old_ones_are_named(driver):
    problem = driver.begin()
    for _ in range(6):
        fail(driver, problem)
        _, problem = seconds_until_due(driver, 2.0 * MAX_RETRY)
    fail(driver, problem)
    driver.add(('later', 200.0, 0.0))
    problem = driver.begin()
    assert problem is not None
    assert problem.trigger == 'u reports, ADD t, ADD later'
    driver.finish(problem)
    assert driver.route('u') == ('t', 'later')


def test_finding_21_triggers_during_a_failed_solve_are_solved_with_its_own(driver):
    problem = driver.begin()
    driver.add(('later', 200.0, 0.0))
    fail(driver, problem)
    problem = driver.begin()
    assert problem.trigger == 'u reports, ADD t, ADD later'
