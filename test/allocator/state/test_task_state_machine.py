# SPDX-License-Identifier: Apache-2.0
"""Task state machine: the whole table, and events that are late, repeated or out of order."""
from pathlib import Path

import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.records import ENDED_STATES, OPEN_STATES, TaskState
from uav_task_alloc.allocator.state import task_state_machine
from uav_task_alloc.allocator.state.task_state_machine import (
    TASK_TRANSITIONS,
    TaskTransition,
    rule_for,
)

S = TaskState


def test_every_event_has_an_answer_in_every_state():
    assert set(TASK_TRANSITIONS) == set(TaskTransition)
    for row in TASK_TRANSITIONS.values():
        assert set(row) == set(S)


@pytest.mark.parametrize('event', TaskTransition)
@pytest.mark.parametrize('state', S)
def test_an_event_without_effect_has_a_reason(state, event):
    rule = rule_for(state, event, 'a', 'because')
    assert rule.state is not None or rule.reason
    assert '{' not in rule.reason


@pytest.mark.parametrize('event', TaskTransition)
def test_what_is_completed_or_cancelled_stays_so(event):
    for state in (S.COMPLETED, S.CANCELLED):
        assert rule_for(state, event).state is None


def test_only_an_announcement_makes_a_task():
    makes = [event for event in TaskTransition if rule_for(S.REJECTED, event).state]
    assert makes == [TaskTransition.ADD]


def test_every_state_is_left_or_is_an_end():
    for state in S:
        leads = {rule_for(state, event).state for event in TaskTransition} - {None, state}
        assert bool(leads) == (state in OPEN_STATES or state in (S.FAILED, S.REJECTED))


def test_no_plan_moves_a_task_that_has_ended():
    for state in ENDED_STATES:
        for event in (
            TaskTransition.WAIT,
            TaskTransition.LIST,
            TaskTransition.LEAVE,
            TaskTransition.START,
            TaskTransition.FAIL,
        ):
            assert rule_for(state, event).state is None


def test_braces_of_a_reason_are_text():
    rule = rule_for(S.ACTIVE, TaskTransition.FAIL, 'a', '{uav} {0}')
    assert rule.reason == 'failed on a: {uav} {0}'


def test_the_documentation_is_generated_from_the_table():
    path = Path(__file__).parents[3] / 'docs/task_states.md'
    assert path.read_text() == task_state_machine.task_states_markdown()


@pytest.fixture
def driver():
    driver = AllocatorDriver(uav_timeout=5.0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.add(('t1', 100, 0), ('t2', 900, 0))
    driver.settle()
    return driver


def moved(driver):
    """b has t1 of a, which is presumed lost."""
    driver.now += 6.0
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.settle(report=False)
    assert 't1' in driver.route('b')


@pytest.mark.parametrize(('first', 'then', 'why', 'state'), [
    ('COMPLETED', 'COMPLETED', 'it is COMPLETED already', 'COMPLETED'),
    ('COMPLETED', 'FAILED', 'it is COMPLETED already', 'COMPLETED'),
    ('COMPLETED', 'STARTED', 'it is COMPLETED already', 'COMPLETED'),
    ('STARTED', 'STARTED', '', 'ACTIVE'),
    ('STARTED', 'COMPLETED', '', 'COMPLETED'),
    ('FAILED', 'COMPLETED', '', 'COMPLETED'),
    ('FAILED', 'STARTED', '', 'ACTIVE'),  # it is in the list of a until the next plan
])
def test_events_out_of_order_end_in_the_right_state(driver, first, then, why, state):
    assert driver.event(first, 't1', 'a', revision=1) == ''
    refusal = driver.event(then, 't1', 'a', revision=1)
    assert refusal.endswith(why) if why else refusal == ''
    assert driver.state('t1') == state


@pytest.mark.parametrize('kind', ['STARTED', 'COMPLETED', 'FAILED'])
def test_a_cancelled_task_stays_cancelled(driver, kind):
    driver.cancel('t1')
    assert driver.event(kind, 't1', 'a', revision=1).endswith('it was cancelled')
    assert driver.state('t1') == 'CANCELLED'


@pytest.mark.parametrize(('kind', 'state'), [
    ('STARTED', 'ASSIGNED'), ('FAILED', 'ASSIGNED'), ('COMPLETED', 'COMPLETED')])
def test_a_uav_believed_lost_may_complete_what_was_moved_but_not_take_it_back(driver, kind, state):
    moved(driver)
    driver.event(kind, 't1', 'a', revision=1)
    driver.core.tick(driver.now, driver.now)
    assert driver.state('t1') == state
    record = driver.world.tasks.records['t1']
    assert record.failed_on == ()
    assert record.uav == ('a' if state == 'COMPLETED' else 'b')
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.settle(report=False)
    assert ('t1' in driver.route('b')) == (state != 'COMPLETED')


def test_a_task_both_have_flown_is_completed_once(driver):
    moved(driver)
    assert driver.event('COMPLETED', 't1', 'b') == ''
    assert driver.event('COMPLETED', 't1', 'a', revision=1).endswith('it is COMPLETED already')
    assert driver.world.tasks.records['t1'].uav == 'b'


def test_a_task_that_failed_for_good_and_was_flown_all_the_same_is_completed(driver):
    for uav_id in ('a', 'b'):
        driver.settle()
        driver.event('FAILED', 't1', uav_id)
    assert driver.state('t1') == 'FAILED'
    driver.settle()
    assert driver.event('COMPLETED', 't1', 'a', revision=1) == ''
    assert (driver.state('t1'), driver.reason('t1')) == (
        'COMPLETED', 'completed after it was moved')


def test_an_event_of_a_uav_without_a_report_since_the_restart_is_applied(driver):
    del driver.world.fleet.records['a']
    assert driver.event('STARTED', 't1', 'a') == ''
    assert driver.state('t1') == 'ACTIVE'
