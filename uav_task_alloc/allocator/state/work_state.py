# SPDX-License-Identifier: Apache-2.0
"""The state of work as a whole, as its pieces have it: state, UAV, progress and reason."""
from __future__ import annotations

from collections.abc import Iterable, Sequence

from uav_task_alloc.allocator.records import TaskRecord, TaskState
from uav_task_alloc.allocator.work_records import WorkRecord
from uav_task_alloc.work.values import Kind

# the state of the whole is the first of these that a piece has
_ORDER = (TaskState.ACTIVE, TaskState.ASSIGNED, TaskState.PENDING, TaskState.UNASSIGNED,
          TaskState.CANCELLED, TaskState.FAILED)
_WORDS = {Kind.AREA: 'strips', Kind.LINE: 'sections', Kind.ORBIT: 'orbits'}


def state_of_pieces(pieces: Iterable[TaskRecord]) -> TaskState:
    """Return the state of work.

    Args:
        pieces: of it; all are completed where there are none.
    """
    states = {record.state for record in pieces}
    return next((state for state in _ORDER if state in states), TaskState.COMPLETED)


def record_of_whole(work: WorkRecord, pieces: Sequence[TaskRecord]) -> tuple[TaskRecord, int]:
    """Return work as the record of one task, and how many of its pieces are completed.

    Args:
        work: accepted.
        pieces: of it.

    Returns:
        Its reason begins with `7 of 12 strips`; the UAV is that of its pieces in this state,
        where it is one.
    """
    state = state_of_pieces(pieces)
    done = sum(record.state is TaskState.COMPLETED for record in pieces)
    of_state = [record for record in pieces if record.state is state]
    uavs = {record.uav for record in of_state}
    why = next((record.reason for record in of_state if record.reason), '')
    text = f'{done} of {len(pieces)} {_WORDS.get(work.work.kind, "pieces")}'
    return TaskRecord(
        work.work.task, work.announced.task, state, uavs.pop() if len(uavs) == 1 else '',
        text if state is TaskState.COMPLETED or not why else f'{text}; {why}',
        max((record.stamp for record in pieces), default=0.0),
        since=min((record.since for record in pieces), default=0.0)), done
