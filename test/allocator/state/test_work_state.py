# SPDX-License-Identifier: Apache-2.0
"""The state, progress and reason of work from the records of its pieces."""
import pytest

from uav_task_alloc.allocator.records import TaskRecord, TaskState
from uav_task_alloc.allocator.state.work_state import record_of_whole, state_of_pieces
from uav_task_alloc.allocator.work_records import WorkRecord
from uav_task_alloc.model import Task
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.values import Kind

CABLE = Work(Task('cable', (0.0, 0.0, 50.0)), Kind.LINE,
             ((0.0, 0.0, 50.0), (500.0, 0.0, 50.0)))


def piece(number, state, uav='', reason='', stamp=0.0, since=0.0):
    task = Task(f'cable#{number}', (0.0, 0.0, 50.0))
    return TaskRecord(task, task, TaskState[state], uav, reason, stamp, since=since)


def whole(*pieces):
    ids = tuple(each.task.id for each in pieces)
    return record_of_whole(WorkRecord(CABLE, CABLE, ids), pieces)


@pytest.mark.parametrize(('states', 'expected'), [
    ('', 'COMPLETED'), ('COMPLETED', 'COMPLETED'),
    ('COMPLETED FAILED', 'FAILED'), ('FAILED CANCELLED COMPLETED', 'CANCELLED'),
    ('CANCELLED UNASSIGNED', 'UNASSIGNED'), ('UNASSIGNED PENDING', 'PENDING'),
    ('PENDING ASSIGNED FAILED', 'ASSIGNED'), ('ASSIGNED ACTIVE COMPLETED', 'ACTIVE')])
def test_the_state_of_the_whole_is_that_of_the_piece_that_has_come_furthest(states, expected):
    pieces = [piece(k, state) for k, state in enumerate(states.split(), 1)]
    assert state_of_pieces(pieces) is TaskState[expected]


def test_the_reason_says_how_many_pieces_are_completed_and_what_keeps_the_first_of_the_rest():
    record, done = whole(piece(1, 'COMPLETED', 'a'), piece(2, 'UNASSIGNED'),
                         piece(3, 'UNASSIGNED', reason='inside zone tower'))
    assert (done, record.state) == (1, TaskState.UNASSIGNED)
    assert record.reason == '1 of 3 sections; inside zone tower'


def test_completed_work_has_no_reason_of_a_piece():
    record, done = whole(piece(1, 'COMPLETED', 'a', 'flown'), piece(2, 'COMPLETED', 'a'))
    assert (done, record.reason) == (2, '2 of 2 sections')


@pytest.mark.parametrize(('uavs', 'expected'), [('aa', 'a'), ('ab', '')])
def test_the_uav_is_that_of_all_pieces_in_this_state(uavs, expected):
    record, _ = whole(piece(1, 'ASSIGNED', uavs[0]), piece(2, 'ASSIGNED', uavs[1]),
                      piece(3, 'COMPLETED', 'c'))
    assert record.uav == expected


def test_the_whole_is_as_old_as_its_first_piece_and_as_new_as_its_last():
    record, _ = whole(piece(1, 'COMPLETED', stamp=4.0, since=2.0),
                      piece(2, 'ASSIGNED', stamp=9.0, since=3.0))
    assert (record.since, record.stamp) == (2.0, 9.0)
    assert (record.task, record.announced) == (CABLE.task, CABLE.task)
