# SPDX-License-Identifier: Apache-2.0
"""The keys of a scenario file, declared once: the reader and docs/scenarios.md use them."""
from __future__ import annotations

import math
import re
from dataclasses import replace

import yaml

from uav_task_alloc.checks import is_ros_name
from uav_task_alloc.objective import MAX_TRIPS, OBJECTIVES, Objective
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.scenario.checked_yaml import (
    REQUIRED,
    Key,
    KeyTable,
    choice,
    list_of,
    mapping,
    number_value,
    or_mapping,
    text_value,
    whole_number,
)
from uav_task_alloc.scenario.values import DEFAULT_SPEEDUP
from uav_task_alloc.scenario.work_schema import ACTION, CAMERA, COORDINATE, WORK_KEYS

_TIME = number_value(0.0)
_LENGTH = number_value(0.0, infinite=True)
_SPEED = number_value(0.0, open_low=True, infinite=True)
_PRICE = number_value(0.0, 1e9)
_SHORTEST = Objective()
POSITIVE = number_value(0.0, open_low=True)
POINT = list_of(COORDINATE, 'three numbers [x, y, z]', 3, 3)
CORNER = list_of(COORDINATE, 'two numbers [x, y]', 2, 2)
NAME = text_value('a non-empty string')
ID = text_value('letters, digits, single _ and / after a letter or _, at most 200', is_ros_name)
ROS_NAME = text_value(
    'letters, digits and single _ after a letter, at most 200, as it names topics',
    lambda text: is_ros_name(text) and re.fullmatch(r'[A-Za-z]\w*', text))
NAMES = list_of(NAME, 'a list of names')

ORIGIN: KeyTable = {
    'latitude': Key(number_value(-90.0, 90.0), '[deg] WGS84'),
    'longitude': Key(number_value(-180.0, 180.0), '[deg] WGS84'),
    'altitude_amsl': Key(number_value(-1000.0, 10000.0), '[m] above mean sea level', 0.0),
}

_LATITUDE, _LONGITUDE = (Key(number_value(-90.0, 90.0), '[deg] WGS84', None),
                         Key(number_value(-180.0, 180.0), '[deg] WGS84', None))
_ALTITUDE = Key(COORDINATE, '[m] above the origin', None)
GEODETIC: KeyTable = {
    'latitude': replace(_LATITUDE, default=REQUIRED),
    'longitude': replace(_LONGITUDE, default=REQUIRED),
    'altitude': replace(_ALTITUDE, default=REQUIRED),
}
_GEODETIC_CORNER: KeyTable = {key: GEODETIC[key] for key in ('latitude', 'longitude')}

_CORNERS = list_of(or_mapping(
    CORNER, _GEODETIC_CORNER, 'two numbers [x, y], or a mapping with latitude, longitude'),
    'a list of at least 3 corners [x, y] or {latitude, longitude}', 3)

UAV: KeyTable = {
    'id': Key(ROS_NAME, 'name of the UAV and namespace of its topics'),
    'system_id': Key(whole_number(1, 255), 'MAVLink system id; default: its position in the list'
                     ' from 1', None),
    'autopilot': Key(choice('ardupilot', 'px4'), 'the simulated autopilot', 'ardupilot'),
    'position': Key(POINT, '[m] ENU at the start; either this or latitude, longitude and altitude',
                    None),
    'latitude': _LATITUDE,
    'longitude': _LONGITUDE,
    'altitude': _ALTITUDE,
    'home': Key(or_mapping(POINT, GEODETIC, 'three numbers [x, y, z], or a mapping with '
                                'latitude, longitude, altitude'),
                '[m] ENU, or degrees and [m] above the origin; default: its position', None),
    'cruise_speed': Key(number_value(0.0, 1000.0, open_low=True), '[m/s]', 15.0),
    'range': Key(number_value(0.0, infinite=True), '[m] it can fly in total', math.inf),
    'endurance': Key(_LENGTH, '[s] it can be in the air in total, service and waiting included',
                     math.inf),
    'full_range': Key(_LENGTH, '[m] after a visit of its home; default: its range', None),
    'full_endurance': Key(_LENGTH, '[s] after a visit of its home; default: its endurance', None),
    'turnaround': Key(_LENGTH, '[s] of a visit of its home between two trips; .inf: it makes one '
                      'trip only', math.inf),
    'payload_capacity': Key(number_value(0.0, 1e6), '[kg] it can take on at its home', 0.0),
    'climb_speed': Key(_SPEED, '[m/s] at most, upwards; in a flight .inf is what the '
                       'autopilot climbs', math.inf),
    'descent_speed': Key(_SPEED, '[m/s] at most, downwards; in a flight as climb_speed',
                         math.inf),
    'available_from': Key(number_value(0.0, 1e9), '[s] when it may take off', 0.0),
    'available_until': Key(_LENGTH, '[s] by when its route ends', math.inf),
    'capabilities': Key(NAMES, 'its capabilities', ()),
    'dies_at': Key(_TIME, '[s] when it is lost and sends nothing any more; default: never', None),
}

