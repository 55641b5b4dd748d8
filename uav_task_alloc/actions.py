# SPDX-License-Identifier: Apache-2.0
"""Actions at a task or along its way: named, with checked values; what flies them is not here."""
from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from uav_task_alloc.checks import FAR, check_number
from uav_task_alloc.errors import InvalidValue

_TURN = 2.0 * math.pi
SETTLE = 1.0  # [s] that a mission holds at least at the end of a service with actions
LASTING = frozenset({'video', 'trigger', 'roi', 'speed'})  # are ended at the end of a service


class Bounds(NamedTuple):
    """A value of an action."""

    low: float
    high: float
    default: float | None = None  # None: it has to be given
    whole: bool = False  # an integer
    open_low: bool = False  # more than `low`


ACTIONS: Mapping[str, Mapping[str, Bounds]] = {
    # so many photos, every so many seconds, where the UAV is
    'photo': {'count': Bounds(1.0, 1e4, 1.0, whole=True), 'interval': Bounds(0.0, 3600.0, 1.0)},
    'video': {},  # from the begin to the end of the piece
    'trigger': {'distance': Bounds(0.0, 1e4, open_low=True)},  # [m] between photos along the piece
    # [rad], pitch positive up, yaw clockwise from the heading
    'gimbal': {'pitch': Bounds(-math.pi, math.pi), 'yaw': Bounds(-_TURN, _TURN, 0.0)},
    'roi': {'x': Bounds(-FAR, FAR), 'y': Bounds(-FAR, FAR), 'z': Bounds(-FAR, FAR)},  # [m] ENU
    'servo': {'channel': Bounds(1.0, 32.0, whole=True), 'pwm': Bounds(500.0, 2500.0)},  # [us]
    'gripper': {'release': Bounds(0.0, 1.0, whole=True)},  # 1: release, 0: grab
    'wait': {'seconds': Bounds(0.0, 86_400.0)},  # [s]
    'speed': {'speed': Bounds(0.0, 1e4, open_low=True)},  # [m/s] until the end of the piece
}


@dataclass(frozen=True, slots=True)
class Action:
    """Something that a UAV does at a task, besides being there.

    Attributes:
        name: one of ACTIONS.
        values: (key, value) of each key of the action, in the order of ACTIONS; may be given as
            a mapping, and without keys that have a default.

    Raises:
        InvalidValue: there is no such action or key, a key is missing or twice, or a value is out
            of range.
    """

    name: str
    values: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or self.name not in ACTIONS:
            raise InvalidValue('action', self.name, f'one of {", ".join(ACTIONS)}')
        keys = ACTIONS[self.name]
        given = _pairs(f'action {self.name}', self.values)
        for name in given:
            if name not in keys:
                raise InvalidValue(f'action {self.name}: key', name,
                                   f'one of {", ".join(keys)}' if keys else 'no keys')
        object.__setattr__(self, 'values', tuple(
            (name, _checked(f'action {self.name}: {name}', given.get(name, key.default), key))
            for name, key in keys.items()))

    def __getitem__(self, key: str) -> float:
        """The value of a key of the action."""
        return dict(self.values)[key]


def _pairs(place: str, values: object) -> dict[str, float]:
    """What was given, by key."""
    if isinstance(values, Mapping):
        return dict(values)
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise InvalidValue(place, values, 'a mapping of keys to values')
    found: dict[str, float] = {}
    for each in values:
        if not isinstance(each, (tuple, list)) or len(each) != 2:
            raise InvalidValue(place, each, 'a key and its value')
        if each[0] in found:
            raise InvalidValue(f'{place}: key', each[0], 'a key used once')
        found[each[0]] = each[1]
    return found


def _checked(place: str, value: float | None, key: Bounds) -> float:
    """One value, in its range."""
    if value is None:
        raise InvalidValue(place, value, f'a number in [{key.low:g}, {key.high:g}]')
    number = check_number(place, value, key.low, key.high, key.open_low)
    if key.whole and not number.is_integer():
        raise InvalidValue(place, number, f'an integer in [{key.low:g}, {key.high:g}]')
    return number


def check_actions(place: str, actions: Iterable[Action]) -> tuple[Action, ...]:
    """Check a list of actions.

    Args:
        place: name of the value in the error text.
        actions: in the order in which they begin.

    Returns:
        The same.

    Raises:
        InvalidValue: it holds something else.
    """
    if isinstance(actions, str) or not isinstance(actions, Iterable):
        raise InvalidValue(place, actions, 'a sequence of actions')
    checked = tuple(actions)
    for each in checked:
        if not isinstance(each, Action):
            raise InvalidValue(place, each, 'an Action')
    return checked


def stay_time(service_time: float, actions: Collection[Action], at_point: bool) -> float:
    """Return how long a UAV stays for a service with actions, as missions carry them out.

    At a point a mission holds for a second at least, in which commands are carried out, and holds
    twice where an action has to be ended: before its end and after it. At the ends of a way it
    brakes anyway, which takes as long as such a hold.

    Args:
        service_time: [s].
        actions: of one task.
        at_point: the task has no way.

    Returns:
        [s].
    """
    if not actions:
        return service_time
    if not at_point:
        return service_time + actions_time(actions)
    holds = 1 + any(each.name in LASTING for each in actions)
    return holds * max(service_time, SETTLE) + actions_time(actions)


def actions_time(actions: Iterable[Action]) -> float:
    """Return what actions take where the UAV stays for them: waits, and intervals of photos.

    Args:
        actions: of one task.

    Returns:
        [s].
    """
    waits = sum(each['seconds'] for each in actions if each.name == 'wait')
    return waits + sum((each['count'] - 1.0) * each['interval']
                       for each in actions if each.name == 'photo')
