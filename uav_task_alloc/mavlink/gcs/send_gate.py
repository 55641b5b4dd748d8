# SPDX-License-Identifier: Apache-2.0
"""Drops messages that the authority over a vehicle does not allow; nothing is sent past it."""
from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import SendAction
from uav_task_alloc.mavlink.gcs.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.transport.codec import Message

_READS = {d.MAV_CMD_SET_MESSAGE_INTERVAL, d.MAV_CMD_REQUEST_MESSAGE}
_READING = {'MISSION_REQUEST_LIST', 'MISSION_REQUEST_INT', 'MISSION_REQUEST',
            'PARAM_REQUEST_READ'}
_UPLOADING = {'MISSION_COUNT', 'MISSION_ITEM_INT'}


def action_of(message: Message) -> SendAction:
    """Classify a message to a vehicle; one that is not known here counts as a command."""
    kind = message.get_type()
    if kind in _READING or (kind == 'MISSION_ACK' and message.type == d.MAV_MISSION_ACCEPTED) or (
            kind == 'COMMAND_LONG' and message.command in _READS):
        return SendAction.READ
    clears_fence = kind == 'MISSION_CLEAR_ALL' and (  # or rally points
        message.mission_type in (d.MAV_MISSION_TYPE_FENCE, d.MAV_MISSION_TYPE_RALLY))
    uploads = kind in _UPLOADING or kind == 'MISSION_ACK' or clears_fence
    return SendAction.UPLOAD if uploads else SendAction.COMMAND


def allowed_messages(messages: list[Message], watch: AuthorityWatch, now: float) -> list[Message]:
    """Select the messages that may be sent now.

    Args:
        messages: to one vehicle, in order.
        watch: the authority over it; commands are recorded there before they are sent.
        now: steady time [s].

    Returns:
        Those that may be sent, in order; the others are dropped.
    """
    if not messages:
        return messages
    allowed = []
    for message in messages:
        action = action_of(message)
        if watch.authority.allows(action):
            if action is SendAction.COMMAND:
                watch.record_command(message, now)
            elif message.get_type() == 'MISSION_COUNT':
                watch.record_upload()
            allowed.append(message)
    return allowed
