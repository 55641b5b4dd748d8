# SPDX-License-Identifier: Apache-2.0
"""Announcements taken apart: good tasks and zones to the world, bad ones refused by name."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SubmitTasks

from uav_task_alloc.allocator.records import Action, Verdict
from uav_task_alloc.allocator.world import World
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.nodes.messages import to_task


def take(world: World, msg: m.TaskAnnouncement, origin: Origin, stamp: float,
         now: float) -> list[Verdict]:
    """Tell the world of every task; a verdict for each."""
    try:
        action = Action(msg.action)
    except ValueError:
        reason = f'action = {msg.action}: expected ADD (0), UPDATE (1) or CANCEL (2)'
        return [world.refuse(task.task_id, reason, stamp) for task in msg.tasks]
    if action is Action.CANCEL:
        return world.cancel([task.task_id for task in msg.tasks], stamp, now)
    good, verdicts = [], []
    for task in msg.tasks:
        try:
            good.append(to_task(task, origin))
        except InvalidValue as error:
            verdicts.append(world.refuse(task.task_id, str(error), stamp))
    return world.announce(action, good, stamp, now) + verdicts


def answer(verdicts: list[Verdict], response: SubmitTasks.Response) -> SubmitTasks.Response:
    """Verdicts as a service tells them. A caller who repeats himself is told so."""
    for verdict in verdicts:
        if verdict.accepted and not verdict.unchanged:
            response.accepted.append(verdict.task_id)
        else:
            response.rejected.append(verdict.task_id)
            response.reasons.append(verdict.reason)
    return response


def sort_zones(msg: m.ThreatZoneArray, to_zone: Callable[[m.ThreatZone], ThreatZone],
               ) -> tuple[list[ThreatZone], dict[str, str]]:
    """The good zones, and for each bad one its id and why."""
    good: dict[str, ThreatZone] = {}
    bad: dict[str, str] = {}
    for zone in msg.zones:
        try:
            if zone.zone_id in good:
                raise InvalidValue('zone_id', zone.zone_id, 'each id once')
            good[zone.zone_id] = to_zone(zone)
        except InvalidValue as error:
            bad[zone.zone_id] = str(error)
    return list(good.values()), bad
