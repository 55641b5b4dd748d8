# SPDX-License-Identifier: Apache-2.0
"""TaskAnnouncement messages: valid tasks go to the world, invalid ones are refused by name."""
from __future__ import annotations

from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SubmitTasks

from uav_task_alloc.allocator.records import AnnouncementAction, TaskVerdict
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.checks import check_count, check_ros_name
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Task
from uav_task_alloc.nodes.conversions.message_limits import MOST_TASKS, cut
from uav_task_alloc.nodes.conversions.messages import to_task


def announce(world: World, msg: m.TaskAnnouncement, origin: Origin, stamp: float,
             now: float) -> list[TaskVerdict]:
    """Add, update or cancel the tasks of a message.

    Args:
        world: which takes the valid ones.
        msg: from any publisher, not yet checked.
        origin: of the ENU frame, for tasks in WGS84.
        stamp, now: the published and the steady clock [s].

    Returns:
        A verdict for each task; for the first MOST_TASKS of a message with more than that.
    """
    def refuse(task: m.Task, error: InvalidValue) -> TaskVerdict:
        return world.refuse(cut(task.task_id), str(error), stamp)

    try:
        action = to_action(msg)
    except InvalidValue as error:
        return [refuse(task, error) for task in msg.tasks[:MOST_TASKS]]
    tasks: list[Task] = []
    task_ids: list[str] = []
    refused: list[TaskVerdict] = []
    for task in msg.tasks:
        try:
            if action is AnnouncementAction.CANCEL:
                task_ids.append(check_ros_name('task_id', task.task_id))
            else:
                tasks.append(to_task(task, origin))
        except InvalidValue as error:
            refused.append(refuse(task, error))
    if action is AnnouncementAction.CANCEL:
        return world.cancel(task_ids, stamp, now) + refused
    return world.announce(action, tasks, stamp, now) + refused


def to_action(msg: m.TaskAnnouncement) -> AnnouncementAction:
    """Raise InvalidValue for an unknown action, or for more than MOST_TASKS tasks."""
    try:
        action = AnnouncementAction(msg.action)
    except ValueError:
        raise InvalidValue('action', msg.action, 'ADD (0), UPDATE (1) or CANCEL (2)') from None
    check_count('tasks', msg.tasks, MOST_TASKS)
    return action


def from_verdicts(verdicts: list[TaskVerdict],
                  response: SubmitTasks.Response) -> SubmitTasks.Response:
    """Fill the response of `~/submit_tasks`; a task that is repeated unchanged is rejected.

    Args:
        verdicts: as `announce` returns them.
        response: empty; is changed.

    Returns:
        The same response.
    """
    for verdict in verdicts:
        if verdict.accepted and not verdict.unchanged:
            response.accepted.append(verdict.task_id)
        else:
            response.rejected.append(verdict.task_id)
            response.reasons.append(verdict.reason)
    return response
