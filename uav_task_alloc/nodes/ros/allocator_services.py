# SPDX-License-Identifier: Apache-2.0
"""The services of an allocator for tasks, plans and availability; those for orders are apart."""
from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.service import Service
from std_srvs.srv import Trigger
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SetAvailability, SubmitTasks

from uav_task_alloc.allocator.records import TaskVerdict
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.errors import counted
from uav_task_alloc.nodes.conversions import announcements


class AllocatorServices:
    """Answers requests; what is accepted is saved before the response.

    Args:
        node: offers the services.
        world: of the allocator.
        announce: takes an announcement; returns a verdict for each of its tasks.
        save: writes the world to disk.
        conflict: returns why no lists are published; '': they are.

    Arguments of methods:
        request: from any client, not yet checked.
        response: empty; is filled and returned.
    """

    def __init__(self, node: Node, world: World,
                 announce: Callable[[m.TaskAnnouncement], list[TaskVerdict]],
                 save: Callable[[], None], conflict: Callable[[], str]) -> None:
        self._node, self._world, self._announce = node, world, announce
        self._save, self._conflict = save, conflict

    def offer(self) -> list[Service]:
        """Create the services."""
        create = self._node.create_service
        return [create(SubmitTasks, '~/submit_tasks', self.submit_tasks),
                create(Trigger, '~/replan', self.replan),
                create(Trigger, '~/forget_demand', self.forget_demand),
                create(SetAvailability, '~/set_availability', self.set_availability)]

    def submit_tasks(self, request: SubmitTasks.Request,
                     response: SubmitTasks.Response) -> SubmitTasks.Response:
        """Take an announcement."""
        verdicts = self._announce(request.announcement)
        self._save()
        return announcements.from_verdicts(verdicts, response)

    def replan(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Plan again without a change."""
        self._world.request_replan('replan service', time.monotonic())
        conflict = self._conflict()
        response.success = not conflict
        response.message = (f'nothing is planned: {conflict}' if conflict
                            else 'a new plan follows on `allocation`')
        return response

    def forget_demand(self, request: Trigger.Request,
                      response: Trigger.Response) -> Trigger.Response:
        """Forget where tasks were announced."""
        count = self._world.announced.seen.forget()
        self._save()
        response.success, response.message = True, f'{counted(count, "announcement")} forgotten'
        return response

    def set_availability(self, request: SetAvailability.Request,
                         response: SetAvailability.Response) -> SetAvailability.Response:
        """Set whether a UAV may be given tasks; persists until it is changed."""
        refusal = self._world.set_available(request.uav_id, request.available, time.monotonic())
        self._save()
        state = 'available' if request.available else 'not available'
        response.success = not refusal
        response.message = refusal or f'{request.uav_id} is {state}'
        return response
