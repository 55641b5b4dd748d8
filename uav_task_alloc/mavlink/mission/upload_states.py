# SPDX-License-Identifier: Apache-2.0
"""The states of a mission upload, its events, and which leads where."""
from __future__ import annotations

from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as dialect


class UploadState(Enum):
    """State of an upload."""

    IDLE = 'idle'
    COUNTING = 'counting'
    SENDING = 'sending'
    CONFIRMING = 'confirming'
    GRACE = 'grace'
    BACKOFF = 'backoff'
    DRAINING = 'draining'
    READING = 'reading'


class UploadEvent(Enum):
    """Events of an upload: messages received, deadlines, results of the readback."""

    START = 'start'
    REQUEST = 'request'  # of any item but the last
    LAST = 'request of the last item'
    STALE = 'request beyond the end'
    ACCEPTED = 'ACK accepted, all sent'
    EARLY = 'ACK accepted before the last item'
    ERROR = 'ACK error'
    DENIED = 'ACK denied'
    CANCELLED = 'ACK cancelled'
    REFUSED = 'ACK refused permanently'
    TIMEOUT = 'timeout'
    UNSURE = 'timeout, and the mission may be stored'
    EXHAUSTED = 'no tries left'
    MATCH = 'readback matches'
    MISMATCH = 'readback differs'
    UNREAD = 'readback failed'


_S, _E = UploadState, UploadEvent


_WHILE_OPEN = {_E.REQUEST: _S.SENDING, _E.LAST: _S.CONFIRMING, _E.STALE: _S.DRAINING,
               _E.ACCEPTED: _S.READING, _E.EARLY: _S.CONFIRMING, _E.ERROR: _S.GRACE,
               _E.DENIED: _S.BACKOFF, _E.CANCELLED: _S.COUNTING, _E.REFUSED: _S.IDLE,
               _E.EXHAUSTED: _S.IDLE}


# An event that a state does not list is ignored there.
TRANSITIONS: dict[UploadState, dict[UploadEvent, UploadState]] = {
    _S.IDLE: {_E.START: _S.COUNTING},
    _S.COUNTING: {**_WHILE_OPEN, _E.TIMEOUT: _S.COUNTING},
    _S.SENDING: {**_WHILE_OPEN, _E.TIMEOUT: _S.READING},
    _S.CONFIRMING: {**_WHILE_OPEN, _E.TIMEOUT: _S.READING},
    _S.GRACE: {**_WHILE_OPEN, _E.ERROR: _S.GRACE, _E.TIMEOUT: _S.BACKOFF,
               _E.UNSURE: _S.READING},
    _S.BACKOFF: {_E.START: _S.BACKOFF, _E.REQUEST: _S.SENDING, _E.LAST: _S.CONFIRMING,
                _E.ACCEPTED: _S.READING, _E.TIMEOUT: _S.COUNTING, _E.EXHAUSTED: _S.IDLE},
    _S.DRAINING: {_E.START: _S.DRAINING, _E.CANCELLED: _S.COUNTING, _E.TIMEOUT: _S.COUNTING,
                 _E.EXHAUSTED: _S.IDLE},
    _S.READING: {_E.REQUEST: _S.SENDING, _E.LAST: _S.CONFIRMING, _E.MATCH: _S.IDLE,
                _E.MISMATCH: _S.COUNTING, _E.UNREAD: _S.IDLE, _E.EXHAUSTED: _S.IDLE},
}


# What an ACK means; all others are permanent: the mission is never sent again unchanged.
ACKS = {
    dialect.MAV_MISSION_ACCEPTED: _E.ACCEPTED,
    dialect.MAV_MISSION_ERROR: _E.ERROR,
    dialect.MAV_MISSION_INVALID_SEQUENCE: None,
    dialect.MAV_MISSION_DENIED: _E.DENIED,
    dialect.MAV_MISSION_OPERATION_CANCELLED: _E.CANCELLED,
}
