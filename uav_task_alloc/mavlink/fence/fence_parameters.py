# SPDX-License-Identifier: Apache-2.0
"""The parameters of a vehicle about fences, returns and batteries: read, never set."""
from __future__ import annotations

import math
import struct

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import Profile
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.transport.codec import Message

_PERIOD, _TRIES = 2.0, 5  # [s] between requests of missing values; in a row
_REFRESH = 60.0  # [s] until all are read again: another station may set them
_POLYGONS = 4  # bit of FENCE_TYPE
_RETURNS = {'ardupilot': ('RTL_ALT', 'RTL_ALT_M'), 'px4': ('RTL_RETURN_ALT',)}
_SPEEDS = ('WPNAV_SPEED', 'WP_SPD')  # of ArduCopter [cm/s]; [m/s]
_FENCES = {'ardupilot': ('FENCE_ENABLE', 'FENCE_TYPE', 'FENCE_ACTION', 'OA_TYPE'),
           'px4': ('GF_ACTION',)}
_LEAST_CAPACITY = 10.0  # [mAh] of a capacity that is set: both autopilots count by no lower one
_RETURN_HEIGHTS = {'ardupilot': 15.0, 'px4': 60.0}  # [m] defaults of the autopilots
_PLANNERS = (2.0, 3.0)  # OA_TYPE: Dijkstra, and with BendyRuler
_INTEGERS = {d.MAV_PARAM_TYPE_UINT8, d.MAV_PARAM_TYPE_INT8, d.MAV_PARAM_TYPE_UINT16,
             d.MAV_PARAM_TYPE_INT16, d.MAV_PARAM_TYPE_UINT32, d.MAV_PARAM_TYPE_INT32}
_ACTIONS = {
    'FENCE_ACTION': {0: 'report only', 1: 'RTL or land', 2: 'land', 3: 'SmartRTL, RTL or land',
                     4: 'brake or land', 5: 'SmartRTL or land'},
    'GF_ACTION': {0: 'none', 1: 'warning', 2: 'hold', 3: 'return', 4: 'terminate', 5: 'land'},
}


