# SPDX-License-Identifier: Apache-2.0
"""Encodes and decodes unsigned MAVLink 2 frames of messages of plain numbers, as most are.

The same messages, attributes and bytes as of the dialect, in about half the time. What is not
handled here (other messages, signed or damaged frames) is left to the dialect: None is returned.
"""
from __future__ import annotations

import functools
import struct
from collections.abc import Callable
from operator import attrgetter
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

HEADER, CHECKSUM = 10, 2  # bytes of a frame before and after the payload
V2 = dialect.PROTOCOL_MARKER_V2
_HEADER = struct.Struct('<BBBBBBBHB')
_CHECKSUM = struct.Struct('<H')
_CRC_START = 0xFFFF


class _Layout:
    """How the messages of one id are encoded.

    Args:
        kind: class of the message, of which each field is one number.
    """

    __slots__ = ('crc_extra', 'fixed', 'kind', 'names', 'size', 'unpack', 'values')

    def __init__(self, kind: Any) -> None:
        self.kind, self.crc_extra = kind, bytes((kind.crc_extra,))
        self.names = kind.ordered_fieldnames  # as on the wire
        self.unpack, self.size = kind.unpacker.unpack, kind.unpacker.size
        self.values: Callable[[Any], Any] = attrgetter(*self.names)
        empty = vars(kind(*range(len(self.names))))
        self.fixed = {name: value for name, value in empty.items() if name not in self.names}


def _slow_crc(content: bytes, start: int) -> int:
    return int(dialect.x25crc(content).crc)


# the fast one where it is installed
_crc: Callable[[bytes, int], int] = getattr(dialect, 'mcrf4xx', None) or _slow_crc


@functools.cache
def _layout(number: int) -> _Layout | None:
    """The layout of a message id; None: unknown, or not all fields are plain numbers."""
    kind = dialect.mavlink_map.get(number)
    if kind is None or len(kind.fieldnames) < 2 or any(n > 1 for n in kind.lengths) or (
            's' in kind.unpacker.format or 'c' in kind.unpacker.format):
        return None
    return _Layout(kind)


def decode_plain(frame: bytearray) -> Any | None:
    """Decode a frame.

    Args:
        frame: one unsigned MAVLink 2 frame, of the length that its header states.

    Returns:
        The message; None: the dialect has to decode it, or to report what is wrong.
    """
    _, length, incompatible, compatible, seq, system, component, low, high = (
        _HEADER.unpack_from(frame))
    number = low | high << 16
    layout = _layout(number)
    if layout is None:
        return None
    (crc,) = _CHECKSUM.unpack_from(frame, HEADER + length)
    content = bytes(frame)
    if _crc(content[1:-CHECKSUM] + layout.crc_extra, _CRC_START) != crc:
        return None
    payload = content[HEADER:HEADER + min(length, layout.size)]
    values = layout.unpack(payload.ljust(layout.size, b'\0'))
    message = object.__new__(layout.kind)
    fields = message.__dict__
    fields.update(layout.fixed)
    fields.update(zip(layout.names, values, strict=True))
    message._msgbuf, message._payload, message._crc = frame, frame[6:-CHECKSUM], crc
    message._header = dialect.MAVLink_header(number, incompatible, compatible, length, seq, system,
                                             component)
    return message


def pack_plain(message: Any, mav: Any) -> bytes | None:
    """Encode a message.

    Args:
        message: of the dialect; gets header, payload and checksum, as by its `pack`.
        mav: the dialect's encoder: sequence number, source, signing.

    Returns:
        The frame; None: the dialect has to encode it.

    Raises:
        struct.error: a value is out of the range of its field.
    """
    number = message._header.msgId
    layout = _layout(number)
    if layout is None or mav.signing.sign_outgoing or message.__class__ is not layout.kind:
        return None
    payload: bytes = message.unpacker.pack(*layout.values(message))
    payload = payload.rstrip(b'\0') or payload[:1]
    length, seq, system, component = len(payload), mav.seq, mav.srcSystem, mav.srcComponent
    content = _HEADER.pack(V2, length, 0, 0, seq, system, component, number & 0xffff, number >> 16
                           ) + payload
    crc = _crc(content[1:] + layout.crc_extra, _CRC_START)
    frame = content + _CHECKSUM.pack(crc)
    message._header = dialect.MAVLink_header(number, 0, 0, length, seq, system, component)
    message._payload, message._msgbuf, message._crc = payload, bytearray(frame), crc
    return frame
