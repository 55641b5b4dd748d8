# SPDX-License-Identifier: Apache-2.0
"""What the bees have learnt as a row of the journal, bounded in size, and back."""
from __future__ import annotations

import base64
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from uav_task_alloc.journal import JournalRow

if TYPE_CHECKING:  # it brings the compiler along, which a start must not wait for
    from uav_task_alloc.solver.warm import WarmState

_MOST = 200_000  # entries kept of a table; 5000 tasks with 24 neighbours are 120 000


def learner_row(state: object) -> JournalRow:
    """The tables of a plan's state, up to MOST entries each; the starts of UAVs are left out
    where they are more.
    """
    from uav_task_alloc.solver.tables import Learnt
    learnt = getattr(state, 'learnt', None)
    if not isinstance(learnt, Learnt) or learnt.near.size > _MOST:
        return JournalRow('learner', '', None)
    starts, near = learnt.tables.start, learnt.near - len(learnt.uavs)  # places of tasks from 0
    uavs = sorted(learnt.uavs, key=learnt.uavs.__getitem__) if starts.size <= _MOST else []
    return JournalRow('learner', '', {
        'uavs': uavs, 'tasks': sorted(learnt.tasks, key=learnt.tasks.__getitem__),
        'near': _packed(near, '<i4'), 'task': _packed(learnt.tables.task, '<f4'),
        'start': _packed(starts[:len(uavs)], '<f4')})


def learner(body: Any) -> WarmState:
    """The state of a row; an empty one where it is none: then the bees learn anew."""
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
        raise ValueError(f'learner: near up to {near.max()}: expected places of {n} tasks')
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
