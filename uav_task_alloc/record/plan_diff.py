# SPDX-License-Identifier: Apache-2.0
"""What a re-plan changed: for each UAV which tasks came, went, or are flown in another order."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from uav_task_alloc.record.run_state import Line

RouteLists = Mapping[str, Sequence[str]]  # task ids in the order flown, by UAV
DONE = ('COMPLETED',)
WORDS = {'ADD': 'new task', 'UPDATE': 'changed task', 'CANCEL': 'withdrawn task'}


def routes(line: Line) -> dict[str, list[str]]:
    """The lists of an allocation line."""
    return {row['uav']: [task['id'] for task in row['tasks']] for row in line.get('lists', ())}


def changes(before: RouteLists, after: RouteLists, done: set[str]) -> list[dict[str, Any]]:
    """One row for each UAV that flies something else than before.

    Each: uav, added [[task, UAV it came from or '']], removed [[task, UAV it went to or '']],
    reordered. What is `done` went because it was flown, which is no change of plan.
    """
    had = {task: uav for uav, tasks in before.items() for task in tasks}
    has = {task: uav for uav, tasks in after.items() for task in tasks}
    rows = []
    for uav in sorted(before.keys() | after.keys()):
        old, new = before.get(uav, ()), after.get(uav, ())
        added = [[task, had.get(task, '')] for task in new if had.get(task) != uav]
        removed = [[task, has.get(task, '')] for task in old
                   if has.get(task) != uav and task not in done]
        place = {task: k for k, task in enumerate(old)}
        reordered = any(a > b for a, b in pairwise(
            place[task] for task in new if task in place))
        if added or removed or reordered:
            rows.append({'uav': uav, 'added': added, 'removed': removed, 'reordered': reordered})
    return rows


def in_words(trigger: str) -> str:
    """A trigger as the allocator names it, for people: `ADD a01` is `new task a01`."""
    if trigger == 'background':
        return 'a better plan was found while nothing happened'
    if trigger == 'replan service':
        return 'somebody asked for it'
    said = []
    for part in trigger.split(', '):
        word, _, rest = part.partition(' ')
        said.append(f'{WORDS[word]} {rest}' if word in WORDS and rest else
                    f'changed zones {rest}' if word == 'zones' else part)
    return ', '.join(said)


def summary(rows: Sequence[Mapping[str, Any]], most: int = 4) -> str:
    """One line: `uav_1 +a01, uav_2 -t03 reordered`."""
    said = []
    for row in rows[:most]:
        signs = [f'+{task}' for task, _ in row['added']] + [f'-{t}' for t, _ in row['removed']]
        text = ' '.join(signs[:most]) + (f' and {len(signs) - most} more' * (len(signs) > most))
        said.append(f'{row["uav"]} {text}{" reordered" * row["reordered"]}'.replace('  ', ' '))
    return ', '.join(said) + (f' and {len(rows) - most} more UAVs' * (len(rows) > most))
