# SPDX-License-Identifier: Apache-2.0
"""Hints for keys that do not exist: words of other programs for the same thing, then spelling."""
from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches

# the key that has the meaning of a word; of several, the first that the table has
SAME_MEANING = {
    'value': 'priority prio weight reward importance profit score',
    'service_time': 'duration service hover hover_time wait dwell loiter hold_time',
    'cruise_speed': 'speed velocity airspeed groundspeed max_speed',
    'range': 'battery max_range max_distance fuel energy',
    'endurance': 'flight_time max_flight_time battery_time',
    'earliest': 'after not_before ready_time open_time opens',
    'latest': 'deadline due before due_date time_window window closes',
    'payload': 'mass load demand', 'payload_capacity': 'capacity max_payload max_load',
    'turnaround': 'swap_time battery_swap recharge_time',
    'climb_speed': 'climb_rate', 'descent_speed': 'descent_rate sink_rate',
    'z_min': 'min_altitude altitude_min floor bottom lower',
    'z_max': 'max_altitude altitude_max ceiling top upper height alt',
    'latitude': 'lat', 'longitude': 'lon lng long',
    'altitude': 'alt height elevation agl', 'altitude_amsl': 'alt altitude height elevation amsl',
    'position': 'pos location coordinates coords point xyz start x y z',
    'center': 'centre position pos location middle x y z', 'radius': 'size diameter r',
    'vertices': 'corners polygon points outline boundary', 'shape': 'type kind geometry',
    'margin': 'buffer clearance safety', 'clearance': 'margin buffer safety safety_distance',
    'id': 'name label uav_id task_id zone_id', 'system_id': 'sysid sys_id mavlink_id',
    'autopilot': 'firmware type stack', 'home': 'base depot landing',
    'required_capabilities': 'capabilities skills requires sensors payload_type',
    'capabilities': 'skills sensors equipment',
    'allowed_uavs': 'uav uavs assigned_to only vehicle',
    'acceptance_radius': 'tolerance radius accuracy',
    'at': 'time release announced t appears start_time', 'appears': 'at from start begin',
    'vanishes': 'until end to expires', 'dies_at': 'fails_at lost_at dies',
    'uavs': 'drones vehicles robots fleet agents', 'tasks': 'targets goals jobs points waypoints',
    'zones': 'obstacles threats no_fly_zones nofly keepouts geofences threat_zones',
    'route_end': 'return end return_home', 'arrivals': 'random random_tasks', 'origin': 'home ref',
    'speedup': 'speed time_factor', 'cancels': 'cancel withdrawals', 'task': 'id',
    'count': 'number n', 'between': 'times interval', 'area': 'box bounds'}
_NO_SUCH_THING = {
    'an order of tasks is not supported': 'depends depends_on predecessor order sequence'}


def key_hint(key: str, table: Iterable[str]) -> str:
    """Say what to write instead of an unknown key.

    Args:
        key: as given.
        table: the keys that exist; at least one.

    Returns:
        `nearest is 'value'`, or why there is nothing like it.
    """
    known, word = list(table), re.sub(r'\W+', '_', key).strip('_').lower()
    for name, words in SAME_MEANING.items():
        if name in known and word in words.split():
            return f'nearest is {name!r}'
    for reason, words in _NO_SUCH_THING.items():
        if 'position' in known and word in words.split():
            return reason
    return f'nearest is {get_close_matches(key, known, 1, 0.0)[0]!r}'
