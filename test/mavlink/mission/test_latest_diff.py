# SPDX-License-Identifier: Apache-2.0
"""A comparison of a list with the mission on board is repeated only where something changed."""
from dataclasses import replace

import pytest
from mission_bench import ORIGIN, task_list

from uav_task_alloc.mavlink.autopilots import PX4
from uav_task_alloc.mavlink.mission import diff
from uav_task_alloc.mavlink.mission.diff import DiffKind, LatestDiff
from uav_task_alloc.mavlink.mission.items import mission_items


@pytest.fixture
def items():
    return mission_items(task_list('ABC'), PX4.rules, ORIGIN)


def test_the_same_items_are_compared_once(items, monkeypatch):
    latest, ahead = LatestDiff(), items[1:]
    first = latest.of(items, 1, ahead, frozenset('A'))
    assert first == diff.diff_missions(items, 1, ahead, done='A')
    monkeypatch.setattr(diff, 'diff_missions', None)
    assert latest.of(items, 1, ahead, frozenset('A')) is first


@pytest.mark.parametrize(('held', 'current', 'wanted', 'done', 'kind'), [
    ('ABC', 0, 'BC', 'A', DiffKind.JUMP),
    ('ABC', None, 'BC', 'A', DiffKind.JUMP),
    ('ABC', 0, 'BC', '', DiffKind.REPLACE),
    ('ABC', 1, 'ABC', '', DiffKind.JUMP),
    ('AB', 1, 'BC', 'A', DiffKind.APPEND),
])
def test_whatever_changes_is_compared_again(items, held, current, wanted, done, kind):
    latest, ahead = LatestDiff(), items[1:]
    missions = {'ABC': items, 'AB': items[:2], 'BC': ahead}
    assert latest.of(items, 1, ahead, frozenset('A')).kind is DiffKind.KEEP
    assert latest.of(missions[held], current, missions[wanted], frozenset(done)).kind is kind


def test_items_that_are_equal_but_of_other_tasks_are_compared_again(items):
    latest = LatestDiff()
    latest.of(items, 0, items, frozenset())
    renamed = tuple(replace(item, task=f'{item.task}2') for item in items)
    assert [item.task for item in latest.of(items, 0, renamed, frozenset()).items] == [
        'A2', 'B2', 'C2']
