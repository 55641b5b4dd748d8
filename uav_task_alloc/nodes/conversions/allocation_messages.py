# SPDX-License-Identifier: Apache-2.0
"""What the allocator tells, as messages: lists, statuses, the allocation, its health."""
from __future__ import annotations

from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator.records import Allocation, UavList
from uav_task_alloc.allocator.status import TaskStatus
from uav_task_alloc.nodes.conversions.messages import (
    header,
    planned_task,
    to_duration,
    to_point,
    to_stamp,
)

_LEFT_OUT = (m.TaskStatus.PENDING, m.TaskStatus.UNASSIGNED)


def from_list(uav_list: UavList) -> m.TaskList:
    """The list of one UAV."""
    return m.TaskList(
        header=header(uav_list.stamp), uav_id=uav_list.uav, revision=uav_list.revision,
        tasks=[planned_task(stop.task, stop.leg, stop.eta) for stop in uav_list.stops],
        end=m.TaskList.RETURN_HOME if uav_list.returns else m.TaskList.HOLD,
        end_via=[to_point(point) for point in uav_list.end_via],
        distance=float(uav_list.distance))


def from_statuses(statuses: list[m.TaskStatus], now: float) -> m.TaskStatusArray:
    """Where every task stands."""
    return m.TaskStatusArray(header=header(now), statuses=statuses)


def from_task_status(status: TaskStatus) -> m.TaskStatus:
    """Where one task stands."""
    return m.TaskStatus(task_id=status.task_id, state=status.state.value, uav_id=status.uav,
                        reason=status.reason, stamp=to_stamp(status.stamp))


def from_allocation(allocation: Allocation, lists: list[m.TaskList],
                    statuses: Iterable[m.TaskStatus]) -> m.Allocation:
    """The plan in force and what it leaves out."""
    plan = allocation.plan
    return m.Allocation(
        header=header(allocation.stamp), revision=allocation.revision,
        lists=lists, unassigned=[s for s in statuses if s.state in _LEFT_OUT],
        fit=float(plan.fit), distance=float(plan.distance), value=float(plan.value),
        penalty=float(plan.penalty),
        solve_time=to_duration(plan.solve_time), iterations=int(plan.iterations),
        warm_started=plan.warm_started, trigger=allocation.trigger)


def from_health(name: str, worries: list[str], facts: dict[str, object],
                now: float, stopped: bool = False) -> DiagnosticArray:
    """What an operator asks first. stopped: the worries are why it does nothing."""
    level = DiagnosticStatus.WARN if worries else DiagnosticStatus.OK
    level = DiagnosticStatus.ERROR if stopped else level
    values = [KeyValue(key=key, value=str(value)) for key, value in facts.items()]
    status = DiagnosticStatus(level=level, name=f'{name}: allocation', hardware_id='',
                              message='; '.join(worries) or 'running', values=values)
    return DiagnosticArray(header=header(now), status=[status])