TASK: KeyTable = {
    'id': Key(ID, 'name of the task'),
    'at': Key(_TIME, '[s] when it is announced', 0.0),
    'position': Key(POINT, '[m] ENU; either this or latitude, longitude and altitude; a line or '
                    'area has a path instead', None),
    'latitude': _LATITUDE,
    'longitude': _LONGITUDE,
    'altitude': _ALTITUDE,
    'value': Key(POSITIVE, 'value of serving it', 1.0),
    'service_time': Key(number_value(0.0, 1e6), '[s] that the UAV stays at the task', 0.0),
    'acceptance_radius': Key(POSITIVE, '[m] distance at which it counts as reached; default: the '
                             "bridge's parameter", None),
    'required_capabilities': Key(NAMES, 'capabilities that a UAV needs', ()),
    'allowed_uavs': Key(NAMES, 'the UAVs that may fly it; default: any', None),
    'earliest': Key(number_value(-math.inf, 1e9, infinite=True), '[s] of the start of its '
                    'service; a UAV that arrives earlier waits', -math.inf),
    'latest': Key(number_value(-1e9, infinite=True), '[s] of the start of its service', math.inf),
    'release': Key(_TIME, '[s] no UAV sets out for it before', 0.0),
    'payload': Key(number_value(0.0, 1e6), '[kg] that a UAV takes on at its home for it', 0.0),
    **WORK_KEYS,
}

_WIND: KeyTable = {
    'east': Key(number_value(-100.0, 100.0), '[m/s] of the air towards east', 0.0),
    'north': Key(number_value(-100.0, 100.0), '[m/s] of the air towards north', 0.0),
    'gusts': Key(number_value(0.0, 100.0), '[m/s] standard deviation of gusts in each direction, '
                 'of `seed`', 0.0),
}

SEPARATION: KeyTable = {
    'horizontal': Key(number_value(0.0, 1000.0), '[m] that keeps two UAVs in the air apart; 0: '
                      'nothing does'),
    'vertical': Key(number_value(0.0, 1000.0), '[m] that keeps them apart at any horizontal '
                    'distance', AllocatorParams.separation__vertical),
    'time': Key(number_value(0.0, 60.0), '[s] by which each may be early or late',
                AllocatorParams.separation__time),
}

OBJECTIVE: KeyTable = {
    'distance': Key(_PRICE, '[1/m] of the length of all routes', _SHORTEST.distance),
    'finish': Key(_PRICE, '[1/s] of the end of the last route', _SHORTEST.finish),
    'response': Key(_PRICE, '[1/s] of the mean time to the start of a service, weighted with the '
                    'values', _SHORTEST.response),
    'lateness': Key(_LENGTH, '[1/s] of services that start after `latest`; .inf: none may',
                    _SHORTEST.lateness),
    'unserved': Key(_LENGTH, 'per value of the tasks that are not served; .inf: all that can be '
                    'are', _SHORTEST.unserved),
}

ZONE: KeyTable = {
    'id': Key(ID, 'name of the zone'),
    'shape': Key(choice('hemisphere', 'cylinder', 'polygon'), 'its shape'),
    'center': Key(list_of(COORDINATE, 'three numbers [x, y, z] (cylinder: [x, y] suffices)',
                          2, 3),
                  '[m] ENU; hemisphere and cylinder; either this or latitude and longitude, of a '
                  'hemisphere also altitude', None),
    'latitude': replace(_LATITUDE, text='[deg] WGS84 of its center; hemisphere and cylinder'),
    'longitude': replace(_LONGITUDE, text='[deg] WGS84 of its center; hemisphere and cylinder'),
    'altitude': replace(_ALTITUDE, text='[m] above the origin, of its center; hemisphere only'),
    'radius': Key(POSITIVE, '[m]; hemisphere and cylinder', None),
    'vertices': Key(_CORNERS,
        '[m] ENU or degrees, a simple polygon; polygon only', None),
    'z_min': Key(number_value(infinite=True), '[m] lower limit; cylinder and polygon', -math.inf),
    'z_max': Key(number_value(infinite=True), '[m] upper limit; cylinder and polygon', math.inf),
    'margin': Key(number_value(0.0), '[m] kept clear around it', 0.0),
    'appears': Key(_TIME, '[s] when it is first announced', 0.0),
    'vanishes': Key(number_value(0.0, infinite=True), '[s] when it is removed; default: never',
                    math.inf),
}

