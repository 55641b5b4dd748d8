# SPDX-License-Identifier: Apache-2.0
"""The keys of tasks that are lines, areas or orbits, and of actions and cameras."""
from __future__ import annotations

import math
from dataclasses import replace

from uav_task_alloc.actions import ACTIONS
from uav_task_alloc.scenario.checked_yaml import (
    Key,
    KeyTable,
    choice,
    list_of,
    mapping,
    number_value,
    or_mapping,
    scalar,
    whole_number,
)
from uav_task_alloc.work.footprint import FRONT_OVERLAP, SIDE_OVERLAP
from uav_task_alloc.work.values import ORBIT_RADII, Kind, Vertical

FARTHEST = 500e3  # [m] from the origin: farther out, degrees, origin or frame are wrong
_ANGLE = number_value(-2 * math.pi, 2 * math.pi)
_SHARE = number_value(0.0, 0.95)
_LATITUDE = Key(number_value(-90.0, 90.0), '[deg] WGS84')
_LONGITUDE = Key(number_value(-180.0, 180.0), '[deg] WGS84')


def _truth(text: str) -> bool:
    if text.lower() not in ('true', 'false', 'yes', 'no'):
        raise ValueError
    return text.lower() in ('true', 'yes')


def _metres(text: str) -> float:
    value = float(text)
    if not abs(value) <= FARTHEST:
        raise ValueError
    return value


COORDINATE = scalar(f'a number of metres within {FARTHEST / 1e3:g} km of the origin', _metres)
_FREE = Key(COORDINATE, '[m]', None)
_VERTEX: KeyTable = {
    'latitude': _LATITUDE,
    'longitude': _LONGITUDE,
    'altitude': Key(COORDINATE, "[m] above the origin; default: the task's", None),
}
_POINTS = list_of(or_mapping(
    list_of(COORDINATE, 'two or three numbers [x, y, z]', 2, 3), _VERTEX,
    'numbers [x, y] or [x, y, z], or a mapping with latitude, longitude'),
    'a list of points [x, y, z], [x, y] or {latitude, longitude, altitude}', 1, 1001)

# all keys of all actions; which of them an action has is checked by `Action`
ACTION: KeyTable = {
    'name': Key(choice(*ACTIONS), 'what is done'),
    'count': Key(whole_number(1, 10_000), 'of photo: how many; default: 1', None),
    'interval': Key(number_value(0.0, 3600.0), '[s] of photo: between two; default: 1', None),
    'distance': Key(number_value(0.0, 1e4, open_low=True), '[m] of trigger: between two photos '
                    'on the way', None),
    'pitch': Key(_ANGLE, '[rad] of gimbal: upwards', None),
    'yaw': Key(_ANGLE, '[rad] of gimbal: clockwise from the nose; default: 0', None),
    'x': replace(_FREE, text='[m] ENU of roi: what the camera looks at'),
    'y': replace(_FREE, text='[m] ENU of roi'),
    'z': replace(_FREE, text='[m] ENU of roi'),
    'channel': Key(whole_number(1, 32), 'of servo', None),
    'pwm': Key(number_value(500.0, 2500.0), '[us] of servo', None),
    'release': Key(whole_number(0, 1), 'of gripper: 1 releases, 0 grabs', None),
    'seconds': Key(number_value(0.0, 86_400.0), '[s] of wait', None),
    'speed': Key(number_value(0.0, 1e4, open_low=True), '[m/s] of speed: until the end of the way',
                 None),
}

CAMERA: KeyTable = {
    'sensor_width': Key(number_value(0.0, 1000.0), '[mm] across the way', 0.0),
    'sensor_height': Key(number_value(0.0, 1000.0), '[mm] along the way', 0.0),
    'focal_length': Key(number_value(0.0, 10_000.0), '[mm]', 0.0),
    'height': Key(number_value(0.0, 1e4), '[m] above the ground; default: that of the task above '
                  'the origin', 0.0),
    'ground_sample_distance': Key(number_value(0.0, 100.0), '[m] of a pixel on the ground, instead'
                                  ' of sensor and height', 0.0),
    'image_width': Key(number_value(0.0, 1e6), '[pixels] across the way', 0.0),
    'image_height': Key(number_value(0.0, 1e6), '[pixels] along the way', 0.0),
    'side_overlap': Key(_SHARE, 'share of a strip that the next one sees as well',
                        SIDE_OVERLAP),
    'front_overlap': Key(number_value(0.0, 0.99), 'share of a photo that the next one sees as '
                         'well', FRONT_OVERLAP),
}

WORK_KEYS: KeyTable = {
    'kind': Key(choice(*(kind.name.lower() for kind in Kind)), 'point: a place; line: a way that '
                'is flown from either end; area: a polygon that is covered by strips; orbit: '
                'turns around its position', 'point'),
    'path': Key(_POINTS, '[m] ENU or degrees: the points of a line, or the corners of an area; '
                'points without a height have the `altitude` of the task', ()),
    'holes': Key(list_of(_POINTS, 'a list of polygons'), '[m] ENU or degrees: polygons of an area '
                 'that are left out', ()),
    'strip_width': Key(number_value(0.0, 1e5), '[m] that one pass over an area covers; or a '
                       'camera', 0.0),
    'camera': Key(mapping(CAMERA, 'a mapping of a camera'), 'what gives the strips of an area '
                  'their width, and photos on the way their distance', None),
    'direction': Key(_ANGLE, '[rad] of the strips of an area, or from the centre to the entry of '
                     'an orbit, counter-clockwise from east; default: the best, or 0', None),
    'radius': Key(number_value(0.0, ORBIT_RADII[1]), f'[m] of an orbit, at least '
                  f'{ORBIT_RADII[0]:g}', 0.0),
    'turns': Key(number_value(-100.0, 100.0), 'of an orbit, clockwise; negative: '
                 'counter-clockwise; default: 1', 0.0),
    'divisible': Key(scalar('true or false', _truth), 'whether a line may be cut at its points, '
                     'for several UAVs', False),
    'vertical': Key(choice(*(each.name.lower() for each in Vertical)), 'what its heights are '
                    'above: the origin, or the ground below', 'origin'),
    'heading': Key(_ANGLE, '[rad] of the nose, clockwise from north; default: any', None),
    'actions': Key(list_of(mapping(ACTION, 'a mapping with name'), 'a list of actions'),
                   'what the UAV does there or on the way', ()),
}
