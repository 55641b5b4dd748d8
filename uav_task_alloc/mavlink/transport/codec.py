# SPDX-License-Identifier: Apache-2.0
"""Bytes to MAVLink messages and back for one peer, signed where asked; no socket, no clock."""
from __future__ import annotations

import struct
from collections.abc import Callable, Collection
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

MAX_SKIPPED = 512  # frames that nobody wants, remembered until one comes that somebody does
Message = Any  # a dialect.MAVLink_message; the dialect has no usable types
Signing = Any  # a dialect.MAVLinkSigning; all parsers share one, else a replay finds a new one

# The dialect lacks the mission id that PX4 appends (opaque_id, mission_id): where it begins.
_PLAN_ID_AT = {
    dialect.MAVLINK_MSG_ID_MISSION_COUNT: 5,
    dialect.MAVLINK_MSG_ID_MISSION_ACK: 4,
    dialect.MAVLINK_MSG_ID_MISSION_CURRENT: 6,
}
_RADIO_STATUS = dialect.MAVLINK_MSG_ID_RADIO_STATUS  # made by the radio, which has no key


class _Parser(dialect.MAVLink):  # type: ignore[misc]
    """The dialect's parser, which skips unwanted messages and survives forged signatures."""

    wanted: Collection[int] | None = None
    passed: list[tuple[int, int]]  # system and sequence number of frames that nobody wants
    tap: Callable[[bytes], None] | None = None

    def decode(self, msgbuf: bytearray) -> Message:
        if self.tap is not None:
            self.tap(bytes(msgbuf))
        if self.wanted is not None:
            number = (msgbuf[7] | msgbuf[8] << 8 | msgbuf[9] << 16 if msgbuf[0] == 253
                      else msgbuf[5])
            if number not in self.wanted:
                at = 4 if msgbuf[0] == 253 else 2  # sequence number, and the system after it
                self.passed.append((msgbuf[at + 1], msgbuf[at]))
                return dialect.MAVLink_unknown(number, msgbuf)
        return super().decode(msgbuf)

    def check_signature(self, msgbuf: bytearray, system: int, component: int) -> bool:
        # The dialect notes the timestamp before it knows the sender: a forger could lock out.
        before = dict(self.signing.stream_timestamps)
        good: bool = super().check_signature(msgbuf, system, component)
        if not good:
            self.signing.stream_timestamps = before
        return good


class Codec:
    """What one station says (`pack`) and hears (`parse`); one for each peer: parsers hold state.

    `wanted` names the message ids worth decoding, None all of them; `tap` sees every whole frame.
    Bad bytes are counted in `errors`, never raised.
    """

    def __init__(self, system_id: int, component_id: int, *,
                 wanted: Collection[int] | None = None, signing: Signing | None = None,
                 tap: Callable[[bytes], None] | None = None) -> None:
        self._mav = _Parser(None, system_id, component_id)
        self._mav.robust_parsing = True
        self._mav.wanted, self._mav.tap, self._mav.passed = wanted, tap, []
        if signing is not None:
            self._mav.signing = signing

    @property
    def errors(self) -> int:
        """Frames and stray bytes refused so far."""
        return int(self._mav.total_receive_errors)

    def pack(self, message: Message) -> bytes:
        """The frame of a message; `with_plan_id` adds what the dialect lacks."""
        plan_id = getattr(message, 'plan_id', None)
        if plan_id is None:
            frame = message.pack(self._mav)
        else:
            fields = [getattr(message, name) for name in message.ordered_fieldnames]
            payload = message.unpacker.pack(*fields) + struct.pack('<I', plan_id)
            frame = message._pack(self._mav, message.crc_extra, payload)
        self._mav.seq = (self._mav.seq + 1) % 256
        return bytes(frame)

    def parse(self, data: bytes) -> list[Message]:
        """The whole messages in the stream so far; half a frame waits for the rest."""
        messages = [m for m in self._mav.parse_buffer(data) or () if m.get_msgId() >= 0]
        if messages and self._mav.passed:
            messages[0].passed = tuple(self._mav.passed)
            self._mav.passed.clear()
        del self._mav.passed[:-MAX_SKIPPED]
        return messages

    def drop(self) -> None:
        """Forget half a frame: a datagram is whole, or damaged."""
        self._mav.buf, self._mav.buf_index = bytearray(), 0


def make_signing(key: bytes, timestamp: int, link_id: int = 0) -> Signing:
    """Sign what goes out and refuse what is not signed by `key` (32 bytes); time in 10 us."""
    signing = dialect.MAVLinkSigning()
    signing.secret_key = key
    signing.timestamp = timestamp
    signing.link_id = link_id
    signing.sign_outgoing = True
    signing.allow_unsigned_callback = lambda _mav, number: number == _RADIO_STATUS
    return signing


def plan_id(message: Message) -> int:
    """The id of the mission on board in a COUNT, ACK or CURRENT; 0 where there is none."""
    at = _PLAN_ID_AT[message.get_msgId()]
    frame = message.get_msgbuf()
    payload = bytes(frame[10:10 + frame[1]] if frame[:1] == b'\xfd' else b'')
    return int.from_bytes(payload[at:at + 4], 'little')  # zeros at the end are cut on the wire


def with_plan_id(message: Message, value: int) -> Message:
    """The same COUNT, ACK or CURRENT with a mission id for `Codec.pack`."""
    message.plan_id = value
    return message
