# SPDX-License-Identifier: Apache-2.0
"""Byte streams of an attacker.

A stream depends on its seed only: datagrams with the time between them, from several remotes and
systems. Random bytes and corrupt frames are mixed with well-formed messages whose fields are
hostile, or exactly what the bridge waits for.
"""
import math
import random
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.telemetry_messages import WANTED
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.sim.modes import px4_mode

LIMITS = {f'{sign}int{bits}_t': (0, 2**bits - 1) if sign else (-2**(bits - 1), 2**(bits - 1) - 1)
          for sign in ('u', '') for bits in (8, 16, 32, 64)}
LIMITS['uint8_t_mavlink_version'] = 0, 255
FLOATS = (math.nan, math.inf, -math.inf, 0.0, -0.0, 1.0, 3e38, -3e38, 1e-38, 47.4)
OURS = {'target_system': 245, 'target_component': 190, 'mission_type': 0}  # else dropped
ANY, ASKED = sorted(d.mavlink_map), sorted(WANTED)
FRAMES = (d.MAV_FRAME_GLOBAL, d.MAV_FRAME_MISSION, d.MAV_FRAME_GLOBAL_RELATIVE_ALT,
          d.MAV_FRAME_GLOBAL_INT, d.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
CUSTOM_MODES = (0, 3, 4, 5, 6, 9, px4_mode(4, 4), px4_mode(4, 3), px4_mode(4, 5), px4_mode(4, 2))
COMMANDS = (d.MAV_CMD_COMPONENT_ARM_DISARM, d.MAV_CMD_NAV_TAKEOFF,
            d.MAV_CMD_DO_SET_MISSION_CURRENT, d.MAV_CMD_DO_SET_MODE,
            d.MAV_CMD_SET_MESSAGE_INTERVAL, d.MAV_CMD_MISSION_START)
TEXTS = (b'Only 0 items are supported', b'Only 99999999999999999 items are supported', b'\x1b[2J',
         b'Mission rejected: no valid mission', b'\xff\xfe\x00x', b'%s%n{}{0.__class__}', b'')


@dataclass(frozen=True)
class Style:
    """Constant properties of a stream."""

    pauses: tuple  # [s] between datagrams
    remotes: int  # number of sources
    systems: tuple
    service: float  # share of messages of the mission protocol and telemetry
    noise: float  # share of corrupt datagrams


def style(rng):
    """Draw the properties: some streams are slow and clean, others fast and corrupt."""
    return Style(rng.choice([(0.0, 0.01, 0.1), (0.0, 0.05, 0.1, 1.0), (0.0, 0.1, 1.0, 4.0)]),
                 rng.choice([1, 1, 2, 60]), rng.choice([(1,), (1, 2), (1, 1, 1, 2, 7)]),
                 rng.choice([0.0, 0.3, 0.6]), rng.choice([0.0, 0.1, 0.4]))


def stream(seed, length):
    """Yield (time [s] since the previous one, remote, bytes)."""
    rng = random.Random(seed)
    properties, codecs = style(rng), {}
    for _ in range(length):
        system = rng.choice(properties.systems) if rng.random() < 0.9 else rng.randint(0, 255)
        component = 1 if rng.random() < 0.9 else rng.randint(0, 255)
        codec = codecs.setdefault((system, component), Codec(system, component))
        count = rng.choice([1, 1, 1, 3])
        data = b''.join(codec.pack(message(rng, properties)) for _ in range(count))
        if rng.random() < properties.noise:
            data = corrupt(rng, data)
        yield rng.choice(properties.pauses), rng.randrange(properties.remotes), data


def message(rng, properties):
    """A message that can be encoded."""
    chance = rng.random()
    if chance < 0.2:
        return d.MAVLink_heartbeat_message(
            rng.choice([2, 2, 2, 1, rng.randint(0, 255)]), rng.choice([3, 12, 12, 3, 0]),
            rng.choice([0, 0x81, 209, 217]), rng.choice(CUSTOM_MODES), rng.choice([3, 4, 4, 5]), 3)
    if chance < 0.2 + 0.8 * properties.service:
        return from_mission_vehicle(rng)
    return hostile(rng, rng.choice(ASKED if rng.random() < 0.95 else ANY))


def hostile(rng, number):
    """A message with random and extreme fields."""
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


def from_mission_vehicle(rng):
    """What a vehicle with a mission sends, with a few wrong fields."""
    bad, seq = rng.choice((*FLOATS, 0.0, 0.0, 0.0, 500.0)), rng.choice([0, 0, 1, 2, 3, 4, 65535])
    place = [rng.choice((473977420, 474000000, rng.randint(-2**31, 2**31 - 1))),
             rng.choice((85455940, rng.randint(-2**31, 2**31 - 1)))]
    command = rng.choice([d.MAV_CMD_NAV_WAYPOINT, d.MAV_CMD_NAV_WAYPOINT,
                          d.MAV_CMD_NAV_RETURN_TO_LAUNCH, rng.randint(0, 65535)])
    frame = rng.choice(FRAMES)
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
            rng.choice(COMMANDS), rng.choice([0, 0, 1, 2, 3, 4, 5, 255])),
        lambda: d.MAVLink_global_position_int_message(
            rng.choice([0, 1000, 10**6, rng.randint(0, 2**32 - 1)]), *place,
            rng.choice([538000, rng.randint(-2**31, 2**31 - 1)]), rng.choice([50000, -2**31]),
            *(rng.randint(-2**15, 2**15 - 1) for _ in range(3)), 0),
        lambda: d.MAVLink_extended_sys_state_message(0, rng.randint(0, 5)),
        lambda: d.MAVLink_gps_raw_int_message(0, rng.randint(0, 6), *place, 0, 0, 0, 0, 0, 9),
    ])()


def to_us():
    return 245, 190


def corrupt(rng, data):
    """Truncated, changed, repeated, or replaced by noise that starts like a frame."""
    at = rng.randrange(len(data))
    return rng.choice([
        data[:at], data[at:] + data[:at], data + data[:at],
        data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1:],
        rng.randbytes(rng.randint(1, 300)),
        bytes([rng.choice([0xfd, 0xfe])]) + rng.randbytes(rng.randint(1, 300))])
