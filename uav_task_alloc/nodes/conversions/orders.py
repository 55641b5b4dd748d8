# SPDX-License-Identifier: Apache-2.0
"""Requests of operators to values of the core; its answers, holds and proposals to messages."""
from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, TypeVar

from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator.order_records import OperatorHold
from uav_task_alloc.allocator.order_requests import OrderAction, OrderAnswer, OrderRequest
from uav_task_alloc.allocator.records import Allocation, Proposal
from uav_task_alloc.checks import check_count, check_ros_name
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.gcs.ground_station import OPERATOR
from uav_task_alloc.mavlink.gcs.operator_hold import HoldRequest
from uav_task_alloc.model import Plan
from uav_task_alloc.nodes.conversions.allocation_messages import from_allocation, from_list
from uav_task_alloc.nodes.conversions.message_limits import MOST_TASKS, cut
from uav_task_alloc.nodes.conversions.messages import header, to_duration, to_stamp
from uav_task_alloc.record.message_records import from_stamp
from uav_task_alloc.separation.monitor import SeparationAlert, SeparationHold

_Response = TypeVar('_Response')
_SOURCES = {m.UavHold.OPERATOR: OPERATOR, m.UavHold.SEPARATION: 'separation'}
SEPARATION_HOLD = 60.0  # [s] of a hold to keep UAVs separate


def to_order_request(action: OrderAction, msg: Any) -> OrderRequest:
    """Return the request of an operator.

    Args:
        action: that the service is for.
        msg: its request, from any client, not yet checked.

    Returns:
        Without the fields that the service does not have.

    Raises:
        InvalidValue: a field, which it names, is invalid.
    """
    uav_id, tasks = getattr(msg, 'uav_id', ''), getattr(msg, 'task_ids', None)
    if uav_id or action not in (OrderAction.RETURN, OrderAction.UNDO):
        check_ros_name('uav_id', uav_id)
    if tasks is None:
        tasks = [msg.task_id] if hasattr(msg, 'task_id') else []
    check_count('task_ids', tasks, MOST_TASKS)
    return OrderRequest(
        action, uav_id, tuple(check_ros_name('task_id', task_id) for task_id in tasks),
        getattr(msg, 'clear', False), getattr(msg, 'keep_tasks', False),
        cut(getattr(msg, 'order_id', '')), to_operator(msg), msg.dry_run, msg.revision)


def to_operator(msg: Any) -> str:
    """Return who gives an order, for the log.

    Args:
        msg: request with `operator_name`.

    Returns:
        One line; `unnamed` where it is empty.
    """
    return cut(msg.operator_name).strip() or 'unnamed'


def from_order_answer(answer: OrderAnswer, response: _Response) -> _Response:
    """Fill the response of a service for orders.

    Args:
        answer: of the core.
        response: empty; is changed.

    Returns:
        The same response.
    """
    fields = {'success': answer.success, 'message': answer.message, 'order_id': answer.order_id,
              'extra_distance': answer.distance, 'extra_finish': answer.finish,
              'late': list(answer.late)}
    for name, value in fields.items():
        setattr(response, name, value)
    return response


def from_hold(hold: OperatorHold) -> m.UavHold:
    """Return the message of a hold.

    Args:
        hold: of an operator.

    Returns:
        It never expires.
    """
    return m.UavHold(header=header(hold.stamp), uav_id=hold.uav, hold=hold.hold,
                     source=m.UavHold.OPERATOR, reason=hold.reason)


def from_separation_hold(hold: SeparationHold) -> m.UavHold:
    """Return the message of a hold that keeps UAVs apart.

    Args:
        hold: of the monitor.

    Returns:
        It expires within 60 s.
    """
    return m.UavHold(header=header(hold.stamp), uav_id=hold.uav, hold=hold.hold,
                     source=m.UavHold.SEPARATION, expires=to_stamp(hold.expires),
                     reason=hold.reason)


def from_separation_alert(alert: SeparationAlert) -> m.SeparationAlert:
    """Return the message of an alert.

    Args:
        alert: of the monitor.

    Returns:
        For the topic `separation_alerts`; NaN where nothing is predicted.
    """
    near = alert.horizontal < math.inf
    return m.SeparationAlert(
        header=header(alert.stamp), uavs=list(alert.uavs),
        horizontal=alert.horizontal if near else math.nan,
        vertical=alert.vertical if near else math.nan, until=to_duration(alert.until),
        action=alert.action.value, holder=alert.holder, reason=alert.reason)


def from_proposal(proposal: Proposal) -> m.PlanProposal:
    """Return the message of a plan that waits for approval, or of one that does no longer.

    Args:
        proposal: without lists where it is closed.

    Returns:
        For the topic `plan_proposal`; its lists have no revision yet, and the stamp of the
        proposal, from which their times count.
    """
    lists = tuple(replace(each, stamp=proposal.stamp) for each in proposal.lists)
    plan = Plan({each.uav: each.task_ids for each in lists},
                distance=math.fsum(each.distance for each in lists),
                value=math.fsum(stop.task.value for each in lists for stop in each.stops))
    allocation = Allocation(proposal.revision, lists, plan, proposal.trigger, proposal.stamp)
    return m.PlanProposal(
        plan=from_allocation(allocation, [from_list(each) for each in lists], ()),
        base_revision=proposal.base_revision, deadline=to_stamp(proposal.deadline),
        accepted_on_timeout=proposal.accepted_on_timeout, changes=list(proposal.changes))


def to_hold_request(msg: m.UavHold, uav_id: str) -> HoldRequest:
    """Return the hold of a message, or its end.

    Args:
        msg: from any publisher, not yet checked.
        uav_id: of the topic it came on.

    Returns:
        With the reason cut to one line.

    Raises:
        InvalidValue: a field, which it names, is invalid.
    """
    if msg.uav_id not in ('', uav_id):
        raise InvalidValue('uav_id', msg.uav_id, uav_id)
    if msg.source not in _SOURCES:
        raise InvalidValue('source', msg.source, 'OPERATOR (0) or SEPARATION (1)')
    return HoldRequest(_SOURCES[msg.source], msg.hold, cut(msg.reason) or 'no reason given')


def hold_expiry(msg: m.UavHold, now: float) -> float:
    """Return when a hold ends without another message.

    Args:
        msg: a hold.
        now: the published clock [s].

    Returns:
        [s] of the published clock; inf: never. One to keep UAVs separate ends after 60 s at most.
    """
    expires = from_stamp(msg.expires) or math.inf
    return min(expires, now + SEPARATION_HOLD) if msg.source == m.UavHold.SEPARATION else expires
