# SPDX-License-Identifier: Apache-2.0
"""TaskAnnouncement messages: valid tasks go to the world, invalid ones are refused by name."""
from __future__ import annotations

from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SubmitTasks

from uav_task_alloc.allocator.records import AnnouncementAction, TaskVerdict
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.checks import check_count, check_member, check_ros_name
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Task
from uav_task_alloc.nodes.conversions.message_limits import MOST_TASKS, cut
from uav_task_alloc.nodes.conversions.messages import to_task
from uav_task_alloc.nodes.conversions.work_fields import (
    number_or_zero,
    to_angle,
    to_kind,
    to_path,
    to_vertical,
)
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.values import MOST_HOLES, Kind, Vertical

_MOST_REFUSED = 20  # tasks that are named where a whole message is refused
_ANY_ORIGIN = Origin(0.0, 0.0, 0.0)  # tasks in LOCAL do not depend on it


def announce(world: World, msg: m.TaskAnnouncement, origin: Origin, stamp: float,
             now: float) -> list[TaskVerdict]:
    """Add, update or cancel the tasks of a message.

    Args:
        world: which takes the valid ones.
        msg: from any publisher, not yet checked.
        origin: of the ENU frame, for tasks in WGS84.
        stamp, now: the published and the steady clock [s].

    Returns:
        A verdict for each task. Where the whole message is refused, for its action or its number
        of tasks, for the first 20 of them, with how many more there are.
    """
    def refuse(task: m.Task, why: str) -> TaskVerdict:
        return world.refuse(cut(task.task_id), why, stamp)

    try:
        action = to_action(msg)
    except InvalidValue as error:
        more = len(msg.tasks) - _MOST_REFUSED
        why = str(error) + (f'; refused with {more} more tasks of the message' if more > 0 else '')
        return [refuse(task, why) for task in msg.tasks[:_MOST_REFUSED]]
    tasks: list[Task | Work] = []
    task_ids: list[str] = []
    refused: list[TaskVerdict] = []
    for task in msg.tasks:
        try:
            if action is AnnouncementAction.CANCEL:
                task_ids.append(check_ros_name('task_id', task.task_id))
            else:
                tasks.append(to_work(task, origin))
        except InvalidValue as error:
            refused.append(refuse(task, str(error)))
    if action is AnnouncementAction.CANCEL:
        return world.cancel(task_ids, stamp, now) + refused
    return world.announce(action, tasks, stamp, now) + refused


def to_action(msg: m.TaskAnnouncement) -> AnnouncementAction:
    """Raise InvalidValue for an unknown action, or for more than MOST_TASKS tasks."""
    action = check_member('action', msg.action, AnnouncementAction)
    check_count('tasks', msg.tasks, MOST_TASKS)
    return action


def is_in_wgs84(msg: m.TaskAnnouncement) -> bool:
    """Return whether an announcement has places that depend on the origin.

    Args:
        msg: not yet checked.

    Returns:
        False where it cancels tasks.
    """
    return msg.action != m.TaskAnnouncement.CANCEL and any(
        task.frame == m.Task.WGS84 for task in msg.tasks)


def valid_tasks(msg: m.TaskAnnouncement, origin: Origin | None) -> m.TaskAnnouncement:
    """Return an announcement without the tasks that the allocator refuses by their fields.

    Args:
        msg: from any publisher, not yet checked.
        origin: of the ENU frame; None: no task is in WGS84, see `is_in_wgs84`.

    Returns:
        Another message with the same action.

    Raises:
        InvalidValue: the action is unknown, or there are too many tasks.
    """
    if to_action(msg) is AnnouncementAction.CANCEL:
        return msg

    def is_valid(task: m.Task) -> bool:
        try:
            to_work(task, origin or _ANY_ORIGIN)
        except InvalidValue:
            return False
        return True

    return m.TaskAnnouncement(header=msg.header, action=msg.action,
                              tasks=list(filter(is_valid, msg.tasks)))


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


def to_work(msg: m.Task, origin: Origin) -> Task | Work:
    """Return what a message announces.

    Args:
        msg: from any publisher, not yet checked; of any kind and frame.
        origin: of the ENU frame.

    Returns:
        A task for a POINT above the origin, else work; in ENU, z above the ground where `vertical`
        is TERRAIN.

    Raises:
        InvalidValue: a field, which it names, is invalid.
    """
    check_ros_name('task_id', msg.task_id)  # the other errors have it in full
    kind = to_kind(msg)
    place = f'task {msg.task_id}: '
    vertical = to_vertical(msg)
    check_count(place + 'holes', msg.holes, MOST_HOLES)
    path = to_path(place + 'path', msg, msg.path, origin)
    along = path and kind in (Kind.LINE, Kind.AREA)
    work = Work(
        to_task(msg, origin, path[0] if along else None), kind, path,
        tuple(to_path(f'{place}holes[{k}]', msg, ring.points, origin)
              for k, ring in enumerate(msg.holes)),
        number_or_zero(msg.strip_width), to_angle(place + 'direction', msg.direction),
        number_or_zero(msg.radius), number_or_zero(msg.turns), msg.divisible,
        vertical)
    if kind is Kind.POINT and vertical is Vertical.ORIGIN:
        return work.task
    return work
