# SPDX-License-Identifier: Apache-2.0
"""The services of an allocator for orders of operators, and the holds that it publishes.

What an order costs is solved in a thread of its own; other callbacks go on meanwhile.
"""
from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.service import Service
from rclpy.task import Future
from uav_task_alloc_msgs import msg as m, srv

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.operator_desk import OperatorDesk, OrderTrial
from uav_task_alloc.allocator.order_requests import (
    OrderAction,
    OrderAnswer,
    OrderRequest,
    refused,
)
from uav_task_alloc.allocator.records import Outbox
from uav_task_alloc.allocator.replanning.what_if import WhatIfAnswer, solve_what_if
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.nodes.conversions.messages import EVENTS, LATCHED
from uav_task_alloc.nodes.conversions.orders import (
    from_hold,
    from_order_answer,
    from_proposal,
    from_separation_alert,
    from_separation_hold,
    to_operator,
    to_order_request,
)
from uav_task_alloc.nodes.ros.topic_names import HOLD, check_topic
from uav_task_alloc.separation.monitor import MonitorStep

_SERVICES: dict[str, tuple[Any, OrderAction]] = {
    'pin_task': (srv.PinTask, OrderAction.PIN),
    'forbid_task': (srv.ForbidTask, OrderAction.FORBID),
    'order_tasks': (srv.OrderTasks, OrderAction.ORDER),
    'pause_uav': (srv.PauseUav, OrderAction.PAUSE),
    'resume_uav': (srv.ResumeUav, OrderAction.RESUME),
    'return_uav': (srv.ReturnUav, OrderAction.RETURN),
    'undo_order': (srv.UndoOrder, OrderAction.UNDO)}
# what takes effect by lists only
_NEEDS_LISTS = {OrderAction.PIN, OrderAction.FORBID, OrderAction.ORDER, OrderAction.RETURN}


