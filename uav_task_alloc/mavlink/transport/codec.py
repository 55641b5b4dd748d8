# SPDX-License-Identifier: Apache-2.0
"""Encodes and decodes MAVLink frames of one remote, with optional signing; no socket, no clock."""
from __future__ import annotations

import struct
from collections.abc import Callable, Collection
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.transport.plain_frames import (
    CHECKSUM,
    HEADER,
    V2,
    decode_plain,
    pack_plain,
)

MAX_SKIPPED = 512  # skipped frames kept until the next decoded message
Message = Any  # a dialect.MAVLink_message; the dialect has no usable types
Signing = Any  # a dialect.MAVLinkSigning; shared by all parsers, which detects replays

# Payload offset of the mission id that PX4 appends (opaque_id, mission_id); not in the dialect.
_PLAN_ID_AT = {
    dialect.MAVLINK_MSG_ID_MISSION_COUNT: 5,
    dialect.MAVLINK_MSG_ID_MISSION_ACK: 4,
    dialect.MAVLINK_MSG_ID_MISSION_CURRENT: 6,
}
_UNWANTED = dialect.MAVLink_unknown(0, bytearray())  # stands for each; never returned by `parse`
_RADIO_STATUS = dialect.MAVLINK_MSG_ID_RADIO_STATUS  # sent by the modem, which has no key


class _Parser(dialect.MAVLink):  # type: ignore[misc]
    """The dialect's parser; skips unwanted messages and resists forged signatures."""

    wanted: Collection[int] | None = None
    skipped: list[tuple[int, int]]  # system id and sequence number of unwanted frames
    tap: Callable[[bytes], None] | None = None

    def parse_frames(self, data: bytes) -> list[Message]:
        """As `parse_buffer`; a single complete frame, as most data are, needs no buffer."""
        if (len(data) < HEADER + CHECKSUM or data[0] != V2 or data[2] or self.buf
                or len(data) != HEADER + data[1] + CHECKSUM):
            return self.parse_buffer(data) or []
        self.total_bytes_received += len(data)
        self.have_prefix_error, self.expected_length = False, HEADER + CHECKSUM
        try:
            message = self.decode(bytearray(data))
        except dialect.MAVError as reason:
            message = dialect.MAVLink_bad_data(bytearray(data), reason.message)
            self.total_receive_errors += 1
        self.total_packets_received += 1
        return [message]

    def decode(self, msgbuf: bytearray) -> Message:
        if self.tap is not None:
            self.tap(bytes(msgbuf))
        if self.wanted is not None:
            number = (msgbuf[7] | msgbuf[8] << 8 | msgbuf[9] << 16 if msgbuf[0] == 253
                      else msgbuf[5])
            if number not in self.wanted:
                at = 4 if msgbuf[0] == 253 else 2  # sequence number, followed by system id
                self.skipped.append((msgbuf[at + 1], msgbuf[at]))
                return _UNWANTED
        plain = msgbuf[0] == V2 and not msgbuf[2] and self.signing.secret_key is None
        return (decode_plain(msgbuf) if plain else None) or super().decode(msgbuf)

    def check_signature(self, msgbuf: bytearray, system: int, component: int) -> bool:
        # The dialect stores the timestamp before it checks the signature: a forged frame would
        # lock the sender out.
        before = dict(self.signing.stream_timestamps)
        valid: bool = super().check_signature(msgbuf, system, component)
        if not valid:
            self.signing.stream_timestamps = before
        return valid


class Codec:
    """Encoder (`pack`) and stateful decoder (`parse`) of one remote.

    Invalid bytes are counted in `errors`, never raised.

    Args:
        system_id: source system id of encoded frames.
        component_id: source component id of encoded frames.
        wanted: message ids to decode; None: all.
        signing: signs encoded frames and checks decoded ones; None: no signing.
        tap: called with each complete frame.

    Arguments of methods:
        message: of the dialect.
        data: bytes as received, of any length.
    """

    def __init__(self, system_id: int, component_id: int, *,
                 wanted: Collection[int] | None = None, signing: Signing | None = None,
                 tap: Callable[[bytes], None] | None = None) -> None:
        self._mav = _Parser(None, system_id, component_id)
        self._mav.robust_parsing = True
        self._mav.wanted, self._mav.tap, self._mav.skipped = wanted, tap, []
        if signing is not None:
            self._mav.signing = signing

    @property
    def errors(self) -> int:
        """Number of rejected frames and bytes."""
        return int(self._mav.total_receive_errors)

    def pack(self, message: Message) -> bytes:
        """Encode a message; `with_plan_id` adds the mission id that the dialect lacks."""
        plan_id = getattr(message, 'plan_id', None)
        if plan_id is None:
            frame = pack_plain(message, self._mav) or message.pack(self._mav)
        else:
            fields = [getattr(message, name) for name in message.ordered_fieldnames]
            payload = message.unpacker.pack(*fields) + struct.pack('<I', plan_id)
            frame = message._pack(self._mav, message.crc_extra, payload)
        self._mav.seq = (self._mav.seq + 1) % 256
        return bytes(frame)

    def parse(self, data: bytes) -> list[Message]:
        """Decode the complete frames so far; an incomplete frame is kept for the next call."""
        messages = [m for m in self._mav.parse_frames(data) if m.get_msgId() >= 0]
        if messages and self._mav.skipped:
            messages[0].skipped = tuple(self._mav.skipped)
            self._mav.skipped.clear()
        del self._mav.skipped[:-MAX_SKIPPED]
        return messages

    def drop(self) -> None:
        """Discard an incomplete frame: frames do not span datagrams."""
        self._mav.buf, self._mav.buf_index = bytearray(), 0


def make_signing(key: bytes, timestamp: int, link_id: int = 0) -> Signing:
    """Signing of sent frames and checking of received ones.

    Args:
        key: 32 bytes; a frame that is not signed with it is rejected.
        timestamp: [10 us] since 2015-01-01.
        link_id: of sent frames.
    """
    signing = dialect.MAVLinkSigning()
    signing.secret_key = key
    signing.timestamp = timestamp
    signing.link_id = link_id
    signing.sign_outgoing = True
    signing.allow_unsigned_callback = lambda _mav, number: number == _RADIO_STATUS
    return signing


def plan_id(message: Message) -> int:
    """Return the id of the onboard mission (opaque_id), which PX4 sends.

    Args:
        message: MISSION_COUNT, MISSION_ACK or MISSION_CURRENT as received.

    Returns:
        uint32; 0: none.
    """
    at = _PLAN_ID_AT[message.get_msgId()]
    frame = message.get_msgbuf()
    payload = bytes(frame[10:10 + frame[1]] if frame[:1] == b'\xfd' else b'')
    return int.from_bytes(payload[at:at + 4], 'little')  # trailing zeros are truncated on the wire


def with_plan_id(message: Message, value: int) -> Message:
    """Set the id of the onboard mission (opaque_id) for `Codec.pack`.

    Args:
        message: MISSION_COUNT, MISSION_ACK or MISSION_CURRENT; is changed.
        value: uint32.

    Returns:
        The same message.
    """
    message.plan_id = value
    return message
