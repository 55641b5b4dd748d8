# SPDX-License-Identifier: Apache-2.0
"""Threat zones as plain values and back: one mapping and one validation for every format.

JSON lines, the journal, scenario files and ThreatZone messages differ in how they write a shape
and an unbounded height; `ZoneFormat` names these differences, `decode_zone` reads all of them.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from uav_task_alloc.checks import check_count, check_number, check_ros_name
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Shape, ThreatZone

MOST_ZONES = 1000  # of a message
MOST_VERTICES = 200  # of a zone; each pair of edges is checked for crossing
MOST_VERTICES_IN_ALL = 5000  # of all zones of a message
USED_KEYS = {  # values of a zone by its shape, beside id, shape and margin
    Shape.HEMISPHERE: ('center', 'radius'),
    Shape.CYLINDER: ('center', 'radius', 'z_min', 'z_max'),
    Shape.POLYGON: ('vertices', 'z_min', 'z_max')}
_DIMENSIONS = ('center', 'radius', 'z_min', 'z_max', 'vertices')

OUTSIDE_AREA = 'outside of fence_area'  # ids of zones that cover it begin so


@dataclass(frozen=True, slots=True)
class ZoneFormat:
    """How one file format writes a zone.

    Attributes:
        shape: the plain value of a shape.
        null_bounds: an unbounded z_min or z_max is None instead of an infinite number.
        only_used: keys that the shape does not use are left out.
    """

    shape: Callable[[Shape], str | int]
    null_bounds: bool = False
    only_used: bool = False


JSON_ZONE = ZoneFormat(lambda shape: shape.name, null_bounds=True)
JOURNAL_ZONE = ZoneFormat(lambda shape: shape.value)  # and ThreatZone messages
SCENARIO_ZONE = ZoneFormat(lambda shape: shape.name.lower(), only_used=True)


def encode_zone(zone: ThreatZone, form: ZoneFormat) -> dict[str, Any]:
    """A zone as a mapping of plain values: strings, numbers, None and lists of numbers.

    Args:
        zone: the zone, lengths in [m].
        form: JSON_ZONE, JOURNAL_ZONE or SCENARIO_ZONE.

    Returns:
        Values under the names of ThreatZone's fields; `decode_zone` reads them.
    """
    plain = {'center': list(zone.center), 'radius': zone.radius,
             'z_min': _bound(zone.z_min, form), 'z_max': _bound(zone.z_max, form),
             'vertices': [list(corner) for corner in zone.vertices]}
    names = USED_KEYS[zone.shape] if form.only_used else _DIMENSIONS
    return {'id': zone.id, 'shape': form.shape(zone.shape),
            **{name: plain[name] for name in names}, 'margin': zone.margin}


def decode_zone(values: Mapping[str, Any]) -> ThreatZone:
    """Return the zone of a mapping as `encode_zone` writes it in any format.

    Values that the shape does not use may be missing and are ignored.

    Args:
        values: by the names of ThreatZone's fields. shape: its number, or its name in upper or
            lower case. z_min, z_max: None is unbounded. margin: missing or None is 0.

    Returns:
        Checked by ThreatZone.

    Raises:
        InvalidValue: the id is no ROS name, or a value is missing or outside its range.
    """
    zone_id = values.get('id')
    if not isinstance(zone_id, str):
        raise InvalidValue('zone_id', zone_id, 'a ROS name')
    check_ros_name('zone_id', zone_id)
    place = f'zone {zone_id}: '
    shape = _shape_of(place, values.get('shape'))
    used = {name: _DECODERS[name](place + name, values.get(name)) for name in USED_KEYS[shape]}
    if shape is Shape.CYLINDER:  # z_min and z_max are its height
        used['center'] = (*used['center'][:2], 0.0)
    margin = values.get('margin')
    return ThreatZone(zone_id, shape, margin=0.0 if margin is None else margin, **used)


def decode_zone_message(msg: Any) -> ThreatZone:
    """The zone of a ThreatZone message, of rclpy or of a recording; raise as `decode_zone`."""
    check_count(f'zone {msg.zone_id[:200]}: vertices', msg.vertices, MOST_VERTICES)
    return decode_zone({
        'id': msg.zone_id, 'shape': msg.shape, 'radius': msg.radius,
        'center': (msg.center.x, msg.center.y, msg.center.z),
        'z_min': _known(msg.z_min), 'z_max': _known(msg.z_max), 'margin': _known(msg.margin),
        'vertices': [(corner.x, corner.y) for corner in msg.vertices]})


def decode_zone_array(msg: Any) -> tuple[list[ThreatZone], dict[str, str]]:
    """Return the zones of a ThreatZoneArray message, of rclpy or of a recording.

    Args:
        msg: from any publisher, not yet checked.

    Returns:
        The valid zones, and for each invalid one its id and the reason.

    Raises:
        InvalidValue: the message holds too much to check it zone by zone.
    """
    check_count('zones', msg.zones, MOST_ZONES)
    check_count('vertices of all zones', range(sum(len(zone.vertices) for zone in msg.zones)),
                 MOST_VERTICES_IN_ALL)
    valid: dict[str, ThreatZone] = {}
    invalid: dict[str, str] = {}
    for zone in msg.zones:
        try:
            if zone.zone_id.startswith(OUTSIDE_AREA):
                raise InvalidValue('zone_id', zone.zone_id, f'no {OUTSIDE_AREA!r} in front')
            if zone.zone_id in valid:
                raise InvalidValue('zone_id', zone.zone_id, 'each id once')
            valid[zone.zone_id] = decode_zone_message(zone)
        except InvalidValue as error:
            invalid[zone.zone_id] = str(error)
    return list(valid.values()), invalid


def refused_text(invalid: Mapping[str, str]) -> str:
    """Return a warning about the zones of a message that are refused.

    Args:
        invalid: why, by id.

    Returns:
        The first reason and how many more there are, on one line; '' where none is refused.
    """
    if not invalid:
        return ''
    more = f' (and {len(invalid) - 1} more)' if len(invalid) > 1 else ''
    return f'threat_zones refused: {next(iter(invalid.values()))}{more}'


def _shape_of(place: str, value: object) -> Shape:
    for shape in Shape:
        if value in (shape, shape.value, shape.name, shape.name.lower()):
            return shape
    raise InvalidValue(place + 'shape', value,
                       'HEMISPHERE (0), CYLINDER (1) or POLYGON (2)')


def _center(place: str, value: Any) -> tuple[float, ...]:
    """Two or three coordinates; ThreatZone checks their values."""
    try:
        return tuple(float(v) for v in value)
    except (TypeError, ValueError):
        raise InvalidValue(place, value, 'coordinates [m]') from None


def _corners(place: str, value: Any) -> tuple[tuple[float, float], ...]:
    if not isinstance(value, (list, tuple)):
        raise InvalidValue(place, value, 'a list of corners [x, y]')
    try:
        return tuple((float(x), float(y)) for x, y, *_ in value)
    except (TypeError, ValueError):
        raise InvalidValue(place, value, 'corners [x, y]') from None


def _low(place: str, value: Any) -> float:
    return -math.inf if value is None else check_number(place, value, -math.inf)


def _high(place: str, value: Any) -> float:
    return math.inf if value is None else check_number(place, value, -math.inf)


_DECODERS: dict[str, Callable[[str, Any], Any]] = {
    'center': _center, 'radius': lambda _, value: value, 'z_min': _low, 'z_max': _high,
    'vertices': _corners}


def _bound(value: float, form: ZoneFormat) -> float | None:
    return None if form.null_bounds and math.isinf(value) else value


def _known(value: float) -> float | None:
    """None where a message holds NaN: unknown."""
    return None if math.isnan(value) else value
