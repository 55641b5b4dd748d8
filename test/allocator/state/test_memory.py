# SPDX-License-Identifier: Apache-2.0
"""Memory is bounded: old ended tasks are forgotten, open ones stay, a flood is refused."""
from allocation import AllocatorDriver

from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.allocator.state import admission, tasks
from uav_task_alloc.allocator.status import health_warnings


def flown(count, **params):
    driver = AllocatorDriver(**params)
    driver.uav('a', 0.0, 0.0, 50.0)
    for k in range(count):
        driver.add((f't{k}', 100.0 * k, 0.0))
        driver.settle()
        driver.event('COMPLETED', f't{k}', 'a')
        driver.settle()
    return driver


def test_only_the_newest_ended_tasks_are_remembered():
    driver = flown(6, keep_ended=3)
    assert sorted(driver.world.tasks.records) == ['t3', 't4', 't5']
    assert driver.world.lists._contained.keys() <= {('a', f't{k}') for k in (3, 4, 5)}


def test_a_forgotten_task_is_removed_from_the_journal_too():
    driver = flown(3, keep_ended=3)
    driver.core.written()
    driver.add(('t3', 0.0, 0.0))
    driver.settle()
    driver.event('COMPLETED', 't3', 'a')
    driver.settle()
    assert [row.id for row in driver.core.rows() if row.body is None] == ['t0']


def test_an_open_task_is_never_forgotten_however_old():
    driver = AllocatorDriver(keep_ended=0)
    driver.add(('t0', 0.0, 0.0))
    for k in range(1, 4):
        driver.add((f't{k}', 0.0, 0.0))
        driver.cancel(f't{k}')
        driver.settle()
    assert list(driver.world.tasks.records) == ['t0']


def test_the_order_in_which_tasks_ended_survives_a_restart():
    before = flown(4)
    after = AllocatorDriver(restored_state(before.core.rows()), keep_ended=2)
    after.settle()
    assert sorted(after.world.tasks.records) == ['t2', 't3']


def test_more_open_tasks_than_can_be_held_are_refused(monkeypatch):
    monkeypatch.setattr(tasks, 'MAX_OPEN', 2)
    driver = AllocatorDriver()
    verdicts = driver.add(*((f't{k}', 0.0, 0.0) for k in range(3)))
    assert [v.accepted for v in verdicts] == [True, True, False]
    assert verdicts[2].reason == 'open tasks = 2: expected fewer'
    driver.cancel('t0')
    assert driver.add(('t2', 0.0, 0.0))[0].accepted


def test_invented_uavs_do_not_keep_a_real_one_out(monkeypatch):
    monkeypatch.setattr(admission, 'MAX_UAVS', 2)
    driver = AllocatorDriver()
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t0', 100.0, 0.0))
    driver.settle()
    driver.uav('ghost', 0.0, 0.0, 50.0)
    assert 'expected one of the 2 UAVs' in driver.uav('b', 0.0, 0.0, 50.0)
    for _ in range(4):  # the ghost falls silent
        driver.now += 2.0
        driver.uav('a', 0.0, 0.0, 50.0)
        driver.settle(report=False)
    assert driver.uav('b', 0.0, 0.0, 50.0) == ''
    assert sorted(driver.world.fleet.records) == ['a', 'b']


def test_finding_33_an_event_of_a_forgotten_task_is_not_applied_to_a_new_one_of_that_id():
    driver = flown(1, keep_ended=0)
    before = driver.world.lists.get('a').revision
    driver.add(('t0', 0.0, 0.0))
    driver.settle()
    held = driver.world.lists.get('a').revision
    assert 'did not have it' in driver.event('COMPLETED', 't0', 'a', revision=before)
    assert 'did not have it' in driver.event('COMPLETED', 't0', 'a', revision=before)
    driver.settle()
    assert driver.state('t0') == 'ASSIGNED'
    assert driver.world.lists.get('a').revision == held + 1  # the list is resent, once a second
    assert driver.event('COMPLETED', 't0', 'a') == ''


def test_finding_33_an_event_for_a_future_revision_resends_nothing():
    driver = flown(0)
    driver.add(('t0', 0.0, 0.0))
    driver.settle()
    assert 'did not have it' in driver.event('COMPLETED', 't0', 'a', revision=77)
    driver.settle()
    assert driver.world.lists.get('a').revision == 1


def flood(driver, count, each_second=100, **more):
    """Report invented ids once each while UAV `real` reports; returns how many were refused."""
    refused = 0
    for k in range(count):
        refused += bool(driver.uav(f'g{k}', 9e4 + k, 0.0, 50.0, **more))
        if (k + 1) % each_second == 0:
            report_for(driver, 1.0)
    return refused


def report_for(driver, seconds):
    """Let time pass in which `real` reports that it holds its list."""
    for _ in range(int(seconds)):
        driver.now += 1.0
        driver.uav('real', 0.0, 0.0, 50.0, list_revision=driver.world.lists.get('real').revision)
        driver.core.tick(driver.now, driver.now)
        driver.take()


