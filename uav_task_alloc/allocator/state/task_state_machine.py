# SPDX-License-Identifier: Apache-2.0
"""Task state machine: one table of the next state, and the reason, for each state and event.

docs/task_states.md is generated from it.
"""
from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from typing import NamedTuple

from uav_task_alloc.allocator.records import ENDED_STATES, OPEN_STATES, TaskState


class TaskTransition(Enum):
    """Events of a task; the value is the text in the documentation."""

    ADD = 'announced'
    UPDATE = 'announced with new content'
    CANCEL = 'withdrawn'
    WAIT = 'no plan has considered it yet'
    LIST = 'in the list of a UAV'
    LEAVE = 'left out by a plan'
    START = 'STARTED by the UAV that has it'
    START_MOVED = 'STARTED by a UAV that had it'
    COMPLETE = 'COMPLETED by the UAV that has it'
    COMPLETE_MOVED = 'COMPLETED by a UAV that had it'
    REPLACE = 'cut into other pieces'
    FAIL = 'FAILED on the UAV that has it, others may try'
    FAIL_LAST = 'FAILED too often, or on all UAVs that can'
    FAIL_MOVED = 'FAILED on a UAV that had it'


class Rule(NamedTuple):
    """Effect of an event: the next state, or None where the event changes nothing."""

    state: TaskState | None
    reason: str  # of the state, or why nothing changes; {uav} and {why} are of the event


class TaskStep(NamedTuple):
    """An event for a task."""

    task_id: str  # of an accepted task
    event: TaskTransition  # row of TASK_TRANSITIONS
    uav: str = ''  # that has or had the task; '': none
    why: str = ''  # reason of the new state


TransitionRow = dict[TaskState, Rule]
_S, _E = TaskState, TaskTransition


def _on(states: Iterable[TaskState], state: TaskState | None, reason: str) -> TransitionRow:
    return dict.fromkeys(states, Rule(state, reason))


def _on_open(state: TaskState | None, reason: str) -> TransitionRow:
    """Of an event that only an open task allows."""
    return {_S.COMPLETED: Rule(None, 'it is COMPLETED already'),
            _S.FAILED: Rule(None, 'it is FAILED already'),
            _S.CANCELLED: Rule(None, 'it was cancelled'),
            _S.REJECTED: Rule(None, _UNKNOWN), **_on(OPEN_STATES, state, reason)}


def _on_open_or_failed(state: TaskState, reason: str) -> TransitionRow:
    return {**_on_open(state, reason), _S.FAILED: Rule(state, reason)}


_UNKNOWN, _MOVED = 'unknown task', '{uav} does not have it any more'
TASK_TRANSITIONS: dict[TaskTransition, TransitionRow] = {
    _E.ADD: {
        **_on({*OPEN_STATES, *ENDED_STATES}, None, 'announced before'),
        _S.REJECTED: Rule(_S.PENDING, 'waits for the next plan'),
    },
    _E.UPDATE: {
        **{state: Rule(state, '{why}') for state in OPEN_STATES},
        _S.FAILED: Rule(_S.PENDING, 'changed: tried again'),
        _S.COMPLETED: Rule(None, 'is COMPLETED: nothing to update'),
        _S.CANCELLED: Rule(None, 'is CANCELLED: nothing to update'),
        _S.REJECTED: Rule(None, f'{_UNKNOWN}: nothing to update'),
    },
    _E.CANCEL: {
        **_on({*OPEN_STATES, _S.FAILED}, _S.CANCELLED, 'cancelled'),
        _S.COMPLETED: Rule(None, 'is COMPLETED: nothing to cancel'),
        _S.CANCELLED: Rule(None, 'cancelled before'),
        _S.REJECTED: Rule(None, f'{_UNKNOWN}: nothing to cancel'),
    },
    _E.WAIT: _on_open(_S.PENDING, '{why}'),
    _E.LIST: _on_open(_S.ASSIGNED, '{why}'),
    _E.LEAVE: _on_open(_S.UNASSIGNED, '{why}'),
    _E.START: _on_open(_S.ACTIVE, '{why}'),
    _E.START_MOVED: _on_open(None, _MOVED),
    # accepted from any UAV, so that the task is not flown twice
    _E.COMPLETE: _on_open_or_failed(_S.COMPLETED, '{why}'),
    _E.COMPLETE_MOVED: _on_open_or_failed(_S.COMPLETED, 'completed after it was moved'),
    _E.REPLACE: _on_open_or_failed(_S.CANCELLED, 'cut again: {why}'),
    _E.FAIL: _on_open(_S.PENDING, 'failed on {uav}: {why}'),
    _E.FAIL_LAST: _on_open(_S.FAILED, 'failed on {uav}: {why}'),
    _E.FAIL_MOVED: _on_open(None, _MOVED),
}


def rule_for(state: TaskState, event: TaskTransition, uav: str = '', why: str = '') -> Rule:
    """Return the effect of an event on a task, with the reason filled in.

    Args:
        state: of the task; REJECTED for one that was never accepted.
        event: what happened.
        uav: that the event is about.
        why: reason of the event.
    """
    rule = TASK_TRANSITIONS[event][state]
    # not str.format: the reason of a message may contain braces
    return rule._replace(reason=rule.reason.replace('{uav}', uav).replace('{why}', why))


def task_states_markdown() -> str:
    """Return docs/task_states.md: the table and a diagram.

    Returns:
        Markdown with a mermaid state diagram.
    """
    parts = ['# Task states\n\nGenerated from '
             '`uav_task_alloc/allocator/state/task_state_machine.py`. A cell has '
             'the next state, or in brackets why the event changes nothing.\n\n']
    parts += [f'| event | {" | ".join(state.name for state in TaskState)} |\n',
              '|---' * (len(TaskState) + 1) + '|\n']
    for event, row in TASK_TRANSITIONS.items():
        cells = [rule.state.name if rule.state else f'({rule.reason})'
                 for rule in map(row.__getitem__, TaskState)]
        parts.append(f'| {event.value} | {" | ".join(cells)} |\n')
    arrows = {(state.name, rule.state.name) for row in TASK_TRANSITIONS.values()
              for state, rule in row.items() if rule.state and rule.state is not state}
    lines = ''.join(f'  {a} --> {b}\n' for a, b in sorted(arrows))
    return ''.join(parts) + f'\n```mermaid\nstateDiagram-v2\n{lines}```\n'