class OrderServices:
    """Offers the services, one request at a time.

    Args:
        node: offers them, and publishes the holds.
        core: whose world orders change.
        save: writes the world to disk; called before each response.
        stamp: the published clock [s].
        conflict: returns why no lists are published; '': they are.
    """

    def __init__(self, node: Node, core: Allocator, save: Callable[[], None],
                 stamp: Callable[[], float], conflict: Callable[[], str]) -> None:
        self._node, self._world, self._save, self._stamp = node, core.world, save, stamp
        self._conflict = conflict
        self._desk = OperatorDesk(core)
        self._proposals = node.create_publisher(m.PlanProposal, 'plan_proposal', LATCHED)
        self._alerts = node.create_publisher(m.SeparationAlert, 'separation_alerts', EVENTS)
        self._holds: dict[str, Publisher[m.UavHold]] = {}  # of operators
        self._separation_holds: dict[str, Publisher[m.UavHold]] = {}
        self._thread = ThreadPoolExecutor(1, 'what_if')
        self._closing = False
        self._running: Future[None] | None = None  # the request that is being decided
        self._solved = node.create_guard_condition(lambda: None)  # wakes the executor

    def offer(self) -> list[Service]:
        """Create the services."""
        group = ReentrantCallbackGroup()  # a request waits for its solve
        services = [self._node.create_service(kind, f'~/{name}', self._callback(action),
                                              callback_group=group)
                    for name, (kind, action) in _SERVICES.items()]
        return [*services, self._node.create_service(
            srv.ApprovePlan, '~/approve_plan', self._on_approve, callback_group=group)]

    def separate(self, step: MonitorStep) -> None:
        """Publish the holds that keep UAVs apart, and alerts.

        They have topics of their own beside those of operators: of each the last one stays.

        Args:
            step: of the monitor.
        """
        for alert in step.alerts:
            self._alerts.publish(from_separation_alert(alert))
        for hold in step.holds:
            self._publish_hold(self._separation_holds, hold.uav, from_separation_hold(hold))

    def publish(self, outbox: Outbox) -> None:
        """Publish holds and proposals; each stays on its topic.

        Args:
            outbox: what the core wants published.
        """
        if outbox.proposal is not None:
            self._proposals.publish(from_proposal(outbox.proposal))
        for uav_id, hold in outbox.holds.items():
            self._publish_hold(self._holds, uav_id, from_hold(hold))

    def _publish_hold(self, publishers: dict[str, Publisher[m.UavHold]], uav_id: str,
                      msg: m.UavHold) -> None:
        """Publish a hold with the publisher of its source."""
        if uav_id not in publishers:
            try:
                topic = check_topic(self._node, HOLD, uav_id)
            except InvalidValue as error:
                self._node.get_logger().error(f'its hold is not published: {error}')
                return
            publishers[uav_id] = self._node.create_publisher(m.UavHold, topic, LATCHED)
        publishers[uav_id].publish(msg)

    def close(self) -> None:
        """End the thread and the topics."""
        self._closing = True
        self._thread.shutdown(wait=False, cancel_futures=True)
        for publishers in (self._holds, self._separation_holds):
            for publisher in publishers.values():
                self._node.destroy_publisher(publisher)
            publishers.clear()
        self._node.destroy_publisher(self._proposals)
        self._node.destroy_publisher(self._alerts)

    def _on_approve(self, msg: srv.ApprovePlan.Request,
                    response: srv.ApprovePlan.Response) -> srv.ApprovePlan.Response:
        conflict = self._conflict()
        answer = refused(f'nothing is planned: {conflict}') if conflict else self._desk.approve(
            msg.revision, msg.accept, to_operator(msg), msg.dry_run, time.monotonic(),
            self._stamp())
        self._save()
        word = 'accept' if msg.accept else 'reject'
        self._log_refusal(msg, f'{word} plan {msg.revision}', answer)
        return from_order_answer(answer, response)

    def _log_refusal(self, msg: Any, what: str, answer: OrderAnswer) -> None:
        if not answer.success:
            self._node.get_logger().warning(f'{to_operator(msg)}: {what} {answer.message}')

    def _callback(self, action: OrderAction) -> Callable[[Any, Any], Any]:
        async def respond(msg: Any, response: Any) -> Any:
            try:
                request = to_order_request(action, msg)
            except InvalidValue as error:
                answer = OrderAnswer(False, f'refused: {error}')
            else:
                conflict = self._conflict() if action in _NEEDS_LISTS else ''
                answer = (refused(f'nothing is planned: {conflict}') if conflict
                          else await self._decided(request))
            self._log_refusal(msg, action.value, answer)
            return from_order_answer(answer, response)
        return respond

    async def _decided(self, request: OrderRequest) -> OrderAnswer:
        """Decide a request once those before it are decided; it is on disk then."""
        while self._running is not None:
            await self._running
        done: Future[None] = Future()
        self._running = done
        try:
            answer = self._desk.open(request, time.monotonic(), self._stamp())
            if isinstance(answer, OrderTrial):
                solved = await self._solve(answer)
                answer = self._desk.close(answer, solved, time.monotonic(), self._stamp())
            self._save()
        finally:
            self._running = None
            done.set_result(None)
        return answer

    async def _solve(self, trial: OrderTrial) -> WhatIfAnswer | None:
        """Solve what an order asks for; None where that fails, which is logged."""
        done: Future[WhatIfAnswer | None] = Future()
        params = self._world.params

        def work() -> None:
            from uav_task_alloc.solver.solve import plan
            answer = None
            try:
                answer = solve_what_if(plan, trial.problem, params, lambda: self._closing,
                                       time.monotonic)
            except Exception as error:
                self._node.get_logger().error(f'dry run: {type(error).__name__}: {error}')
            done.set_result(answer)
            if not self._closing:
                self._solved.trigger()

        self._thread.submit(work)
        return await done
