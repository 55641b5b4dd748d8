# SPDX-License-Identifier: Apache-2.0
"""The keys of a scenario file, declared once: reading and docs/scenarios.md come from here."""
from __future__ import annotations

import math
import re

from uav_task_alloc.model import is_ros_name
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.scenario.checked_yaml import (
    Key,
    KeyTable,
    choice,
    many,
    mapping,
    number,
    text_value,
    whole_number,
)
from uav_task_alloc.scenario.values import DEFAULT_SPEEDUP

_TIME = number(0.0)
POSITIVE = number(0.0, open_low=True)
POINT = many(number(), 'three numbers [x, y, z]', 3, 3)
CORNER = many(number(), 'two numbers [x, y]', 2, 2)
NAME = text_value('a non-empty string')
ID = text_value('letters, digits, _ and / after a letter or _', is_ros_name)
ROS_NAME = text_value('letters, digits and _ after a letter, as it names topics',
                re.compile(r'[A-Za-z][A-Za-z0-9_]*').fullmatch)
NAMES = many(NAME, 'a list of names')

ORIGIN: KeyTable = {
    'latitude': Key(number(-90.0, 90.0), '[deg] WGS84'),
    'longitude': Key(number(-180.0, 180.0), '[deg] WGS84'),
    'altitude_amsl': Key(number(-1000.0, 10000.0), '[m] above mean sea level', 0.0),
}

UAV: KeyTable = {
    'id': Key(ROS_NAME, 'name, and namespace of its topics'),
    'system_id': Key(whole_number(1, 255), 'MAVLink system id; default: its place in the list'
                     ' from 1', None),
    'autopilot': Key(choice('ardupilot', 'px4'), 'which autopilot is simulated', 'ardupilot'),
    'position': Key(POINT, '[m] ENU at the start'),
    'home': Key(POINT, '[m] ENU; default: its position', None),
    'cruise_speed': Key(number(0.0, 1000.0, open_low=True), '[m/s]', 15.0),
    'range': Key(number(0.0, infinite=True), '[m] it can fly in all', math.inf),
    'capabilities': Key(NAMES, 'what it can do', ()),
    'dies_at': Key(_TIME, '[s] when it falls silent for good; default: never', None),
}

TASK: KeyTable = {
    'id': Key(ID, 'name of the task'),
    'at': Key(_TIME, '[s] when it is announced', 0.0),
    'position': Key(POINT, '[m] ENU; either this or the next three', None),
    'latitude': Key(number(-90.0, 90.0), '[deg] WGS84', None),
    'longitude': Key(number(-180.0, 180.0), '[deg] WGS84', None),
    'altitude': Key(number(), '[m] above the origin', None),
    'value': Key(POSITIVE, 'what flying it is worth', 1.0),
    'service_time': Key(number(0.0, 1e6), '[s] spent there', 0.0),
    'acceptance_radius': Key(POSITIVE, "[m] how near is there; default: the parameter's",
                             None),
    'required_capabilities': Key(NAMES, 'what a UAV needs to fly it', ()),
    'allowed_uavs': Key(NAMES, 'which UAVs may fly it; default: any', None),
}

_ZONE: KeyTable = {
    'id': Key(ID, 'name of the zone'),
    'shape': Key(choice('hemisphere', 'cylinder', 'polygon'), 'its form'),
    'center': Key(many(number(), 'three numbers [x, y, z] (cylinder: [x, y] suffices)', 2, 3),
                  '[m] ENU; hemisphere and cylinder', None),
    'radius': Key(POSITIVE, '[m]; hemisphere and cylinder', None),
    'vertices': Key(many(CORNER, 'a list of at least 3 corners [x, y]', 3),
                    '[m] ENU, a simple polygon; polygon only', None),
    'z_min': Key(number(infinite=True), '[m] its floor; cylinder and polygon', -math.inf),
    'z_max': Key(number(infinite=True), '[m] its ceiling; cylinder and polygon', math.inf),
    'margin': Key(number(0.0), '[m] kept clear around it', 0.0),
    'appears': Key(_TIME, '[s] when it is first announced', 0.0),
    'vanishes': Key(number(0.0, infinite=True), '[s] when it goes; default: never', math.inf),
}

_ARRIVALS: KeyTable = {
    'count': Key(whole_number(0, 100_000), 'how many tasks are drawn from `seed`'),
    'between': Key(many(_TIME, 'two times [first, last]', 2, 2), '[s] when they come'),
    'area': Key(many(POINT, 'two corners [[x, y, z], [x, y, z]]', 2, 2),
                '[m] ENU box they lie in, never inside a zone'),
    'value': Key(POSITIVE, 'of each', 1.0),
    'service_time': Key(number(0.0, 1e6), '[s] of each', 0.0),
    'prefix': Key(ID, 'ids are the prefix and a number from 01', 'a'),
}

CANCEL: KeyTable = {
    'task': Key(ID, 'id of the task that is taken back'),
    'at': Key(_TIME, '[s]'),
}

SCENARIO: KeyTable = {
    'name': Key(NAME, 'what it is called; default: the name of the file', None),
    'seed': Key(whole_number(0, 2**32 - 1), 'of all that is random in it', 0),
    'origin': Key(mapping(ORIGIN, 'a mapping with latitude, longitude, altitude_amsl'),
                  'where ENU (0, 0, 0) is; default: 47.397742, 8.545594, 488.0', None),
    'route_end': Key(choice('hold', 'home'), 'what a UAV does after its last task', 'hold'),
    'clearance': Key(number(0.0, 10000.0), '[m] kept from zones beyond their margins',
                     AllocatorParams.clearance),
    'altitude_min': Key(number(-1e5, 1e5), '[m] lowest detour, above the origin',
                        AllocatorParams.altitude_min),
    'altitude_max': Key(number(-1e5, 1e5), '[m] highest detour, above the origin',
                        AllocatorParams.altitude_max),
    'speedup': Key(number(0.1, 100.0), 'how many times faster than real time demo and '
                   'demo.launch.py fly it', DEFAULT_SPEEDUP),
    'uavs': Key(many(mapping(UAV, 'a UAV'), 'a list of UAVs'), 'the fleet'),
    'tasks': Key(many(mapping(TASK, 'a task'), 'a list of tasks'), 'tasks with their times',
                 ()),
    'zones': Key(many(mapping(_ZONE, 'a zone'), 'a list of zones'), 'zones with their times',
                 ()),
    'arrivals': Key(mapping(_ARRIVALS, 'a mapping with count, between, area'),
                    'tasks at random times and places; default: none', None),
    'cancels': Key(many(mapping(CANCEL, 'a cancel'), 'a list of cancels'),
                   'tasks that are taken back', ()),
}

TABLES = {'scenario': SCENARIO, 'origin': ORIGIN, 'uavs': UAV, 'tasks': TASK, 'zones': _ZONE,
          'arrivals': _ARRIVALS, 'cancels': CANCEL}
