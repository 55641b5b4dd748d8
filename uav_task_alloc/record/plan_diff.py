# SPDX-License-Identifier: Apache-2.0
"""The difference of two plans: tasks added, removed and reordered, by UAV."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from uav_task_alloc.errors import first_of

RouteLists = Mapping[str, Sequence[str]]  # task ids in the order flown, by UAV
_TRIGGER_TEXTS = {'ADD': 'new task', 'UPDATE': 'changed task', 'CANCEL': 'withdrawn task'}


def route_lists(line: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the task ids of all lists of an allocation line.

    Args:
        line: of kind `allocation`.

    Returns:
        Ids in the order of flight, by UAV.
    """
    return {row['uav']: [task['id'] for task in row['tasks']] for row in line.get('lists', ())}


def route_changes(before: RouteLists, after: RouteLists, done: set[str]) -> list[dict[str, Any]]:
    """Compare two plans.

    Args:
        before, after: lists of the plans.
        done: ids of completed tasks; their removal is no change of plan.

    Returns:
        A row for each UAV whose list changed: `uav`, `added` [[task, UAV that had it or '']],
        `removed` [[task, UAV that has it or '']], `reordered`.
    """
    uav_before = {task: uav for uav, tasks in before.items() for task in tasks}
    uav_after = {task: uav for uav, tasks in after.items() for task in tasks}
    rows = []
    for uav in sorted(before.keys() | after.keys()):
        old, new = before.get(uav, ()), after.get(uav, ())
        added = [[task, uav_before.get(task, '')] for task in new
                 if uav_before.get(task) != uav]
        removed = [[task, uav_after.get(task, '')] for task in old
                   if uav_after.get(task) != uav and task not in done]
        index = {task: k for k, task in enumerate(old)}
        reordered = any(a > b for a, b in pairwise(
            index[task] for task in new if task in index))
        if added or removed or reordered:
            rows.append({'uav': uav, 'added': added, 'removed': removed, 'reordered': reordered})
    return rows


def trigger_text(trigger: str) -> str:
    """Return the trigger of a re-plan as a text for users: `ADD a01` is `new task a01`.

    Args:
        trigger: of an Allocation; several are separated by commas.

    Returns:
        Unknown triggers stay as they are.
    """
    if trigger == 'background':
        return 'a better plan was found in the background'
    if trigger == 'replan service':
        return 'requested through the replan service'
    texts = []
    for part in trigger.split(', '):
        word, _, rest = part.partition(' ')
        texts.append(f'{_TRIGGER_TEXTS[word]} {rest}' if word in _TRIGGER_TEXTS and rest else
                     f'changed zones {rest}' if word == 'zones' else part)
    return ', '.join(texts)


def changes_text(rows: Sequence[Mapping[str, Any]], most: int = 4) -> str:
    """Return the result of `route_changes` as a line: `uav_1 +a01, uav_2 -t03 reordered`.

    Args:
        rows: one a UAV.
        most: UAVs, and tasks of each, that are shown.

    Returns:
        '' for no changes.
    """
    texts = []
    for row in rows:
        signs = [f'+{task}' for task, _ in row['added']] + [f'-{t}' for t, _ in row['removed']]
        words = [row['uav'], first_of(signs, most, ' '), 'reordered' * row['reordered']]
        texts.append(' '.join(filter(None, words)))
    return first_of(texts, most, kind=' UAVs')