class FenceParameters:
    """What a vehicle does at a breach, and how high it returns.

    Args:
        peer: the vehicle.
        profile: of its autopilot.
    """

    def __init__(self, peer: Peer, profile: Profile) -> None:
        self._peer, self._profile = peer, profile
        self._returns = _RETURNS.get(profile.name, ())
        self.names = (*_FENCES.get(profile.name, ()), *self._returns)
        self.values: dict[str, float] = {}
        self._speeds = _SPEEDS if profile.family == 'copter' else ()
        self._reads_speeds = False
        self._capacities: dict[int, str] = {}  # names of those that are read, by battery
        self._fences = True  # those about fences are read too
        self.reset()

    def reset(self) -> None:
        """Read all again, after a restart of the vehicle."""
        self.values.clear()
        self._asked: dict[str, int] = {}  # requests without an answer, by name
        self._due = 0.0
        self._no_speed = False  # it has not answered
        self._no_answer = False  # all was requested often enough
        self._note_return_height()

    def receive(self, message: Message) -> None:
        """Take a PARAM_VALUE of the vehicle, whoever requested or set it.

        Args:
            message: of the vehicle, of any type.
        """
        if message.get_type() != 'PARAM_VALUE' or message.param_id not in (
                *self.names, *self._speeds, *self._capacities.values()):
            return
        value = float(message.param_value)
        if self._profile.name == 'px4' and message.param_type in _INTEGERS:
            value = float(struct.unpack('<i', struct.pack('<f', value))[0])  # sent by its bytes
        if not math.isfinite(value):
            return
        self.values[message.param_id] = value
        self._note_return_height()
        self._asked.pop(message.param_id, None)

    def is_idle(self, now: float, fences: bool = True) -> bool:
        """Whether `step` would return nothing.

        Args:
            now: steady time [s].
            fences: those about fences too, not only about returns.
        """
        return fences == self._fences and now < self._due

    def step(self, now: float, fences: bool = True) -> list[Message]:
        """The requests that are due.

        Args:
            now: steady time [s].
            fences: those about fences too, not only about returns.
        """
        if fences != self._fences:
            self._fences, self._due = fences, now
        if now < self._due:
            return []
        names = self.names if fences else self._returns
        names = (*names, *(self._speeds if self._reads_speeds else ()),
                 *self._capacities.values())
        open_names = [name for name in names
                      if name not in self.values and self._asked.get(name, 0) < _TRIES]
        if not open_names:
            self._due = now + _REFRESH
            self._no_speed, self._no_answer = self._reads_speeds, True
            self._note_return_height()
            self._asked = {}
            open_names = [name for name in names if name in self.values]
        else:
            self._due = now + _PERIOD
        for name in open_names:
            self._asked[name] = self._asked.get(name, 0) + 1
        return [self._peer.read_parameter(name) for name in open_names]

    def cruise_speed(self, wanted: bool = False) -> float:
        """The cruise speed of an ArduCopter [m/s].

        Args:
            wanted: read it from now on.

        Returns:
            0 while it is being read; NaN where it is not known.
        """
        if wanted and self._speeds and not self._reads_speeds:
            self._reads_speeds, self._due = True, 0.0
        if 'WP_SPD' in self.values:
            return self.values['WP_SPD']
        if 'WPNAV_SPEED' in self.values:
            return self.values['WPNAV_SPEED'] * 0.01
        return 0.0 if wanted and self._speeds and not self._no_speed else math.nan

    def capacity(self, battery: int) -> float:
        """The capacity that is set for a battery [mAh], which is read from now on.

        Args:
            battery: number of BATTERY_STATUS.

        Returns:
            NaN where it is not known, or not yet.
        """
        if battery not in self._capacities and self._profile.name in _FENCES:
            number = f'{battery + 1}' if battery or self._profile.name == 'px4' else ''
            name = 'BAT' if self._profile.name == 'px4' else 'BATT'
            self._capacities[battery] = f'{name}{number}_CAPACITY'
            self._due = 0.0
        value = self.values.get(self._capacities.get(battery, ''), math.nan)
        return value if _LEAST_CAPACITY < value < math.inf else math.nan

    @property
    def enabled(self) -> bool | None:
        """Whether breaches of circles and polygons are detected; None: not known."""
        get = self.values.get
        if self._profile.name == 'px4':
            action = get('GF_ACTION')
            return None if action is None else action > 0.0
        enable, kinds = get('FENCE_ENABLE'), get('FENCE_TYPE')
        if enable is None or kinds is None:
            return None
        return enable > 0.0 and bool(int(kinds) & _POLYGONS)

    @property
    def plans_around(self) -> bool:
        """Whether a return flies around the fence (ArduPilot, OA_TYPE with Dijkstra)."""
        return bool(self.enabled) and self.values.get('OA_TYPE') in _PLANNERS

    @property
    def return_height(self) -> float:
        """[m] above home, at least; the default of the autopilot where it is not known."""
        if 'RTL_ALT_M' in self.values:
            return self.values['RTL_ALT_M']
        if 'RTL_ALT' in self.values:
            return self.values['RTL_ALT'] * 0.01
        return self.values.get('RTL_RETURN_ALT', _RETURN_HEIGHTS.get(self._profile.name, 0.0))

    def known_return_height(self) -> float:
        """`return_height`, NaN while it is being read."""
        return self._known_height

    def _note_return_height(self) -> None:
        known = self._no_answer or not self._returns or any(
            name in self.values for name in self._returns)
        self._known_height = self.return_height if known else math.nan

    @property
    def text(self) -> str:
        """Whether the fence is on, and what happens at a breach."""
        name = 'GF_ACTION' if self._profile.name == 'px4' else 'FENCE_ACTION'
        if self.enabled is None:
            return 'not known whether it is on'
        parts = [f'{name} {self.values[name]:g} ({_ACTIONS[name].get(int(self.values[name]))})'
                 ] if name in self.values else []
        if name == 'FENCE_ACTION':
            parts = [f'{each} {self.values[each]:g}' for each in ('FENCE_ENABLE', 'FENCE_TYPE')
                     ] + parts
        return ('on' if self.enabled else 'OFF on the vehicle') + ': ' + ', '.join(parts)
