# SPDX-License-Identifier: Apache-2.0
"""Parameters of the bridge as the values that its core takes."""
from __future__ import annotations

import math
from collections.abc import Iterable

from uav_task_alloc.checks import check_number, check_ros_name
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.fence_area import area_corners, degrees_of
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.mavlink.fence.rally import RallyPoint
from uav_task_alloc.mavlink.fence.shapes import FenceShape
from uav_task_alloc.mavlink.gcs.ground_station import GcsConfig
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.params import MAX_RANGE, BridgeParams

# names in the parameter uav_limits
_LIMIT_NAMES = frozenset({'cruise_speed', 'climb_speed', 'descent_speed', 'endurance',
                          'turnaround', 'payload_capacity', 'hold_radius'})
_MOST = 1e6  # of any of them


_HIGHEST_RALLY = 5000.0  # [m]


def to_policy(params: BridgeParams, zones: tuple[ThreatZone, ...] = (),
              grounded: str = '', clock: float = 0.0, *, zones_known: bool = False,
              fence_area: FenceShape | None = None,
              rally: tuple[RallyPoint, ...] = (), settling: str = '') -> Policy:
    """Return what a mission executor may do now.

    Args:
        params: as they are now.
        zones: around which it returns.
        clock: ROS time [s].
        grounded: what has to be different before a UAV takes off; '' where it may.
        zones_known: the zones were received.
        fence_area: that all vehicles stay in; None: none.
        rally: places to return to.
        settling: what a first take-off waits for; '' where it waits for nothing.

    Returns:
        For all executors of the bridge.
    """
    return Policy(params.takeoff, params.cruise_altitude, params.when_empty, params.when_foreign,
                  params.relaunch, zones, clock, grounded, params.fences, zones_known,
                  fence_area, rally, settling)


def to_fence_area(entries: Iterable[str], origin: Origin) -> FenceShape | None:
    """Return the area that all vehicles stay in.

    Args:
        entries: corners like `47.3977,8.5456` [deg].
        origin: of the ENU frame.

    Returns:
        An inclusion, counter-clockwise; None where there are no entries.

    Raises:
        InvalidValue: an entry has another form, or the polygon is not simple.
    """
    corners = area_corners(entries, origin)
    return FenceShape('', corners=corners, inclusion=True) if corners else None


def to_rally_points(entries: Iterable[str], origin: Origin,
                    height: float) -> tuple[RallyPoint, ...]:
    """Return the places to return to.

    Args:
        entries: like `47.3977,8.5456` [deg] or `47.3977,8.5456,40` with a height [m].
        origin: of the ENU frame.
        height: [m] above home of an entry without one.

    Returns:
        In the order of the entries.

    Raises:
        InvalidValue: an entry has another form, or there are two at one place.
    """
    points: list[RallyPoint] = []
    for entry in entries:
        place, _, end = entry.rpartition(',')
        has_height = entry.count(',') == 2
        latitude, longitude = degrees_of('rally_points', place if has_height else entry)
        try:
            above = float(end) if has_height else height
        except ValueError:
            above = math.nan
        if not 0.0 < above <= _HIGHEST_RALLY:
            raise InvalidValue('rally_points', entry, f'a height in (0, {_HIGHEST_RALLY:g}] m')
        if any((p.latitude, p.longitude) == (latitude, longitude) for p in points):
            raise InvalidValue('rally_points', entry, 'each place once')
        points.append(RallyPoint(latitude, longitude, above, to_enu(
            origin, latitude, longitude, origin.altitude_amsl)))
    return tuple(points)


def to_gcs_config(params: BridgeParams) -> GcsConfig:
    """Return the configuration of the ground station.

    Args:
        params: of the bridge, each in its range.

    Returns:
        With the policy of the same parameters.

    Raises:
        InvalidValue: `uav_id_pattern` makes no ROS names, there is no connection, or a system id
            is outside [1, 255].
    """
    try:
        names = {params.uav_id_pattern.format(sysid=number) for number in (1, 2)}
    except (LookupError, ValueError, TypeError, AttributeError):
        names = set()
    if len(names) != 2:
        raise InvalidValue('uav_id_pattern', params.uav_id_pattern, 'a text with {sysid}')
    check_ros_name('uav_id_pattern', names.pop())
    if not params.connections:
        raise InvalidValue('connections', [], 'at least one')
    for number in params.system_ids:
        check_number('system_ids', number, 1, 255)
    origin = Origin(params.origin__latitude, params.origin__longitude,
                    params.origin__altitude_amsl)
    return GcsConfig(params.system_id, params.component_id, params.system_ids,
                     params.uav_id_pattern, params.autopilot, origin, to_policy(params))


def to_capabilities(entries: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Return the capabilities of each UAV.

    Args:
        entries: like `uav_1:camera,thermal`.

    Returns:
        Words by UAV id; the last entry of a UAV counts.

    Raises:
        InvalidValue: an entry has another form.
    """
    capabilities = {}
    for entry in entries:
        uav_id, colon, words = entry.partition(':')
        if not colon or not uav_id:
            raise InvalidValue('capabilities', entry, '`UAV_ID:WORD,WORD`')
        capabilities[uav_id] = tuple(word.strip() for word in words.split(',') if word.strip())
    return capabilities


def to_uav_limits(entries: Iterable[str]) -> dict[str, dict[str, float]]:
    """Return the limits of each UAV.

    Args:
        entries: like `uav_1:endurance=900,turnaround=120`.

    Returns:
        SI values by name, by UAV id.

    Raises:
        InvalidValue: an entry has another form, or a UAV has two.
    """
    limits: dict[str, dict[str, float]] = {}
    for entry in entries:
        uav_id, _, words = entry.partition(':')
        pairs = [word.split('=') for word in words.split(',')]
        try:
            values = {name.strip(): float(number) for name, number in pairs}
        except ValueError:
            values = {}
        if (not uav_id or uav_id in limits or len(values) != len(pairs)
                or not values.keys() <= _LIMIT_NAMES
                or not all(0.0 < value <= _MOST for value in values.values())):
            raise InvalidValue('uav_limits', entry, '`UAV_ID:NAME=NUMBER,...`, a UAV and a name '
                               f'once, numbers in (0, {_MOST:g}], names of '
                               f'{", ".join(sorted(_LIMIT_NAMES))}')
        limits[uav_id] = values
    return limits


def to_full_ranges(entries: Iterable[str]) -> dict[str, float]:
    """Return the range of each UAV with a full battery.

    Args:
        entries: like `uav_1:6000`.

    Returns:
        [m] by UAV id.

    Raises:
        InvalidValue: an entry has another form, or a UAV has two.
    """
    ranges: dict[str, float] = {}
    for entry in entries:
        uav_id, _, number = entry.rpartition(':')
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not (uav_id and 0.0 <= value <= MAX_RANGE) or uav_id in ranges:
            raise InvalidValue('full_ranges', entry,
                               f'`UAV_ID:METRES` with metres in [0, {MAX_RANGE:g}], a UAV once')
        ranges[uav_id] = value
    return ranges
