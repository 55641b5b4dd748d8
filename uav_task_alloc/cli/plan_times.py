# SPDX-License-Identifier: Apache-2.0
"""The times of a plan as a table and as JSON values."""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from uav_task_alloc.model import Plan, Task, Uav, turned_tasks
from uav_task_alloc.objective import check_objective, needs_time
from uav_task_alloc.scenario.values import Scenario

_HEAD = 'task', 'uav', 'trip', 'arrival', 'wait', 'start', 'end', 'window', 'late'


def has_times(loaded: Scenario) -> bool:
    """Whether times, loads or trips of a scenario can change its plan."""
    return needs_time([uav.uav for uav in loaded.uavs], [timed.task for timed in loaded.tasks],
                      check_objective(loaded.objective or 'distance'), loaded.trips)


def times_text(uavs: Sequence[Uav], tasks: Sequence[Task], result: Plan) -> str:
    """A table of the tasks served [s], by UAV in the order of the routes.

    Args:
        uavs: all UAVs of the plan.
        tasks: all tasks of the plan.
        result: the plan.

    Returns:
        Lines of text, the first of them the head.
    """
    from uav_task_alloc.geometry.flight_time import service_seconds  # imports numba
    known = {task.id: task for task in turned_tasks(tasks, result.reversed)}
    fleet, times = {uav.id: uav for uav in uavs}, result.timetable()
    rows = [_HEAD]
    for uav, trips in times.trips.items():
        for number, trip in enumerate(trips, 1):
            rows += [(name, uav, str(number), _seconds(times.arrivals[name]),
                      _seconds(result.waits[name]), _seconds(times.starts[name]),
                      _seconds(times.starts[name] + service_seconds(fleet[uav], known[name])),
                      _window(known[name]), _seconds(times.late.get(name, 0.0))) for name in trip]
        takeoffs = ', '.join(map(_seconds, times.departures[uav]))
        rows.append(('', uav, '', '', '', '', _seconds(times.ends[uav]),
                     f'departs at {takeoffs}', ''))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    left = {0, 1, 7}  # columns of text
    return '\n'.join('  '.join(
        cell.ljust(width) if i in left else cell.rjust(width)
        for i, (cell, width) in enumerate(zip(row, widths, strict=True))).rstrip()
        for row in rows)


def times_json(result: Plan) -> dict[str, Any]:
    """The times of a plan as JSON values [s], by task or UAV."""
    times = result.timetable()
    return {'arrivals': dict(times.arrivals), 'waits': result.waits,
            'trips': {uav: [list(row) for row in rows] for uav, rows in times.trips.items()},
            'departures': {uav: list(row) for uav, row in times.departures.items()},
            'ends': dict(times.ends), 'late': dict(times.late), 'finish': result.finish,
            'response': result.response}


def _seconds(value: float) -> str:
    return f'{value:.1f}'


def _window(task: Task) -> str:
    """`[60.0, 90.5]`; empty where there is none."""
    if task.earliest <= 0.0 and math.isinf(task.latest):
        return ''
    last = 'inf' if math.isinf(task.latest) else _seconds(task.latest)
    return f'[{_seconds(max(0.0, task.earliest))}, {last}]'
