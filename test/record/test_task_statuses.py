# SPDX-License-Identifier: Apache-2.0
"""The last statuses of tasks and pieces over messages in which some are missing."""
import pytest

from uav_task_alloc.record.task_statuses import TaskStatuses


def after(*messages):
    """The statuses after messages, each {id: state}."""
    statuses = TaskStatuses()
    for states in messages:
        statuses.apply({'kind': 'statuses', 'wall': 0.0, 'statuses': [
            {'task': name, 'state': state, 'uav': 'u1', 'reason': ''}
            for name, state in states.items()]})
    return statuses


def states(rows):
    return {name: row.state for name, row in rows.items()}


@pytest.mark.parametrize('end', ['COMPLETED', 'FAILED', 'CANCELLED', 'REJECTED'])
def test_a_task_that_has_ended_is_known_after_the_allocator_has_forgotten_it(end):
    statuses = after({'a': end, 'b': 'ACTIVE'}, {'b': 'ACTIVE'}, {'b': 'ACTIVE'})
    assert states(statuses.known()) == {'a': end, 'b': 'ACTIVE'}
    assert (statuses.last('a').state, statuses.in_newest('a')) == (end, None)
    assert (statuses.is_forgotten('a'), statuses.is_forgotten('b')) == (True, False)
    assert states(statuses.tasks) == {'b': 'ACTIVE'}


def test_an_open_task_that_is_missing_is_unknown_to_the_allocator_until_it_is_there_again():
    statuses = after({'a': 'ACTIVE'}, {})
    assert statuses.last('a').reason.startswith('the allocator does not know it any more')
    statuses = after({'a': 'ACTIVE'}, {}, {'a': 'ASSIGNED'})
    assert (statuses.last('a').state, statuses.last('a').reason) == ('ASSIGNED', '')
    assert not statuses.is_forgotten('a')


def test_a_task_without_a_status_has_none():
    assert (after({}).last('a'), after({}).in_newest('a'), after({}).known()) == (None, None, {})


def test_pieces_are_no_tasks():
    statuses = after({'f': 'ASSIGNED', 'f#1': 'COMPLETED', 'f#2': 'ASSIGNED'})
    assert states(statuses.known()) == {'f': 'ASSIGNED'}
    assert states(statuses.known_pieces()) == {'f#1': 'COMPLETED', 'f#2': 'ASSIGNED'}
    assert statuses.in_newest('f#1').state == 'COMPLETED'
    assert statuses.count('ASSIGNED', 'COMPLETED') == 1
    assert statuses.completed() == {'f#1'}


def test_of_forgotten_pieces_the_flown_ones_are_known():
    statuses = after({'f#1': 'COMPLETED', 'f#2': 'CANCELLED'}, {}, {})
    assert states(statuses.known_pieces()) == {'f#1': 'COMPLETED'}
    assert statuses.completed() == set()


def test_a_new_task_of_a_forgotten_id_has_neither_its_end_nor_its_pieces():
    statuses = after({'f': 'COMPLETED', 'f#1': 'COMPLETED', 'g#1': 'COMPLETED'}, {})
    assert statuses.forget_former('f')
    assert (statuses.known(), states(statuses.known_pieces())) == ({}, {'g#1': 'COMPLETED'})
    assert not statuses.forget_former('f')


def test_a_task_in_the_newest_message_is_no_former_one():
    statuses = after({'f': 'COMPLETED', 'f#1': 'COMPLETED'})
    assert not statuses.forget_former('f')
    assert states(statuses.known_pieces()) == {'f#1': 'COMPLETED'}


def test_tasks_are_counted_by_their_last_state():
    statuses = after({'a': 'COMPLETED', 'b': 'FAILED', 'c': 'ACTIVE'}, {'c': 'COMPLETED'})
    assert (statuses.count('COMPLETED'), statuses.count('FAILED', 'ACTIVE')) == (2, 1)
    assert statuses.completed() == {'a', 'c'}
