# SPDX-License-Identifier: Apache-2.0
"""Orders of operators on the core: pin, forbid, order, pause, return, undo."""
import math

import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.allocator.order_records import OrderLogEntry, OrderRows
from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.allocator.state.orders import Orders
from uav_task_alloc.model import Task


@pytest.fixture
def driver():
    driver = AllocatorDriver(uav_timeout=5.0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.add(('t1', 100, 0), ('t2', 200, 0), ('t3', 900, 0))
    driver.settle()
    assert (driver.route('a'), driver.route('b')) == (('t1', 't2'), ('t3',))
    return driver


def restarted(driver):
    """The driver of an allocator that restarts with what the journal would have."""
    driver.core.nothing_written()
    state = restored_state(driver.core.rows())
    assert state.unreadable == []
    again = AllocatorDriver(state, uav_timeout=5.0)
    again.now = driver.now
    again.uav('a', 0.0, 0.0, 50.0)
    again.uav('b', 1000.0, 0.0, 50.0)
    again.settle(wait=4.0)
    again.settle()
    return again


def test_a_pinned_task_changes_to_its_uav_and_back_when_it_is_undone(driver):
    answer = driver.order('PIN', 'b', 't1')
    assert (answer.success, answer.order_id) == (True, 'o1')
    assert 'pin t1 to b: in force as o1' in answer.message
    assert 'before: t1 ASSIGNED on a' in answer.message
    driver.settle()
    assert (driver.route('a'), driver.route('b')) == (('t2',), ('t3', 't1'))
    assert any('ann: pin t1 to b; before: t1 ASSIGNED on a' in note for note in driver.notes)
    assert driver.order('UNDO', order_id='o1').success
    assert driver.world.orders.in_force == {}
    again = driver.order('UNDO', order_id='o1')
    assert (again.success, again.message) == (
        False, "refused: order_id = 'o1': it is not in force any more (undo o1)")


@pytest.mark.parametrize(('action', 'tasks', 'more'), [
    ('PIN', ('t4',), {}), ('FORBID', ('t1',), {}), ('ORDER', ('t2', 't1'), {}),
    ('PAUSE', (), {'keep_tasks': False}), ('RETURN', (), {})])
def test_the_solver_finds_the_lists_of_before_when_an_order_is_undone(action, tasks, more):
    def rounds(*world, max_iterations, **how):
        return plan(*world, max_iterations=60 if max_iterations is None else max_iterations,
                    **{**how, 'budget': 60.0})

    driver = AllocatorDriver(plan=rounds, locked_tasks=0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.add(('t1', 100, 0), ('t2', 200, 0), ('t3', 900, 0), ('t4', 800, 0))
    driver.settle()
    before = driver.route('a'), driver.route('b')
    assert before == (('t1', 't2'), ('t3', 't4'))
    assert driver.order(action, 'a', *tasks, **more).success
    driver.settle()
    assert (driver.route('a'), driver.route('b')) != before
    assert driver.order('UNDO', order_id='o1').success
    driver.settle()
    assert (driver.route('a'), driver.route('b')) == before


def test_a_forbidden_task_goes_to_another_or_waits_with_the_reason(driver):
    assert driver.order('FORBID', 'a', 't1').success
    driver.settle()
    assert 't1' in driver.route('b')
    assert driver.order('FORBID', 'b', 't1', operator='bob').success
    driver.settle()
    assert driver.state('t1') == 'UNASSIGNED'
    assert driver.reason('t1').startswith('not a (order o1 of ann); not b (order o2 of bob)')
    assert driver.order('FORBID', 'a', 't1', clear=True).success
    driver.settle()
    assert driver.state('t1') == 'ASSIGNED'


def test_ordered_tasks_come_first_and_the_rest_stays_free(driver):
    assert driver.order('ORDER', 'a', 't3', 't1').success
    driver.settle()
    assert driver.route('a')[:2] == ('t3', 't1')
    assert driver.route('b') == ()
    assert driver.order('ORDER', 'a').success  # the end of it
    assert driver.world.orders.in_force == {}


def test_the_task_under_way_comes_before_ordered_ones(driver):
    assert driver.event('STARTED', 't1', 'a') == ''
    assert driver.order('ORDER', 'a', 't3', 't2').success
    driver.settle()
    assert driver.route('a') == ('t1', 't3', 't2')
    assert driver.event('COMPLETED', 't1', 'a') == ''
    assert driver.event('COMPLETED', 't3', 'a') == ''
    driver.settle()
    assert driver.route('a') == ('t2',)
    assert driver.event('COMPLETED', 't2', 'a') == ''
    driver.settle()
    assert driver.world.orders.in_force == {}
    assert any('order o1 of ann ended: t2 is COMPLETED' in note for note in driver.notes)


@pytest.mark.parametrize(('action', 'uav', 'tasks', 'more', 'why'), [
    ('PIN', 'a', ('t9',), {}, "task_id = 't9': expected an accepted task"),
    ('PIN', 'c', ('t1',), {}, "uav_id = 'c': expected a known UAV (a, b)"),
    ('PIN', '', ('t1',), {}, "uav_id = '': expected a known UAV (a, b)"),
    ('PIN', 'a', ('t1',), {'revision': 7},
     'revision = 7: expected 0 or 1, that of the allocation in force'),
    ('PIN', 'a', ('camera',), {}, 'a lacks lens, which camera requires'),
    ('PIN', 'a', ('only_b',), {}, 'only_b is allowed for b only'),
    ('PIN', 'a', ('t1',), {'clear': True}, 'no pin of t1 a is in force'),
    ('ORDER', 'a', ('t1', 't1'), {}, 'task_ids: t1 is there twice'),
    ('ORDER', 'a', (), {}, 'no order of a is in force'),
    ('UNDO', '', (), {'order_id': 'o7'}, "order_id = 'o7': expected an order in force"),
])
def test_what_cannot_be_kept_is_refused_with_the_reason(driver, action, uav, tasks, more, why):
    driver.add(Task('camera', (0.0, 0.0, 50.0), required_capabilities=frozenset({'lens'})),
               Task('only_b', (0.0, 0.0, 50.0), allowed_uavs=frozenset({'b'})))
    answer = driver.order(action, uav, *tasks, **more)
    assert (answer.success, answer.message) == (False, f'refused: {why}')
    assert driver.world.orders.in_force == {}


@pytest.mark.parametrize(('first', 'second'), [
    (('PIN', 'a', 't1'), ('PIN', 'b', 't1')),
    (('PIN', 'a', 't1'), ('FORBID', 'a', 't1')),
    (('FORBID', 'a', 't1'), ('PIN', 'a', 't1')),
    (('PIN', 'a', 't1'), ('ORDER', 'b', 't3', 't1')),
    (('ORDER', 'a', 't1'), ('ORDER', 'a', 't2')),
    (('ORDER', 'a', 't1'), ('ORDER', 'b', 't1')),
    (('PAUSE', 'a'), ('PIN', 'a', 't1')),
])
def test_a_contradiction_names_the_other_order(driver, first, second):
    assert driver.order(*first).success
    answer = driver.order(*second)
    assert not answer.success
    assert 'it contradicts order o1 of ann' in answer.message


def test_an_order_that_is_repeated_is_one_order(driver):
    assert driver.order('PIN', 'b', 't1').order_id == 'o1'
    answer = driver.order('PIN', 'b', 't1')
    assert (answer.success, answer.order_id) == (True, 'o1')
    assert list(driver.world.orders.in_force) == ['o1']


def test_a_pause_that_is_repeated_is_not_the_one_that_keeps_the_tasks(driver):
    assert driver.order('PAUSE', 'a', keep_tasks=True).order_id == 'o1'
    assert driver.order('PAUSE', 'a', keep_tasks=False).order_id == 'o2'
    again = driver.order('PAUSE', 'a', keep_tasks=False)
    assert (again.success, again.order_id) == (True, 'o2')


def test_a_dry_run_tells_the_price_and_changes_nothing(driver):
    driver.plan = plan
    before = (driver.world.version, driver.world.revision, dict(driver.lists))
    answer = driver.order('PIN', 'b', 't1', dry_run=True)
    assert answer.success
    assert answer.message == 'dry run: pin t1 to b: +600 m, finish +47 s'
    assert (answer.distance, answer.order_id) == (pytest.approx(600.0), '')
    assert (driver.world.version, driver.world.revision, driver.lists) == before
    assert driver.world.orders.in_force == {}
    assert driver.world.orders.number == 0


def real_driver():
    driver = AllocatorDriver(plan=plan, route_end='hold')
    driver.uav('a', 0.0, 0.0, 50.0, range=1000.0)
    driver.uav('b', 500.0, 0.0, 50.0, range=5000.0)
    driver.add(('near', 100, 0), ('far', 1500, 0))
    driver.settle()
    return driver


def test_a_task_beyond_the_range_of_its_uav_is_refused_by_the_solve():
    driver = real_driver()
    answer = driver.order('PIN', 'a', 'far')
    assert not answer.success
    assert 'refused: a cannot fly far: beyond the range' in answer.message
    answer = driver.order('ORDER', 'a', 'near', 'far')
    assert (answer.success, answer.message) == (False, (
        'refused: far in this order is beyond the range of a: it needs 1500 m and has 1000 m '
        'left'))


def test_an_order_that_takes_the_range_of_another_one_names_it():
    driver = real_driver()
    driver.add(('west', -800, 0), ('east', 800, 0))
    driver.settle()
    assert driver.order('PIN', 'a', 'west').success
    answer = driver.order('PIN', 'a', 'east')
    assert not answer.success
    assert 'contradicts order o1 of ann' in answer.message or 'cannot fly east' in answer.message


def test_an_ordered_task_that_comes_out_of_range_is_left_out_with_the_reason():
    driver = real_driver()
    assert driver.order('ORDER', 'b', 'near', 'far').success
    driver.settle()
    assert driver.route('b') == ('near', 'far')
    driver.uav('b', 500.0, 0.0, 50.0, range=1000.0)
    driver.world.request_replan('test', driver.now)
    driver.settle()
    assert driver.route('b') == ('near',)
    assert driver.state('far') == 'UNASSIGNED'
    assert 'far in this order is beyond the range of b' in driver.reason('far')
    assert 'order o1 of ann' in driver.reason('far')


def test_an_ordered_task_beyond_the_endurance_is_left_out_with_the_reason():
    driver = real_driver()
    assert driver.order('ORDER', 'b', 'near', 'far').success  # 1800 m
    driver.settle()
    driver.uav('b', 500.0, 0.0, 50.0, range=5000.0, cruise_speed=10.0, endurance=900.0)
    driver.world.request_replan('test', driver.now)
    driver.settle()
    assert driver.route('b') == ('near', 'far')
    driver.uav('b', 500.0, 0.0, 50.0, range=5000.0, cruise_speed=10.0, endurance=180.0)
    driver.world.request_replan('test', driver.now)
    driver.settle()
    assert driver.route('b') == ('near',)
    assert driver.state('far') == 'UNASSIGNED'
    assert 'far in this order is beyond the endurance of b: it needs 1' in driver.reason('far')
    assert 'and has 167 s left for its tasks' in driver.reason('far')  # without 5 %, a take-off


def test_an_order_beyond_the_endurance_of_its_uav_is_refused():
    driver = real_driver()
    driver.uav('b', 500.0, 0.0, 50.0, range=5000.0, cruise_speed=10.0, endurance=180.0)
    answer = driver.order('ORDER', 'b', 'near', 'far')
    assert not answer.success
    assert 'far in this order is beyond the endurance of b' in answer.message


def test_a_pinned_task_waits_for_a_uav_that_failed_at_it(driver):
    assert driver.order('PIN', 'b', 't3').success
    driver.settle()
    assert driver.event('FAILED', 't3', 'b', reason='no camera') == ''
    driver.settle()
    assert driver.state('t3') == 'UNASSIGNED'
    assert driver.reason('t3').startswith('only b may fly it (order o1 of ann); failed on b')
    assert driver.order('UNDO', order_id='o1').success
    driver.settle()
    assert 't3' in driver.route('a')


def test_a_status_before_the_next_plan_names_no_order_that_was_taken_back(driver):
    assert driver.order('RETURN').success
    driver.settle()
    driver.add(('t4', 500, 0))
    assert driver.order('FORBID', 'b', 't4').success
    driver.settle()
    assert driver.reason('t4') == (
        'not b (order o3 of ann); no UAV available: a has the order to return (order o1 of ann), '
        'b has the order to return (order o2 of ann)')
    assert driver.order('RESUME', 'a').success
    driver.core.tick(driver.now, driver.now)
    assert driver.reason('t4') == 'not b (order o3 of ann); waits for the next plan'
    assert driver.order('UNDO', order_id='o3').success
    driver.core.tick(driver.now, driver.now)
    assert (driver.state('t4'), driver.reason('t4')) == ('PENDING', 'waits for the next plan')
    driver.settle()
    assert 't4' in driver.route('a')


def test_orders_outlive_a_restart(driver):
    assert driver.order('PIN', 'b', 't1').success
    assert driver.order('PAUSE', 'a', keep_tasks=True).success
    assert driver.order('FORBID', 'a', 't3').success
    driver.settle()
    again = restarted(driver)
    assert again.world.orders.in_force == driver.world.orders.in_force
    assert again.world.orders.log == driver.world.orders.log
    assert again.world.orders.number == 3
    assert again.holds['a'].hold
    assert 't1' in again.route('b')
    assert again.order('UNDO', order_id='o2').success
    assert again.order('RETURN', 'a').order_id == 'o5'


def test_the_log_keeps_the_newest_entries_whatever_the_order_of_the_rows():
    entries = [OrderLogEntry(number, 0.0, 'ann', f'undo o{number}', 'x', 'free')
               for number in range(1, 1001)]
    orders = Orders(OrderRows(log=sorted(entries, key=lambda entry: str(entry.number))))
    orders.write_log(OrderLogEntry(0, 0.0, 'bob', 'plan 3 rejected', 'x', 'y'))
    assert list(orders.log) == list(range(2, 1002))


# pause, resume, return

def test_a_paused_uav_holds_and_its_tasks_wait(driver):
    assert driver.order('PAUSE', 'a', keep_tasks=True).success
    driver.settle()
    assert (driver.holds['a'].hold, driver.holds['a'].reason) == (True, 'order o1 of ann')
    assert (driver.route('a'), driver.state('t1')) == (('t1', 't2'), 'ASSIGNED')
    driver.add(('t4', 0, 0))
    driver.settle()
    assert 't4' in driver.route('b')
    assert driver.order('RESUME', 'a').success
    driver.settle()
    assert not driver.holds['a'].hold
    assert set(driver.route('a')) >= {'t1', 't2'}


def test_a_pause_without_its_tasks_gives_them_to_the_others(driver):
    assert driver.order('PAUSE', 'a').success
    driver.settle()
    assert driver.holds['a'].hold
    assert driver.route('a') == ()
    assert set(driver.route('b')) == {'t1', 't2', 't3'}


def test_a_paused_uav_that_is_lost_loses_its_tasks_all_the_same(driver):
    assert driver.order('PAUSE', 'a', keep_tasks=True).success
    driver.settle(wait=6.0, report=False)
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.settle(report=False)
    assert set(driver.route('b')) == {'t1', 't2', 't3'}


def test_a_uav_ordered_home_returns_and_gets_no_tasks(driver):
    assert driver.order('RETURN', 'a').success
    driver.settle()
    assert (driver.route('a'), driver.lists['a'].returns) == ((), True)
    assert set(driver.route('b')) == {'t1', 't2', 't3'}
    assert driver.order('RESUME', 'a').success
    driver.add(('t4', 10, 0))
    driver.settle()
    assert 't4' in driver.route('a')


def test_all_return_and_each_can_be_resumed(driver):
    answer = driver.order('RETURN')
    assert (answer.success, answer.order_id) == (True, 'o1,o2')
    driver.settle()
    assert all(driver.lists[uav_id].returns for uav_id in 'ab')
    assert driver.state('t1') == 'UNASSIGNED'
    assert driver.order('RESUME', 'b').success
    driver.settle()
    assert set(driver.route('b')) == {'t1', 't2', 't3'}


def test_the_last_of_pause_and_return_counts_and_undoing_it_brings_back_the_other(driver):
    assert driver.order('PAUSE', 'a', keep_tasks=True).success
    assert driver.order('RETURN', 'a').success
    driver.settle()
    assert not driver.holds['a'].hold
    assert driver.lists['a'].returns
    assert driver.order('UNDO', order_id='o2').success
    driver.settle()
    assert driver.holds['a'].hold


def test_resume_releases_a_uav_that_no_order_holds(driver):
    answer = driver.order('RESUME', 'a')
    assert (answer.success, answer.message) == (True, 'no order held a')
    driver.settle()
    assert driver.holds['a'].hold is False


def test_the_price_of_a_pause_depends_on_the_operator(driver):
    answer = driver.order('PAUSE', 'a', keep_tasks=True, dry_run=True)
    assert answer.success
    assert math.isnan(answer.distance)
    assert 'its price is not known' in answer.message


def test_a_uav_that_another_flies_is_neither_paused_nor_ordered_home(driver):
    why = 'authority LOST: a pilot has it; given back by ~/hand_over'
    driver.uav('b', 1000.0, 0.0, 50.0, available=False, authority='LOST', reason=why)
    for action in ('PAUSE', 'RETURN'):
        answer = driver.order(action, 'b')
        assert (answer.success, answer.message) == (
            False, f'refused: b, whose bridge has no authority ({why})')
    assert driver.world.orders.in_force == {}
    answer = driver.order('RETURN', '')
    assert answer.success
    assert answer.message.startswith(f'return a (not b, whose bridge has no authority ({why}))')
    assert [order.uav for order in driver.world.orders.in_force.values()] == ['a']
    driver.uav('b', 1000.0, 0.0, 50.0, authority='HELD')
    assert driver.order('PAUSE', 'b').success


def test_a_uav_on_the_ground_is_paused_whoever_may_fly_it_later(driver):
    driver.uav('b', 1000.0, 0.0, 50.0, authority='NONE', standby=True)
    assert driver.order('PAUSE', 'b').success
    driver.uav('a', 0.0, 0.0, 50.0, authority='NONE')
    assert not driver.order('PAUSE', 'a').success
