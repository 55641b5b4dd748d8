# SPDX-License-Identifier: Apache-2.0
"""The learned state of the solver as a row of the journal, bounded in size, and back."""
from __future__ import annotations

import base64
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from uav_task_alloc.journal import JournalRow

if TYPE_CHECKING:  # imports the compiler, which would delay the start
    from uav_task_alloc.solver.warm import WarmState

_MAX_ENTRIES = 200_000  # of a table; 5000 tasks with 24 neighbours are 120 000


def learned_row(state: object) -> JournalRow:
    """Return the learned tables of a plan's state as a row.

    The table of UAVs is left out where it has more than 200 000 entries; without a body where
    the table of tasks has.

    Args:
        state: `Plan.state`; anything but that of chain_q has no tables.

    Returns:
        Tables as base64 texts: indices int32, values float32, little endian.
    """
    from uav_task_alloc.solver.tables import Learnt
    learnt = getattr(state, 'learnt', None)
    if not isinstance(learnt, Learnt) or learnt.near.size > _MAX_ENTRIES:
        return JournalRow('learner', '', None)
    starts, near = learnt.tables.start, learnt.near - len(learnt.uavs)  # indices of tasks from 0
    uavs = sorted(learnt.uavs, key=learnt.uavs.__getitem__) if starts.size <= _MAX_ENTRIES else []
    return JournalRow('learner', '', {
        'uavs': uavs, 'tasks': sorted(learnt.tasks, key=learnt.tasks.__getitem__),
        'near': _packed(near, '<i4'), 'task': _packed(learnt.tables.task, '<f4'),
        'start': _packed(starts[:len(uavs)], '<f4')})


def learned_state(body: Any) -> WarmState:
    """Return the state of a row; an empty one where the row is missing or invalid.

    Args:
        body: as `learned_row` makes it, after JSON.

    Returns:
        For a warm start of `plan`.
    """
    from uav_task_alloc.solver.warm import WarmState
    try:
        return WarmState(learnt=_tables(body))
    except (LookupError, TypeError, ValueError, AttributeError):
        return WarmState()


def _tables(body: Any) -> object:
    from uav_task_alloc.solver.routes import NODE
    from uav_task_alloc.solver.tables import Learnt, Tables
    uavs, tasks = body['uavs'], body['tasks']
    n, m = len(tasks), len(uavs)
    near = _unpacked(body['near'], '<i4').reshape(n, -1).astype(np.int64)
    if near.size and not 0 <= near.min() <= near.max() < n:
        raise ValueError(f'learner: near up to {near.max()}: expected indices of {n} tasks')
    tables = Tables(_unpacked(body['task'], '<f4').reshape(near.shape).astype(float),
                    _unpacked(body['start'], '<f4').reshape(m, n).astype(float))
    if not (np.isfinite(tables.task).all() and np.isfinite(tables.start).all()):
        raise ValueError('learner: expected finite numbers')
    return Learnt(tables, (near + m).astype(NODE), {uav_id: i for i, uav_id in enumerate(uavs)},
                  {task_id: i for i, task_id in enumerate(tasks)})


def _packed(values: Any, kind: str) -> str:
    return base64.b64encode(zlib.compress(np.asarray(values, kind).tobytes(), 1)).decode()


def _unpacked(text: str, kind: str) -> Any:
    try:
        return np.frombuffer(zlib.decompress(base64.b64decode(text)), kind)
    except zlib.error as error:
        raise ValueError(f'learner: {error}') from error
