# SPDX-License-Identifier: Apache-2.0
"""Streams of bytes as somebody would send them who wants the bridge to fall over.

A stream is a function of its seed alone: datagrams with a time between them, from some far ends
and systems, in which random bytes and damaged frames come between messages that are well formed
and whose fields are hostile, or just what the bridge waits for.
"""
import math
import random
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.telemetry import WANTED
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.sim.modes import px4_mode

LIMITS = {f'{sign}int{bits}_t': (0, 2**bits - 1) if sign else (-2**(bits - 1), 2**(bits - 1) - 1)
          for sign in ('u', '') for bits in (8, 16, 32, 64)}
LIMITS['uint8_t_mavlink_version'] = 0, 255
FLOATS = (math.nan, math.inf, -math.inf, 0.0, -0.0, 1.0, 3e38, -3e38, 1e-38, 47.4)
OURS = {'target_system': 245, 'target_component': 190, 'mission_type': 0}  # or it is not for us
ANY, ASKED = sorted(d.mavlink_map), sorted(WANTED)
CUSTOM_MODES = (0, 3, 4, 5, 6, 9, px4_mode(4, 4), px4_mode(4, 3), px4_mode(4, 5), px4_mode(4, 2))
TEXTS = (b'Only 0 items are supported', b'Only 99999999999999999 items are supported', b'\x1b[2J',
         b'Mission rejected: no valid mission', b'\xff\xfe\x00x', b'%s%n{}{0.__class__}', b'')


@dataclass(frozen=True)
class Style:
    """What is the same throughout a stream."""

    pauses: tuple  # [s] between datagrams
    ends: int  # far ends it comes from
    systems: tuple
    service: float  # share of messages that a mission service waits for
    noise: float  # share of what is no frame at all, or a damaged one


def style(rng):
    """A new one; some streams are calm enough to get far, others are wild."""
    return Style(rng.choice([(0.0, 0.01, 0.1), (0.0, 0.05, 0.1, 1.0), (0.0, 0.1, 1.0, 4.0)]),
                 rng.choice([1, 1, 2, 60]), rng.choice([(1,), (1, 2), (1, 1, 1, 2, 7)]),
                 rng.choice([0.0, 0.3, 0.6]), rng.choice([0.0, 0.1, 0.4]))


def stream(seed, length):
    """Yield (time [s] since the one before, far end, bytes)."""
    rng = random.Random(seed)
    look, codecs = style(rng), {}
    for _ in range(length):
        system = rng.choice(look.systems) if rng.random() < 0.9 else rng.randint(0, 255)
        component = 1 if rng.random() < 0.9 else rng.randint(0, 255)
        codec = codecs.setdefault((system, component), Codec(system, component))
        data = b''.join(codec.pack(message(rng, look)) for _ in range(rng.choice([1, 1, 1, 3])))
        if rng.random() < look.noise:
            data = damaged(rng, data)
        yield rng.choice(look.pauses), rng.randrange(look.ends), data


def message(rng, look):
    """One that can be packed."""
    chance = rng.random()
    if chance < 0.2:
        return d.MAVLink_heartbeat_message(
            rng.choice([2, 2, 2, 1, rng.randint(0, 255)]), rng.choice([3, 12, 12, 3, 0]),
            rng.choice([0, 0x81, 209, 217]), rng.choice(CUSTOM_MODES), rng.choice([3, 4, 4, 5]), 3)
    if chance < 0.2 + 0.8 * look.service:
        return of_the_service(rng)
    return hostile(rng, rng.choice(ASKED if rng.random() < 0.95 else ANY))


def hostile(rng, number):
    """A message of a type with fields that nobody means."""
    kind = d.mavlink_map[number]
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    values = []
    for name, of in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        if of == 'char':
            values.append(rng.choice((*TEXTS, rng.randbytes(50)))[:lengths[name] or 1])
        elif lengths[name]:
            values.append([value(rng, of, name) for _ in range(lengths[name])])
        else:
            values.append(value(rng, of, name))
    return kind(*values)


def value(rng, of, name):
    if of not in LIMITS:
        return rng.choice((*FLOATS, rng.uniform(-1e3, 1e3)))
    low, high = LIMITS[of]
    if name in OURS and rng.random() < 0.8:
        return OURS[name]
    return rng.choice([0, 1, low, high, rng.randint(low, high), rng.randint(0, min(high, 9)),
                       rng.randint(0, min(high, 9))])


def of_the_service(rng):
    """What a vehicle sends that has a mission, with a field or two that are wrong."""
    bad, seq = rng.choice((*FLOATS, 0.0, 0.0, 0.0, 500.0)), rng.choice([0, 0, 1, 2, 3, 4, 65535])
    place = [rng.choice((473977420, 474000000, rng.randint(-2**31, 2**31 - 1))),
             rng.choice((85455940, rng.randint(-2**31, 2**31 - 1)))]
    command, frame = rng.choice([16, 16, 20, rng.randint(0, 65535)]), rng.choice([0, 2, 3, 5, 6])
    return rng.choice([
        lambda: d.MAVLink_mission_count_message(*to_us(), rng.choice([0, 1, 2, 3, 65535]), 0),
        lambda: d.MAVLink_mission_item_message(
            *to_us(), seq, frame, command, 0, 1, bad, 0, 0, bad, rng.choice([bad, 47.4]),
            rng.choice([bad, 8.5]), rng.choice([bad, 500.0]), 0),
        lambda: d.MAVLink_mission_item_int_message(
            *to_us(), seq, frame, command, 0, 1, bad, 0, 0, bad, *place, bad, 0),
        lambda: d.MAVLink_mission_ack_message(
            *to_us(), rng.choice([0, 0, 0, 1, 4, 13, 14, 15, rng.randint(0, 255)]), 0),
        lambda: d.MAVLink_mission_request_int_message(*to_us(), seq, 0),
        lambda: d.MAVLink_mission_request_message(*to_us(), seq, 0),
        lambda: d.MAVLink_mission_current_message(
            seq, rng.choice([0, 2, 3, 65535]), rng.randint(0, 6), rng.randint(0, 3)),
        lambda: d.MAVLink_mission_item_reached_message(seq),
        lambda: d.MAVLink_command_ack_message(
            rng.choice([400, 22, 224, 176, 511, 300]), rng.choice([0, 0, 1, 2, 3, 4, 5, 255])),
        lambda: d.MAVLink_global_position_int_message(
            rng.choice([0, 1000, 10**6, rng.randint(0, 2**32 - 1)]), *place,
            rng.choice([538000, rng.randint(-2**31, 2**31 - 1)]), rng.choice([50000, -2**31]),
            *(rng.randint(-2**15, 2**15 - 1) for _ in range(3)), 0),
        lambda: d.MAVLink_extended_sys_state_message(0, rng.randint(0, 5)),
        lambda: d.MAVLink_gps_raw_int_message(0, rng.randint(0, 6), *place, 0, 0, 0, 0, 0, 9),
    ])()


def to_us():
    return 245, 190


def damaged(rng, data):
    """Cut, changed, doubled, or replaced by noise that begins like a frame."""
    at = rng.randrange(len(data))
    return rng.choice([
        data[:at], data[at:] + data[:at], data + data[:at],
        data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1:],
        rng.randbytes(rng.randint(1, 300)),
        bytes([rng.choice([0xfd, 0xfe])]) + rng.randbytes(rng.randint(1, 300))])
