# SPDX-License-Identifier: Apache-2.0
"""A UAV as the solver sees it: a frozen, checked value in SI units and ENU."""
from __future__ import annotations

import math
from dataclasses import dataclass

from uav_task_alloc.checks import check_id, check_names, check_number, check_point
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model.task import LONG, Point

BASE_RADIUS = 1.0  # [m] from its home within which a UAV is at its base
_UAV_LIMITS = (
    ('endurance', 0.0, math.inf), ('payload_capacity', 0.0, 1e6), ('climb_speed', 0.0, math.inf),
    ('descent_speed', 0.0, math.inf), ('available_from', 0.0, LONG),
    ('available_until', 0.0, math.inf), ('full_range', 0.0, math.inf),
    ('turnaround', 0.0, math.inf), ('full_endurance', 0.0, math.inf))
_AS_NOW = ('full_range', 'full_endurance')  # None: `range`, `endurance`


@dataclass(frozen=True, slots=True)
class Uav:
    """A vehicle as the solver sees it at one moment.

    Attributes:
        id: unique.
        position: [m] ENU, the present one.
        range: [m] that it can still fly.
        cruise_speed: [m/s].
        capabilities: that tasks may require.
        home: [m] ENU, its base; None: its position.
        endurance: [s] that it can still be in the air, service and waiting included.
        payload_capacity: [kg] that it can take on at its base.
        climb_speed: [m/s] at most, upwards.
        descent_speed: [m/s] at most, downwards.
        available_from: [s] from now.
        available_until: [s] from now; its route ends by then.
        full_range: [m] after a visit of its base; None: `range`.
        turnaround: [s] of a visit of its base between two trips; inf: it makes one trip only.
        full_endurance: [s] after a visit of its base; None: `endurance`.
        aboard: ids of tasks whose payload it has on board in the air; None: those of its locked
            tasks and of the current trip of the plan that `plan` starts from.

    Raises:
        InvalidValue: a value is out of range.
    """

    id: str
    position: Point  # [m] ENU
    range: float = math.inf  # [m]
    cruise_speed: float = 15.0  # [m/s]
    capabilities: frozenset[str] = frozenset()
    home: Point | None = None  # [m] ENU
    endurance: float = math.inf  # [s]
    payload_capacity: float = 0.0  # [kg]
    climb_speed: float = math.inf  # [m/s]
    descent_speed: float = math.inf  # [m/s]
    available_from: float = 0.0  # [s]
    available_until: float = math.inf  # [s]
    full_range: float | None = None  # [m]
    turnaround: float = math.inf  # [s]
    full_endurance: float | None = None  # [s]
    aboard: frozenset[str] | None = None

    def __post_init__(self) -> None:
        check_id('uav id', self.id)
        place = f'uav {self.id}: '
        put = object.__setattr__
        put(self, 'position', check_point(place + 'position', self.position))
        put(self, 'range', check_number(place + 'range', self.range, 0.0))
        put(self, 'cruise_speed', check_number(place + 'cruise_speed', self.cruise_speed, 0.0,
                                               1e4, open_low=True))
        put(self, 'capabilities', check_names(place + 'capabilities', self.capabilities))
        if self.home is not None:
            put(self, 'home', check_point(place + 'home', self.home))
        for name, low, high in _UAV_LIMITS:
            if getattr(self, name) is not None or name not in _AS_NOW:
                put(self, name, check_number(place + name, getattr(self, name), low, high,
                                             open_low=name.endswith('_speed')))
        if self.available_until < self.available_from:
            raise InvalidValue(place + 'available_until', self.available_until,
                               f'at least available_from = {self.available_from:g}')
        if self.aboard is not None:
            put(self, 'aboard', check_names(place + 'aboard', self.aboard))

    @property
    def base(self) -> Point:
        """Its home, or its position where it has none [m] ENU."""
        return self.position if self.home is None else self.home

    @property
    def at_base(self) -> bool:
        """Whether it is at its base: on the ground, where waiting uses no endurance."""
        return self.home is None or math.dist(self.position, self.home) <= BASE_RADIUS
