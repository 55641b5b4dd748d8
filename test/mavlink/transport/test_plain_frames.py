# SPDX-License-Identifier: Apache-2.0
"""Frames of plain messages: the same bytes, messages and counts as of the dialect alone."""
import random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.transport import plain_frames
from uav_task_alloc.mavlink.transport.codec import Codec, make_signing

NUMBERS = sorted(d.mavlink_map)


def message_of(number, seed):
    """A message with random bytes in its fields, decoded by the dialect."""
    kind, rng = d.mavlink_map[number], random.Random(seed * 100_003 + number)
    payload = rng.randbytes(kind.unpacker.size)[:rng.randint(1, kind.unpacker.size)]
    mav = d.MAVLink(None, rng.randrange(256), rng.randrange(256))
    mav.seq = rng.randrange(256)
    raw = d.MAVLink_message(number, kind.msgname)._pack(mav, kind.crc_extra, payload)
    return bytes(raw), d.MAVLink(None).decode(bytearray(raw))


def content(message):
    """All attributes; numbers as text, which NaN equals too."""
    return {name: vars(value) if name == '_header' else (type(value), repr(value))
            for name, value in vars(message).items()}


@pytest.mark.parametrize('seed', range(3))
def test_messages_are_decoded_as_by_the_dialect(seed):
    plain = 0
    for number in NUMBERS:
        raw, expected = message_of(number, seed)
        (decoded,) = Codec(1, 1).parse(raw)
        assert type(decoded) is type(expected), expected.get_type()
        assert content(decoded) == content(expected), expected.get_type()
        plain += plain_frames.decode_plain(bytearray(raw)) is not None
    assert plain > 150


@pytest.mark.parametrize('seed', range(3))
def test_messages_are_encoded_as_by_the_dialect(seed):
    plain = 0
    for number in NUMBERS:
        _, message = message_of(number, seed)
        _, other = message_of(number, seed)
        mav = d.MAVLink(None, 7, 9)
        codec = Codec(7, 9)
        mav.seq = codec._mav.seq = 200
        expected = other.pack(mav)
        assert codec.pack(message) == expected, message.get_type()
        assert content(message) == content(other), message.get_type()
        plain += plain_frames.pack_plain(message, mav) is not None
    assert plain > 150


@pytest.mark.parametrize('value', [-1, 2**32, 1.5, None, 'x'])
def test_a_value_that_does_not_fit_is_refused_as_by_the_dialect(value):
    message = d.MAVLink_mission_current_message(value)
    with pytest.raises(Exception) as expected:
        message.pack(d.MAVLink(None, 1, 1))
    with pytest.raises(expected.type):
        Codec(1, 1).pack(message)


def test_any_stream_is_parsed_as_by_the_dialect(monkeypatch):
    rng, streams = random.Random(3), []
    for seed in range(40):
        data = [message_of(rng.choice(NUMBERS[:120]), seed)[0] for _ in range(20)]
        for _ in range(rng.randrange(8)):  # damage, cuts, noise
            n = rng.randrange(len(data))
            frame = bytearray(data[n]) or bytearray(b'\xfd')
            frame[rng.randrange(len(frame))] = rng.randrange(256)
            data[n] = bytes(frame)[:rng.choice((len(frame), rng.randint(0, len(frame))))]
        if rng.random() < 0.3:
            data = [b''.join(data)[k:k + 50] for k in range(0, 800, 50)]
        streams.append(data)
    found = [parsed(data) for data in streams]
    monkeypatch.setattr('uav_task_alloc.mavlink.transport.codec.decode_plain', lambda _: None)
    monkeypatch.setattr('uav_task_alloc.mavlink.transport.codec._Parser.parse_frames',
                        lambda self, data: self.parse_buffer(data) or [])
    assert [parsed(data) for data in streams] == found
    assert sum(errors > 0 for _, errors, _ in found) > 20


def parsed(data):
    """What a codec makes of the pieces of a stream, and its counts."""
    codec = Codec(1, 1, wanted=range(100))
    messages = [[content(m) for m in codec.parse(piece)] for piece in data]
    mav = codec._mav
    return messages, codec.errors, (mav.buf, mav.expected_length, mav.have_prefix_error,
                                    mav.total_packets_received, mav.total_bytes_received,
                                    mav.skipped)


def test_a_codec_with_a_key_refuses_unsigned_frames_and_signs_its_own():
    message = d.MAVLink_mission_current_message(3)
    keyed = Codec(1, 1, signing=make_signing(bytes(32), 10**14))
    assert keyed.parse(Codec(2, 1).pack(message)) == []
    assert keyed.errors == 1
    assert keyed.pack(message)[2] == d.MAVLINK_IFLAG_SIGNED
