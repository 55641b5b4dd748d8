# SPDX-License-Identifier: Apache-2.0
"""The difference of two plans, and its text."""
import pytest

from uav_task_alloc.record.plan_diff import changes_text, route_changes, trigger_text


def test_a_reassigned_task_is_removed_from_one_uav_and_added_to_the_other():
    assert route_changes({'u1': ['a', 'b'], 'u2': []}, {'u1': ['a'], 'u2': ['b']}, set()) == [
        {'uav': 'u1', 'added': [], 'removed': [['b', 'u2']], 'reordered': False},
        {'uav': 'u2', 'added': [['b', 'u1']], 'removed': [], 'reordered': False}]


def test_a_completed_task_is_no_change_of_plan():
    assert route_changes({'u1': ['a', 'b']}, {'u1': ['b']}, {'a'}) == []


def test_a_task_that_no_uav_flies_any_more_has_no_new_uav():
    assert route_changes({'u1': ['a', 'b']}, {'u1': ['b']}, set()) == [
        {'uav': 'u1', 'added': [], 'removed': [['a', '']], 'reordered': False}]


@pytest.mark.parametrize(('new', 'reordered'), [
    (['a', 'b', 'c'], False), (['b', 'c'], False), (['a', 'x', 'c'], False),
    (['b', 'a', 'c'], True), (['c', 'x', 'a'], True)])
def test_reordered_refers_to_the_tasks_that_remain(new, reordered):
    rows = route_changes({'u1': ['a', 'b', 'c']}, {'u1': new}, {'a', 'b', 'c'})
    assert any(row['reordered'] for row in rows) is reordered


def test_a_new_or_missing_uav_is_compared_with_an_empty_list():
    rows = route_changes({'u1': ['a']}, {'u2': ['a']}, set())
    assert [(row['uav'], row['added'], row['removed']) for row in rows] == [
        ('u1', [], [['a', 'u2']]), ('u2', [['a', 'u1']], [])]


@pytest.mark.parametrize(('trigger', 'text'), [
    ('ADD a01', 'new task a01'), ('CANCEL x, UPDATE y', 'withdrawn task x, changed task y'),
    ('zones pop_up and 2 more', 'changed zones pop_up and 2 more'), ('uav_3 silent',) * 2,
    ('background', 'a better plan was found in the background'), ('', '')])
def test_a_trigger_is_shown_as_text(trigger, text):
    assert trigger_text(trigger) == text


def test_a_summary_stays_one_line():
    rows = route_changes({}, {f'u{k}': [f't{k}{n}' for n in range(9)] for k in range(9)}, set())
    assert changes_text(rows).endswith('u3 +t30 +t31 +t32 +t33 and 5 more and 5 more UAVs')
    rows = route_changes({'u1': ['a', 'b']}, {'u1': ['b', 'a']}, set())
    assert changes_text(rows) == 'u1 reordered'
