# SPDX-License-Identifier: Apache-2.0
"""Messages that the allocator publishes: lists, statuses and the allocation."""
from __future__ import annotations

from collections.abc import Iterable

from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import Allocation
from uav_task_alloc.allocator.status import TaskStatus
from uav_task_alloc.nodes.conversions.messages import (
    header,
    planned_task,
    to_duration,
    to_point,
    to_stamp,
)
from uav_task_alloc.nodes.conversions.task_times import from_expected
from uav_task_alloc.piece_ids import split_piece

_UNASSIGNED = (m.TaskStatus.PENDING, m.TaskStatus.UNASSIGNED)


def from_list(uav_list: UavList) -> m.TaskList:
    """Return the list of one UAV as a message.

    Args:
        uav_list: with its stops; times in s, lengths in m.

    Returns:
        For the topic `<uav_id>/task_list`.
    """
    return m.TaskList(
        header=header(uav_list.stamp), uav_id=uav_list.uav, revision=uav_list.revision,
        tasks=[planned_task(stop) for stop in uav_list.stops],
        end=m.TaskList.RETURN_HOME if uav_list.returns else m.TaskList.HOLD,
        end_via=[to_point(point) for point in uav_list.end_via],
        distance=float(uav_list.distance))


def from_statuses(statuses: list[m.TaskStatus], now: float) -> m.TaskStatusArray:
    """Return the statuses of all tasks as one message.

    Args:
        statuses: of all tasks.
        now: [s] for the stamp.

    Returns:
        For the topic `task_statuses`.
    """
    return m.TaskStatusArray(header=header(now), statuses=statuses)


def from_task_status(status: TaskStatus) -> m.TaskStatus:
    """Return the status of one task as a message.

    Args:
        status: of an accepted or refused task.

    Returns:
        An entry of TaskStatusArray or of Allocation.unassigned.
    """
    task_id, piece = split_piece(status.task_id)
    return m.TaskStatus(task_id=task_id, piece=piece, pieces_done=status.pieces_done,
                        pieces=status.pieces, state=status.state.value, uav_id=status.uav,
                        reason=status.reason, stamp=to_stamp(status.stamp),
                        expected=from_expected(status.expected))


def from_allocation(allocation: Allocation, lists: list[m.TaskList],
                    statuses: Iterable[m.TaskStatus]) -> m.Allocation:
    """Return the plan in force as a message.

    Args:
        allocation: the plan with its revision and trigger.
        lists: its lists as messages, one for each UAV.
        statuses: of all tasks; those without a UAV are in the message.

    Returns:
        For the topic `allocation`.
    """
    plan = allocation.plan
    return m.Allocation(
        header=header(allocation.stamp), revision=allocation.revision,
        lists=lists, unassigned=[s for s in statuses if s.state in _UNASSIGNED],
        fit=float(plan.fit), distance=float(plan.distance), value=float(plan.value),
        penalty=float(plan.penalty),
        solve_time=to_duration(plan.solve_time), iterations=int(plan.iterations),
        warm_started=plan.warm_started, trigger=allocation.trigger)
