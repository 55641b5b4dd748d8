# SPDX-License-Identifier: Apache-2.0
import pytest

from uav_task_alloc.record.plan_diff import changes, in_words, summary


def test_a_task_that_moves_is_told_on_both_sides():
    assert changes({'u1': ['a', 'b'], 'u2': []}, {'u1': ['a'], 'u2': ['b']}, set()) == [
        {'uav': 'u1', 'added': [], 'removed': [['b', 'u2']], 'reordered': False},
        {'uav': 'u2', 'added': [['b', 'u1']], 'removed': [], 'reordered': False}]


def test_what_was_flown_is_no_change_of_plan():
    assert changes({'u1': ['a', 'b']}, {'u1': ['b']}, {'a'}) == []


def test_what_nobody_flies_any_more_went_nowhere():
    assert changes({'u1': ['a', 'b']}, {'u1': ['b']}, set()) == [
        {'uav': 'u1', 'added': [], 'removed': [['a', '']], 'reordered': False}]


@pytest.mark.parametrize(('new', 'reordered'), [
    (['a', 'b', 'c'], False), (['b', 'c'], False), (['a', 'x', 'c'], False),
    (['b', 'a', 'c'], True), (['c', 'x', 'a'], True)])
def test_order_is_that_of_the_tasks_that_stayed(new, reordered):
    rows = changes({'u1': ['a', 'b', 'c']}, {'u1': new}, {'a', 'b', 'c'})
    assert any(row['reordered'] for row in rows) is reordered


def test_a_uav_that_comes_or_goes_is_compared_with_nothing():
    rows = changes({'u1': ['a']}, {'u2': ['a']}, set())
    assert [(row['uav'], row['added'], row['removed']) for row in rows] == [
        ('u1', [], [['a', 'u2']]), ('u2', [['a', 'u1']], [])]


@pytest.mark.parametrize(('trigger', 'words'), [
    ('ADD a01', 'new task a01'), ('CANCEL x, UPDATE y', 'withdrawn task x, changed task y'),
    ('zones pop_up and 2 more', 'changed zones pop_up and 2 more'), ('uav_3 silent',) * 2,
    ('background', 'a better plan was found while nothing happened'), ('', '')])
def test_a_trigger_is_told_in_words(trigger, words):
    assert in_words(trigger) == words


def test_a_summary_stays_one_line():
    rows = changes({}, {f'u{k}': [f't{k}{n}' for n in range(9)] for k in range(9)}, set())
    assert summary(rows).endswith('u3 +t30 +t31 +t32 +t33 and 5 more and 5 more UAVs')
    assert summary(changes({'u1': ['a', 'b']}, {'u1': ['b', 'a']}, set())) == 'u1 reordered'
