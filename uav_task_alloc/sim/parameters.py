# SPDX-License-Identifier: Apache-2.0
"""Parameters of a simulated autopilot that the bridge reads, as PARAM_VALUE sends them."""
from __future__ import annotations

import struct
from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.transport.codec import Message

_INT, _REAL = dialect.MAV_PARAM_TYPE_INT32, dialect.MAV_PARAM_TYPE_REAL32
# name -> default and type
_DEFAULTS: dict[str, dict[str, tuple[float, int]]] = {
    'ardupilot': {
        'FENCE_ENABLE': (0.0, dialect.MAV_PARAM_TYPE_INT8),
        'FENCE_TYPE': (7.0, dialect.MAV_PARAM_TYPE_INT8),
        'FENCE_ACTION': (1.0, dialect.MAV_PARAM_TYPE_INT8),
        'OA_TYPE': (0.0, dialect.MAV_PARAM_TYPE_INT8),
        'RTL_ALT': (1500.0, _INT),  # [cm]
        'WPNAV_SPEED': (1500.0, _REAL),  # [cm/s]
        'BATT_CAPACITY': (5000.0, _INT), 'BATT2_CAPACITY': (5000.0, _INT),  # [mAh]
    },
    'px4': {
        'GF_ACTION': (2.0, _INT), 'RTL_TYPE': (0.0, _INT),
        'RTL_RETURN_ALT': (60.0, _REAL),  # [m]
        'BAT1_CAPACITY': (5000.0, _REAL), 'BAT2_CAPACITY': (5000.0, _REAL),  # [mAh]
    },
}


class SimParameters:
    """The parameters of one vehicle.

    Args:
        autopilot: 'ardupilot' or 'px4', which sends whole numbers by their bytes.
        changed: (name, value) of those that differ from the defaults.
    """

    def __init__(self, autopilot: str, changed: Iterable[tuple[str, float]]) -> None:
        self._by_bytes = autopilot == 'px4'
        defaults = _DEFAULTS[autopilot]
        self._types = {name: kind for name, (_, kind) in defaults.items()}
        self.values = {**{name: value for name, (value, _) in defaults.items()}, **dict(changed)}

    def get(self, name: str) -> float:
        """The value of a parameter; 0 where the vehicle does not have it."""
        return self.values.get(name, 0.0)

    @property
    def return_height(self) -> float:
        """The height above home to which it returns, unless it is higher [m]."""
        return self.values.get('RTL_RETURN_ALT', 0.01 * self.values.get('RTL_ALT', 0.0))

    def receive(self, message: Message) -> list[Message]:
        """Answer PARAM_REQUEST_READ and PARAM_SET; the answer to an unknown name is none."""
        name = message.param_id
        if name not in self.values:
            return []
        if message.get_type() == 'PARAM_SET':
            self.values[name] = self._decoded(message.param_value, message.param_type)
        return [self._message(name)]

    def _message(self, name: str) -> Message:
        kind, value = self._types.get(name, _REAL), self.values[name]
        if self._by_bytes and kind != _REAL:
            value = struct.unpack('<f', struct.pack('<i', round(value)))[0]
        return dialect.MAVLink_param_value_message(
            name.encode(), value, kind, len(self.values), list(self.values).index(name))

    def _decoded(self, value: float, kind: int) -> float:
        if self._by_bytes and kind != _REAL:
            return float(struct.unpack('<i', struct.pack('<f', value))[0])
        return value
