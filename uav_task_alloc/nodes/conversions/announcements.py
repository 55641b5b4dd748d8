# SPDX-License-Identifier: Apache-2.0
"""Announcements taken apart: good tasks and zones to the world, bad ones refused by name."""
from __future__ import annotations

from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SubmitTasks

from uav_task_alloc.allocator.records import AnnouncementAction, TaskVerdict
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import check_count, check_ros_name
from uav_task_alloc.nodes.conversions.message_limits import (
    MOST_TASKS,
    cut,
)
from uav_task_alloc.nodes.conversions.messages import to_task


def take(world: World, msg: m.TaskAnnouncement, origin: Origin, stamp: float,
         now: float) -> list[TaskVerdict]:
    """Tell the world of every task; a verdict for each."""
    try:
        action = AnnouncementAction(msg.action)
        check_count('tasks', msg.tasks, MOST_TASKS)
    except InvalidValue as error:
        return _refuse_all(world, msg, str(error), stamp)
    except ValueError:
        reason = f'action = {msg.action}: expected ADD (0), UPDATE (1) or CANCEL (2)'
        return _refuse_all(world, msg, reason, stamp)
    good, verdicts = [], []
    for task in msg.tasks:
        try:
            good.append(
                check_ros_name('task_id', task.task_id)
                if action is AnnouncementAction.CANCEL
                else to_task(task, origin)
            )
        except InvalidValue as error:
            verdicts.append(world.refuse(cut(task.task_id), str(error), stamp))
    if action is AnnouncementAction.CANCEL:
        return world.cancel(good, stamp, now) + verdicts
    return world.announce(action, good, stamp, now) + verdicts


def _refuse_all(world: World, msg: m.TaskAnnouncement, reason: str,
                stamp: float) -> list[TaskVerdict]:
    return [world.refuse(cut(task.task_id), reason, stamp) for task in msg.tasks[:MOST_TASKS]]


def answer(verdicts: list[TaskVerdict], response: SubmitTasks.Response) -> SubmitTasks.Response:
    """Verdicts as a service tells them. A caller who repeats himself is told so."""
    for verdict in verdicts:
        if verdict.accepted and not verdict.unchanged:
            response.accepted.append(verdict.task_id)
        else:
            response.rejected.append(verdict.task_id)
            response.reasons.append(verdict.reason)
    return response
