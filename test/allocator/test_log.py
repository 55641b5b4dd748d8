# SPDX-License-Identifier: Apache-2.0
"""The log of the allocator: a line for each plan, and for each task accepted, refused or done."""
from allocation import AllocatorDriver

from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.allocator.status import health_warnings
from uav_task_alloc.model import Task


def fleet():
    driver = AllocatorDriver(route_end='home')
    driver.uav('a', 0.0, 0.0, 50.0, cruise_speed=10.0)
    driver.add(Task('t1', (100.0, 0.0, 50.0), service_time=7.0),
               Task('t2', (200.0, 0.0, 50.0)),
               Task('t3', (0.0, 0.0, 50.0), required_capabilities={'lidar'}))
    driver.settle()
    return driver


def test_a_plan_has_a_line_with_trigger_tasks_metres_finish_and_solve_time():
    driver = fleet()
    [line] = [note for note in driver.notes if note.startswith('plan ')]
    assert line == ('plan 1 (a reports, ADD t1, ADD t2 and 1 more): 2 tasks on 1 UAV, 1 left out; '
                    '400 m, finish in 57 s, solved in 0 ms')
    assert driver.levels[line] == 'info'


def test_one_task_is_no_tasks():
    driver = fleet()
    [warning] = health_warnings(driver.world, '')
    assert warning.startswith('1 task unassigned, t3: ')
    driver.add(Task('t4', (0.0, 0.0, 50.0), required_capabilities={'lidar'}))
    driver.settle()
    [warning] = health_warnings(driver.world, '')
    assert warning.startswith('2 tasks unassigned, t3: ')


def test_the_finish_counts_from_now():
    driver = fleet()
    driver.now += 2.0  # a fleet that is simulated at eight times real time
    driver.uav('a', 105.0, 0.0, 50.0, cruise_speed=10.0)
    driver.event('COMPLETED', 't1', 'a')
    driver.add(('t4', 200, 0))
    driver.settle()
    line = next(note for note in reversed(driver.notes) if note.startswith('plan '))
    assert 'finish in 36 s' in line  # with half a stop and a whole one


def test_the_finish_is_not_named_before_the_uavs_have_reported():
    driver = AllocatorDriver(restored_state(fleet().core.rows()))
    driver.core.tick(driver.now, driver.now)
    driver.take()
    [line] = [note for note in driver.notes if note.startswith('plan ')]
    assert line == 'plan 2 (restart): 2 tasks on 1 UAV; 400 m, solved in 0 ms'


def test_each_task_has_a_line_when_it_is_accepted_refused_started_and_done():
    driver = fleet()
    driver.add(('t2', 9, 9))
    driver.add(('t2', 190, 0), action=AnnouncementAction.UPDATE)
    for kind in ('STARTED', 'COMPLETED', 'COMPLETED'):  # the last is repeated
        driver.event(kind, 't1', 'a')
    driver.event('FAILED', 't2', 'a', reason='blocked')
    driver.cancel('t3')
    driver.settle()
    lines = [(driver.levels[note], note) for note in driver.notes if note.split("'")[0] in (
        'task ', 'ADD of task ')]
    assert lines == [
        ('info', "task 't1' accepted"), ('info', "task 't2' accepted"),
        ('info', "task 't3' accepted"),
        ('warning', "ADD of task 't2' REJECTED: duplicate id: another task was announced under "
                    'it'),
        ('info', "task 't2' updated"), ('debug', "task 't1' started by a"),
        ('info', "task 't1' completed by a"),
        ('warning', "task 't2' failed on a: blocked: it is FAILED"),
        ('info', "task 't3' cancelled")]


def test_an_announcement_that_is_repeated_has_a_line_in_a_minute():
    driver = fleet()
    said = len(driver.notes)

    def announce():
        driver.add(('t4', 300, 0))  # as it is
        driver.add(('t4', 9, 9))  # another one
        driver.world.refuse('bad id', 'why', driver.now)
        driver.cancel('unknown')
        driver.settle()
        return [note for note in driver.notes[said:] if 'plan ' not in note]

    announce()
    lines = announce()
    assert lines == [
        "task 't4' accepted", "ADD of task 't4' REJECTED: duplicate id: another task was announced"
        ' under it', "task 'bad id' REJECTED: why",
        "CANCEL of task 'unknown' REJECTED: unknown task: nothing to cancel",
        'ADD of t4 ignored: duplicate: announced before, unchanged']
    driver.now += 1.0
    assert announce() == lines
    driver.now += 60.0
    assert len(announce()) == len(lines) + 4