_ARRIVALS: KeyTable = {
    'count': Key(whole_number(0, 100_000), 'number of random tasks'),
    'between': Key(list_of(_TIME, 'two times [first, last]', 2, 2), '[s] when they are announced'),
    'area': Key(list_of(POINT, 'two corners [[x, y, z], [x, y, z]]', 2, 2),
                '[m] ENU box of their positions, which are outside all zones'),
    'value': Key(POSITIVE, 'of each', 1.0),
    'service_time': Key(number_value(0.0, 1e6), '[s] of each', 0.0),
    'prefix': Key(ID, 'ids are the prefix and a number from 01', 'a'),
}

CANCEL: KeyTable = {
    'task': Key(ID, 'id of the task that is withdrawn'),
    'at': Key(_TIME, '[s]'),
}

_ORDER: KeyTable = {
    'at': Key(_TIME, '[s] when it is given, or later: once the allocator has planned its tasks '
              'and knows its UAV'),
    'order': Key(choice('pin', 'forbid', 'next'), 'pin: only this UAV may fly the task; forbid: '
                 'it may not; next: it flies these tasks next, in this order'),
    'uav': Key(ROS_NAME, 'id of the UAV'),
    'tasks': Key(list_of(ID, 'a list of ids of tasks', 1), 'of pin and forbid one'),
}

SCENARIO: KeyTable = {
    'name': Key(NAME, 'name; default: the name of the file', None),
    'seed': Key(whole_number(0, 2**32 - 1), 'of all random values', 0),
    'origin': Key(mapping(ORIGIN, 'a mapping with latitude, longitude, altitude_amsl'),
                  'position of ENU (0, 0, 0); default: 47.397742, 8.545594, 488.0', None),
    'route_end': Key(choice('hold', 'home'), 'what a UAV does after its last task', 'hold'),
    'objective': Key(or_mapping(choice(*OBJECTIVES), OBJECTIVE, f'one of {", ".join(OBJECTIVES)}, '
                                'or a mapping of prices', yaml.ScalarNode),
                     'what is minimised: a name, or prices; see objective; default: distance in '
                     '`plan`, the parameter of the allocator in a flight', None),
    'trips': Key(whole_number(1, MAX_TRIPS), 'of each UAV at most; more than one: it may visit '
                 'its home for a battery and loads', 1),
    'clearance': Key(number_value(0.0, 10000.0),
                     '[m] kept from zones in addition to their margins',
                     AllocatorParams.clearance),
    'altitude_min': Key(number_value(-1e5, 1e5), '[m] lowest detour, above the origin',
                        AllocatorParams.altitude_min),
    'altitude_max': Key(number_value(-1e5, 1e5), '[m] highest detour, above the origin',
                        AllocatorParams.altitude_max),
    'fence_area': Key(_CORNERS, '[m] ENU or degrees, at most 20 corners of a simple polygon that '
                      'no plan leaves; default: none', ()),
    'wind': Key(mapping(_WIND, 'a mapping with east, north, gusts'),
                'in which simulated UAVs fly; `plan` ignores it; default: calm', None),
    'separation': Key(mapping(SEPARATION, 'a mapping with horizontal, vertical, time'),
                      'how UAVs are kept apart, and by what a simulated flight is judged; '
                      'default: not at all', None),
    'speedup': Key(number_value(0.1, 100.0), 'factor on real time of demo and '
                   'demo.launch.py', DEFAULT_SPEEDUP),
    'uavs': Key(list_of(mapping(UAV, 'a UAV'), 'a list of UAVs'), 'the fleet'),
    'tasks': Key(list_of(mapping(TASK, 'a task'), 'a list of tasks'), 'tasks with their times',
                 ()),
    'zones': Key(list_of(mapping(ZONE, 'a zone'), 'a list of zones'), 'zones with their times',
                 ()),
    'arrivals': Key(mapping(_ARRIVALS, 'a mapping with count, between, area'),
                    'tasks at random times and places; default: none', None),
    'cancels': Key(list_of(mapping(CANCEL, 'a cancel'), 'a list of cancels'),
                   'tasks that are withdrawn', ()),
    'orders': Key(list_of(mapping(_ORDER, 'an order'), 'a list of orders'), 'orders of an operator'
                  ' in a flight, docs/operator.md; `plan` ignores them', ()),
}

TABLES = {'scenario': SCENARIO, 'origin': ORIGIN, 'objective': OBJECTIVE, 'wind': _WIND,
          'separation': SEPARATION, 'uavs': UAV, 'tasks': TASK,
          'actions': ACTION, 'camera': CAMERA, 'zones': ZONE,
          'arrivals': _ARRIVALS, 'cancels': CANCEL, 'orders': _ORDER}
