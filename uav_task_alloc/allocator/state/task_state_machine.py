# SPDX-License-Identifier: Apache-2.0
"""The life of a task: what each event makes of each state, and why; one table, no code beside it.

docs/task_states.md is drawn from it.
"""
from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from typing import NamedTuple

from uav_task_alloc.allocator.records import ENDED, OPEN, TaskState


class TaskTransition(Enum):
    """What may happen to a task, in words."""

    ADD = 'announced'
    UPDATE = 'announced with new content'
    CANCEL = 'withdrawn'
    WAIT = 'no plan has judged it yet'
    LIST = 'in the list of a UAV'
    LEAVE = 'left out by a plan'
    START = 'STARTED by the UAV that has it'
    START_MOVED = 'STARTED by a UAV that had it'
    COMPLETE = 'COMPLETED by the UAV that has it'
    COMPLETE_MOVED = 'COMPLETED by a UAV that had it'
    FAIL = 'FAILED on the UAV that has it, others may try'
    FAIL_LAST = 'FAILED once too often, or nobody else can'
    FAIL_MOVED = 'FAILED on a UAV that had it'


class Rule(NamedTuple):
    """What follows from an event: the next state, or None where the event changes nothing."""

    state: TaskState | None
    reason: str  # of the state, or why nothing changes; {uav}, {why} are those of the event


TransitionRow = dict[TaskState, Rule]
PENDING, ASSIGNED, ACTIVE, COMPLETED, FAILED, CANCELLED, REJECTED, UNASSIGNED = TaskState


def _on(states: Iterable[TaskState], state: TaskState | None, reason: str) -> TransitionRow:
    return dict.fromkeys(states, Rule(state, reason))


def _stay(states: Iterable[TaskState], reason: str) -> TransitionRow:
    return {state: Rule(state, reason) for state in states}


def _over(what: str) -> TransitionRow:
    """An event that comes too late, or for a task that was never accepted."""
    return {COMPLETED: Rule(None, 'it is COMPLETED already'),
            FAILED: Rule(None, 'it is FAILED already'),
            CANCELLED: Rule(None, 'it was cancelled'), REJECTED: Rule(None, what)}


UNKNOWN, MOVED = 'unknown task', '{uav} does not have it any more'
TABLE: dict[TaskTransition, TransitionRow] = {
    TaskTransition.ADD: {
        **_on(OPEN, None, 'announced before'),
        **_on(ENDED, None, 'announced before'),
        REJECTED: Rule(PENDING, 'waits for the next plan'),
    },
    TaskTransition.UPDATE: {
        **_stay(OPEN, '{why}'),
        FAILED: Rule(PENDING, 'changed: tried again'),
        COMPLETED: Rule(None, 'is COMPLETED: nothing to update'),
        CANCELLED: Rule(None, 'is CANCELLED: nothing to update'),
        REJECTED: Rule(None, f'{UNKNOWN}: nothing to update'),
    },
    TaskTransition.CANCEL: {
        **_on({*OPEN, FAILED}, CANCELLED, 'cancelled'),
        COMPLETED: Rule(None, 'is COMPLETED: nothing to cancel'),
        CANCELLED: Rule(None, 'cancelled before'),
        REJECTED: Rule(None, f'{UNKNOWN}: nothing to cancel'),
    },
    TaskTransition.WAIT: {**_over(UNKNOWN), **_on(OPEN, PENDING, '{why}')},
    TaskTransition.LIST: {**_over(UNKNOWN), **_on(OPEN, ASSIGNED, '')},
    TaskTransition.LEAVE: {**_over(UNKNOWN), **_on(OPEN, UNASSIGNED, '{why}')},
    TaskTransition.START: {**_over(UNKNOWN), **_on(OPEN, ACTIVE, '')},
    TaskTransition.START_MOVED: {**_over(UNKNOWN), **_on(OPEN, None, MOVED)},
    # a fact, whoever the task was given to meanwhile: it must not be flown twice
    TaskTransition.COMPLETE: {**_over(UNKNOWN), **_on({*OPEN, FAILED}, COMPLETED, '{why}')},
    TaskTransition.COMPLETE_MOVED: {
        **_over(UNKNOWN),
        **_on({*OPEN, FAILED}, COMPLETED, 'completed after it was moved'),
    },
    TaskTransition.FAIL: {**_over(UNKNOWN), **_on(OPEN, PENDING, 'failed on {uav}: {why}')},
    TaskTransition.FAIL_LAST: {**_over(UNKNOWN), **_on(OPEN, FAILED, 'failed on {uav}: {why}')},
    TaskTransition.FAIL_MOVED: {**_over(UNKNOWN), **_on(OPEN, None, MOVED)},
}


def after(state: TaskState, event: TaskTransition, uav: str = '', why: str = '') -> Rule:
    """What the event makes of a task in that state, with the reason filled in.

    A task that was never accepted is REJECTED.
    """
    rule = TABLE[event][state]
    # not str.format: what a message says may hold braces
    return rule._replace(reason=rule.reason.replace('{uav}', uav).replace('{why}', why))


def markdown_text() -> str:
    """docs/task_states.md: the table and the picture."""
    parts = ['# Task states\n\nDrawn from `uav_task_alloc/allocator/state/task_state_machine.py`. '
             'A cell has the next state; in brackets: the event changes nothing, and why.\n\n']
    parts += [f'| event | {" | ".join(state.name for state in TaskState)} |\n',
              '|---' * (len(TaskState) + 1) + '|\n']
    for event, row in TABLE.items():
        cells = [rule.state.name if rule.state else f'({rule.reason})'
                 for rule in map(row.__getitem__, TaskState)]
        parts.append(f'| {event.value} | {" | ".join(cells)} |\n')
    arrows = {(state.name, rule.state.name) for row in TABLE.values()
              for state, rule in row.items() if rule.state and rule.state is not state}
    lines = ''.join(f'  {a} --> {b}\n' for a, b in sorted(arrows))
    return ''.join(parts) + f'\n```mermaid\nstateDiagram-v2\n{lines}```\n'