def flying():
    """An allocator whose UAV `real` holds a list; UAV `home` has flown, and is silent."""
    driver = AllocatorDriver(uav_timeout=3.0)
    driver.uav('home', 100.0, 0.0, 50.0)
    driver.add(('t0', 100, 0))
    driver.settle()
    driver.event('COMPLETED', 't0', 'home')
    driver.uav('real', 0.0, 0.0, 50.0)
    driver.settle(report=False)
    driver.now += 5.0
    driver.core.tick(driver.now, driver.now)
    driver.add(('t1', 100, 0))
    report_for(driver, 1.0)
    driver.settle(report=False)
    report_for(driver, 1.0)
    assert driver.route('real') == ('t1',)
    return driver


def written(driver):
    """The ids of the rows of lists that a journal would have."""
    return {row.id for row in driver.core.rows() if row.kind == 'list' and row.body is not None}


def test_finding_24_a_flood_of_invented_uavs_leaves_no_lists_and_no_rows():
    driver = flying()
    flood(driver, 5000, list_revision=7)
    assert len(driver.world.fleet.records) == admission.MAX_UAVS
    assert len(driver.world.lists.lists) <= admission.MAX_UAVS + 1
    assert len(written(driver)) <= admission.MAX_UAVS + 1
    assert driver.forgotten >= {f'g{k}' for k in range(3000)}
    report_for(driver, admission.FORGET_AFTER + admission.CHECK_PERIOD + 5.0)
    assert set(driver.world.fleet.records) == {'real', 'home'}
    assert written(driver) == set(driver.world.lists.lists) == {'real', 'home'}
    assert driver.route('real') == ('t1',)
    world = driver.world
    for by_uav in (world.zone_checks._checked, world.zone_checks.stranded,
                   world.validity.zones_when_built, world._events._resent, world.jumps._jumps):
        assert set(by_uav) <= {'real', 'home'}


def test_finding_24_invented_uavs_do_not_push_out_one_that_has_flown():
    driver = flying()
    assert flood(driver, 5000, each_second=2000) > 0
    assert {'real', 'home'} <= set(driver.world.fleet.records)
    assert driver.uav('home', 0.0, 0.0, 50.0) == ''


def test_finding_24_that_no_uav_is_admitted_is_logged_once_until_there_is_room():
    driver = flying()
    flood(driver, 1500, each_second=500)
    full = [note for note in driver.notes if 'UAVs = 1000: expected fewer' in note]
    assert len(full) == 1
    assert any('UAVs = 1000' in warning for warning in health_warnings(driver.world, ''))
    report_for(driver, 5.0)
    assert driver.uav('new', 0.0, 0.0, 50.0) == ''
    report_for(driver, admission.FORGET_AFTER + admission.CHECK_PERIOD)
    driver.uav('newer', 0.0, 0.0, 50.0)
    assert not any('UAVs = 1000' in warning for warning in health_warnings(driver.world, ''))


def test_finding_24_a_uav_that_reports_again_after_it_was_forgotten_gets_a_higher_revision():
    driver = AllocatorDriver(uav_timeout=3.0)
    driver.uav('a', 0.0, 0.0, 50.0)  # it never says that it holds its list
    driver.add(('t0', 100, 0))
    driver.settle()
    driver.cancel('t0')
    driver.settle(report=False, wait=5.0)
    before = driver.lists['a'].revision
    report_for(driver, admission.FORGET_AFTER + admission.CHECK_PERIOD + 1.0)
    assert 'a' not in driver.world.fleet.records
    assert 'a' not in driver.world.lists.lists
    driver.uav('a', 100.0, 0.0, 50.0)
    driver.add(('t1', 100, 0))
    driver.settle()
    assert driver.lists['a'].revision > before


def test_finding_24_lists_of_a_journal_whose_uavs_never_report_are_forgotten():
    driver = flying()
    flood(driver, 900, list_revision=7)
    after = AllocatorDriver(restored_state(driver.core.rows()), uav_timeout=3.0)
    assert len(after.world.lists.lists) > 900
    report_for(after, admission.FORGET_AFTER + admission.CHECK_PERIOD + 5.0)
    assert set(after.world.lists.lists) == {'real'}


def test_finding_24_an_answer_for_a_uav_that_was_forgotten_meanwhile_is_taken():
    driver = AllocatorDriver(uav_timeout=3.0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('ghost', 0.0, 10.0, 50.0)
    driver.add(('t0', 0, 10), ('t1', 100, 0))
    problem = driver.begin()
    report_for(driver, 5.0)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.world.forget_uav('ghost')
    driver.finish(problem)
    driver.settle()
    assert set(driver.world.lists.owners()) == {'t0', 't1'}
    assert 'ghost' not in driver.world.lists.lists
