# SPDX-License-Identifier: Apache-2.0
"""Range checks of received messages: fields that no vehicle can mean; senders may be hostile."""
from __future__ import annotations

import math
from collections.abc import Iterator

from uav_task_alloc.mavlink.mission.items import GLOBAL_FRAMES
from uav_task_alloc.mavlink.transport.codec import Message

_MAX_LATITUDE, _MAX_LONGITUDE = 90 * 10**7, 180 * 10**7  # [1e-7 deg]
_MAX_ALTITUDE = 10**8  # [mm], up and down: INT32_MAX is sent where it is not known
# message -> field, least, most
_RANGES: dict[str, tuple[tuple[str, int, int], ...]] = {
    'GLOBAL_POSITION_INT': (('lat', -_MAX_LATITUDE, _MAX_LATITUDE),
                            ('lon', -_MAX_LONGITUDE, _MAX_LONGITUDE),
                            ('alt', -_MAX_ALTITUDE, _MAX_ALTITUDE),
                            ('relative_alt', -_MAX_ALTITUDE, _MAX_ALTITUDE)),
    'HOME_POSITION': (('latitude', -_MAX_LATITUDE, _MAX_LATITUDE),
                      ('longitude', -_MAX_LONGITUDE, _MAX_LONGITUDE),
                      ('altitude', -_MAX_ALTITUDE, _MAX_ALTITUDE)),
    'BATTERY_STATUS': (('battery_remaining', -128, 100),),  # below 0: not known
    'SYS_STATUS': (('battery_remaining', -128, 100),),
}
_ITEM_MESSAGES = ('MISSION_ITEM', 'MISSION_ITEM_INT')
_COORDINATES, _PARAMS = ('x', 'y', 'z'), ('param1', 'param2', 'param3', 'param4')


def defect(message: Message) -> str:
    """Describe the first invalid field of a message.

    A parameter of a mission item may be NaN, which leaves it to the autopilot; a coordinate in a
    global frame may not, and nothing may be infinite.

    Args:
        message: as decoded, of any type.

    Returns:
        Field, value and expectation; '' where all fields are valid.
    """
    kind = message.get_type()
    return next(_defects(message), '') if kind in _RANGES or kind in _ITEM_MESSAGES else ''


def _defects(message: Message) -> Iterator[str]:
    kind = message.get_type()
    for name, least, most in _RANGES.get(kind, ()):
        value = getattr(message, name)
        if not least <= value <= most:
            yield f'{name} = {value}: expected a number in [{least}, {most}]'
    if kind not in _ITEM_MESSAGES:
        return
    is_global = message.frame in GLOBAL_FRAMES
    for name in _COORDINATES + _PARAMS:
        value = getattr(message, name)
        if math.isinf(value) or (math.isnan(value) and name in _COORDINATES and (
                is_global or kind == 'MISSION_ITEM')):
            yield f'{name} = {value}: expected a finite number'
