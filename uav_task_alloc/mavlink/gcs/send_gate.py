# SPDX-License-Identifier: Apache-2.0
"""The one way out to a vehicle: a message is sent only where authority allows its kind."""
from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import SendAction
from uav_task_alloc.mavlink.gcs.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.mission.peer import ACCEPTED
from uav_task_alloc.mavlink.transport.codec import Message

_READS = {d.MAV_CMD_SET_MESSAGE_INTERVAL, d.MAV_CMD_REQUEST_MESSAGE}
_READING = {'MISSION_REQUEST_LIST', 'MISSION_REQUEST_INT', 'MISSION_REQUEST'}
_UPLOADING = {'MISSION_COUNT', 'MISSION_ITEM_INT'}


def action_of(message: Message) -> SendAction:
    """What a message does to a vehicle; whatever is not known here counts as a command."""
    kind = message.get_type()
    if kind in _READING or (kind == 'MISSION_ACK' and message.type == ACCEPTED) or (
            kind == 'COMMAND_LONG' and message.command in _READS):
        return SendAction.READ
    return SendAction.UPLOAD if kind in _UPLOADING or kind == 'MISSION_ACK' else SendAction.COMMAND


def allowed_messages(messages: list[Message], watch: AuthorityWatch, now: float) -> list[Message]:
    """Those that may be sent now; the watch writes commands down before they are."""
    out = []
    for message in messages:
        action = action_of(message)
        if watch.authority.allows(action):
            if action is SendAction.COMMAND:
                watch.record_command(message, now)
            out.append(message)
    return out
